"""Who draws, how many at a time, and that it never shows in the result."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from motion_transfer.drawing.engines.interface import LANES
from motion_transfer.drawing.renderers.interface import Occupied
from motion_transfer.errors import RenderError
from motion_transfer.events import ignore
from motion_transfer.media.work import WorkFolder
from motion_transfer.render.composition import Prepared
from motion_transfer.render.engine import Engine
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.plan import CHUNK_FRAMES
from motion_transfer.render.run import prepare

FRAMES = CHUNK_FRAMES + 9
BATCH = 2


class Slow:
    """Paints the IUV, after a while; knows how many calls there were at a time, and by whom."""

    name = "slow"

    def __init__(self, occupies: Occupied, *, fails_at: int = -1) -> None:
        self.occupies: Occupied = occupies
        self.calls = 0
        self.most = 0
        self.callers: set[str] = set()
        self.torch_threads: set[int] = set()
        self._fails_at = fails_at
        self._now = 0
        self._lock = threading.Lock()

    def working_size(self, window_side: int) -> int:
        return window_side

    def batch_size(self, side: int) -> int:
        return BATCH

    def render(self, iuv: np.ndarray) -> np.ndarray:
        with self._lock:
            number, self.calls, self._now = self.calls, self.calls + 1, self._now + 1
            self.most = max(self.most, self._now)
            self.callers.add(threading.current_thread().name.rsplit("_", 1)[0])
            self.torch_threads.add(torch.get_num_threads())
        time.sleep(0.02)
        with self._lock:
            self._now -= 1
        if number == self._fails_at:
            raise RuntimeError("no more memory")
        return np.concatenate([iuv, (iuv[..., :1] > 0) * np.uint8(255)], axis=-1)


@pytest.fixture
def prepared(studio) -> Prepared:
    options = RenderOptions(
        source=(studio.source(),),
        driver=studio.array(FRAMES),
        output=studio.folder / "out.mkv",
        renderer="texture",
    )
    with WorkFolder(options.output) as work:
        return prepare(options, work, ignore).prepared


def engine_of(prepared: Prepared, renderer: Slow) -> Engine:
    return Engine(
        prepared,
        readers=prepared.open_people(),
        renderers=[renderer],
        backdrop=prepared.backdrop.open(),
    )


def rendered(prepared: Prepared, renderer: Slow, folder: Path, **settings: Any) -> list[bytes]:
    folder.mkdir()
    engine = engine_of(prepared, renderer)
    chunks = [(chunk, folder / f"{chunk.index}.nut") for chunk in prepared.plan.chunks]
    engine.render(chunks, finished=lambda _chunk, _path: None, **settings)
    return [path.read_bytes() for _, path in chunks]


def test_the_bytes_do_not_know_who_drew(tmp_path: Path, prepared: Prepared) -> None:
    renderers = [Slow("nothing"), Slow("device"), Slow("core"), Slow("core")]
    results = [
        rendered(prepared, renderer, tmp_path / f"run{index}", threads=threads)
        for index, (renderer, threads) in enumerate(zip(renderers, (2, 2, 1, 3), strict=True))
    ]
    assert all(result == results[0] for result in results)
    assert len(results[0]) == 2
    assert [renderer.most for renderer in renderers] == [2, LANES, 1, 3]
    assert [renderer.callers for renderer in renderers] == [{"chunk"}, *[{"draw"}] * 3]


def test_one_chunk_alone_keeps_all_threads_busy(tmp_path: Path, prepared: Prepared) -> None:
    renderer = Slow("core")
    engine = engine_of(prepared, renderer)
    chunk = prepared.plan.chunks[0]
    engine.render([(chunk, tmp_path / "only.nut")], 4, lambda _chunk, _path: None)
    assert renderer.most == 4
    assert renderer.calls == CHUNK_FRAMES // BATCH


def test_a_call_computes_with_one_thread(tmp_path: Path, prepared: Prepared) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(before + 1)
    try:
        renderer = Slow("core")
        rendered(prepared, renderer, tmp_path / "run", threads=2)
        assert renderer.torch_threads == {1}
        assert torch.get_num_threads() == before + 1
    finally:
        torch.set_num_threads(before)


def test_what_waits_is_not_drawn_once_a_call_has_failed(tmp_path: Path, prepared: Prepared) -> None:
    renderer = Slow("core", fails_at=3)
    with pytest.raises(RenderError, match=r"driver.s frames \d+ to \d+: no more memory"):
        rendered(prepared, renderer, tmp_path / "run", threads=1)
    assert renderer.calls < 8
