"""Ever new people: painted by processes, kept, drawn, replaced."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from motion_transfer.drawing.source import SourcePicture, unfold_picture
from motion_transfer.drawing.trimming import trim
from motion_transfer.errors import InputError, TrainingError
from motion_transfer.training.config import TrainConfig, build_config
from motion_transfer.training.painters import MOST_SKIPPED, PaintedPerson, Painter, Painters
from motion_transfer.training.pool import FIRST_PEOPLE, PeoplePool
from motion_transfer.training.samples import TrainingSamples, cut_target, halve
from motion_transfer.training.sources import StreamedPairs

VIEWS = 3
CPU = torch.device("cpu")


@pytest.fixture
def config(settings: dict[str, Any]) -> TrainConfig:
    pool = {"data.views": VIEWS, "data.pool": 40, "data.draws": 4, "optimiser.batch_size": 16}
    return build_config({**settings, **pool, "model.image_size": 32, "model.texture_size": 32})


def person(number: int) -> PaintedPerson:
    """Whose image tells who it is, and which view."""
    image = np.zeros((VIEWS, 3, 32, 32), np.uint8)
    image[:, 0] = number
    image[:, 1] = np.arange(VIEWS)[:, None, None]
    iuv = np.zeros_like(image)
    iuv[:, 0, 8:24, 8:24] = 2
    iuv[:, 1:, 8:24, 8:24] = np.mgrid[60:220:10, 60:220:10]
    clearance = np.ones((VIEWS, 2, 128, 128), np.float16)
    picture = np.concatenate([image, iuv], axis=1)
    return PaintedPerson(image, iuv, clearance, image, iuv, image[:, :1], picture)


class Paint:
    """Paints at once, and counts."""

    def __init__(self) -> None:
        self.painted = 0

    def __call__(self, number: int) -> PaintedPerson:
        self.painted += 1
        return person(number)


def ignore(_text: str) -> None: ...


def open_pool(
    config: TrainConfig, paint: Callable[[int], Any]
) -> Iterator[dict[str, torch.Tensor]]:
    painters = Painters(paint, count(), workers=0, note=ignore)
    return iter(PeoplePool(config, painters, CPU, (0,)))


def who(image: torch.Tensor) -> tuple[list[int], list[int]]:
    """Numbers and views that images tell."""
    levels = ((image[:, :2, 8, 8] + 1) * 127.5).round().int()
    return levels[:, 0].tolist(), levels[:, 1].tolist()


def test_two_views_of_one_person(config: TrainConfig) -> None:
    batches = open_pool(config, Paint())
    pairs = set()
    for _ in range(30):
        batch = next(batches)
        numbers, views = who(batch["target_image"])
        row, column = batch["source_visibility"][0, 0].nonzero()[0].tolist()
        sources = who(
            batch["source_texture"][:, :, row, column][:, :, None, None].expand(-1, -1, 9, 9)
        )
        assert numbers == sources[0]
        pairs |= set(zip(sources[1], views, strict=True))
    assert pairs == {(a, b) for a in range(VIEWS) for b in range(VIEWS) if a != b}


def test_painters_keep_the_pace_and_the_oldest_give_way(config: TrainConfig) -> None:
    paint = Paint()
    batches = open_pool(config, paint)
    for number in range(30):
        batch = next(batches)
        assert paint.painted == FIRST_PEOPLE + number * 16 // 4
        oldest = max(0, paint.painted - 40)
        assert all(oldest <= each < paint.painted for each in who(batch["target_image"])[0])


def test_who_is_slow_is_not_waited_for(config: TrainConfig) -> None:
    class Slow(Painters):
        def take(self, *, wait_for_one: bool) -> PaintedPerson | None:
            return super().take(wait_for_one=True) if wait_for_one else None

    painters = Slow(person, count(), workers=0, note=ignore)
    pool = PeoplePool(config, painters, CPU, (0,))
    batches = iter(pool)
    for _ in range(10):
        next(batches)
    assert len(pool) == FIRST_PEOPLE


def test_the_clearance_is_now_and_then_unknown(config: TrainConfig) -> None:
    batches = open_pool(config, Paint())
    known = torch.cat([next(batches)["source_clearance"].amax((1, 2, 3)) for _ in range(20)])
    assert 0.7 < known.mean() < 1


def test_batches_are_as_albums_give_them(body_model) -> None:
    """Of real painted people: keys, shapes, and the very textures and crops, but for rounding."""
    settings = {"model.image_size": 64, "model.texture_size": 64, "data.size_px": 64}
    settings |= {"data.pool": 1, "data.views": 2, "data.jitter": 0.0, "optimiser.batch_size": 2}
    config = build_config({**settings, "losses.perceptual": "none"})
    people = StreamedPairs(seed=3, size=(64, 64), noise=0.0)
    batch = next(open_pool(config, Painter(people, config)))
    samples = TrainingSamples(people, config, textures=None)
    views = people[0].source, people[0].target
    choices = [samples.load(type(people[0])(a, b, group="0")) for a, b in (views, views[::-1])]
    assert batch.keys() == choices[0].keys()
    for place in range(2):
        found = {name: value[place] for name, value in batch.items() if name != "source_clearance"}
        fits = [
            all(torch.allclose(found[k].float(), c[k].float(), atol=1.1 / 127.5) for k in found)
            for c in choices
        ]
        assert sum(fits) == 1


def test_a_painter_trims_and_cuts_as_everybody_does(body_model) -> None:
    config = build_config({"data.size_px": 64, "model.image_size": 64})
    people = StreamedPairs(seed=3, size=(64, 64), noise=0.5)
    painted = Painter(people, config)(1)
    again = Painter(people, config)(1)
    assert all((getattr(painted, name) == getattr(again, name)).all() for name in vars(painted))
    picture = people[1].source.load()
    trimmed = trim(picture.rgb, picture.iuv, picture.alpha)
    assert (painted.photo_iuv[0] == trimmed.transpose(2, 0, 1)).all()
    crop = cut_target(picture, 64, config.data, np.random.default_rng((0, 1, 1)))
    assert (painted.image[0] == crop.rgb.transpose(2, 0, 1)).all()
    assert unfold_picture(SourcePicture(picture.as_photo(), picture.iuv), 64)[1].any()


def test_networks_that_read_the_photo_get_that_of_the_source(config: TrainConfig) -> None:
    reading = replace(config, model=replace(config.model, variant="cbi"))
    batch = next(open_pool(reading, Paint()))
    shown = batch["source_pictures"]
    assert (shown.dtype, shown.shape) == (torch.uint8, (16, 1, 6, 32, 32))
    people, targets = who(batch["target_image"])
    assert shown[:, 0, 0, 8, 8].tolist() == people
    views = shown[:, 0, 1, 8, 8].tolist()
    assert all(view != target for view, target in zip(views, targets, strict=True))
    assert not any(name == "source_pictures" for name in next(open_pool(config, Paint())))
    half = halve(batch)["source_pictures"]
    assert torch.equal(half[:, :, :3], shown[:, :, :3, ::2, ::2]), "of one colour"
    assert torch.equal(half[:, :, 3:], shown[:, :, 3:, 1::2, 1::2])


def test_halved_textures_and_images_are_means(config: TrainConfig) -> None:
    whole = next(open_pool(config, Paint()))
    half = halve(whole)
    assert half.keys() == whole.keys()
    sides = {name: value.shape[-1] for name, value in half.items() if value.ndim == 4}
    assert sides.pop("source_clearance") == 128
    assert set(sides.values()) == {16}
    assert half["target_image"][0, 0, 4, 4] == whole["target_image"][0, 0, 8:10, 8:10].mean()
    assert half["target_iuv"][0, 1, 5, 5] == whole["target_iuv"][0, 1, 11, 11]


# Painters


def test_processes_paint_ahead_but_not_for_ever() -> None:
    painters = Painters(abs, count(-3), workers=2, note=ignore)  # type: ignore[arg-type]
    try:
        found = [painters.take(wait_for_one=True) for _ in range(6)]
        assert sorted(found) == [0, 1, 1, 2, 2, 3]  # type: ignore[type-var]
        deadline = time.monotonic() + 30
        while not all(future.done() for future in painters._asked):
            assert time.monotonic() < deadline
        assert len(painters._asked) == 4
    finally:
        painters.close()


def test_painters_have_one_thread_and_no_gpu() -> None:
    before = dict(os.environ)
    names = iter(["CUDA_VISIBLE_DEVICES", "OMP_NUM_THREADS"])
    painters = Painters(os.getenv, names, workers=1, note=ignore)  # type: ignore[arg-type]
    try:
        assert [painters.take(wait_for_one=True) for _ in range(2)] == ["", "1"]
    finally:
        painters.close()
    assert dict(os.environ) == before


@pytest.mark.parametrize("workers", [0, 1])
def test_who_cannot_be_painted_is_left_out_with_a_note(workers: int) -> None:
    notes: list[str] = []
    numbers = iter([-4, 9])
    painters = Painters(math.sqrt, numbers, workers=workers, note=notes.append)  # type: ignore[arg-type]
    try:
        assert painters.take(wait_for_one=True) == 3
        assert len(notes) == 1 and notes[0].startswith("person -4 cannot be painted (ValueError: ")
    finally:
        painters.close()


def test_if_nobody_can_be_painted_the_run_ends() -> None:
    notes: list[str] = []
    painters = Painters(math.sqrt, count(-99), workers=0, note=notes.append)  # type: ignore[arg-type]
    with pytest.raises(TrainingError, match=r"person -94 cannot be painted .*, nor could 5 others"):
        painters.take(wait_for_one=True)
    assert len(notes) == MOST_SKIPPED


def test_what_a_painter_says_on_purpose_is_heard() -> None:
    def refuse(_number: int) -> PaintedPerson:
        raise InputError("no assets")

    with pytest.raises(InputError, match="no assets"):
        Painters(refuse, count(), workers=0, note=ignore).take(wait_for_one=True)


def test_a_process_that_is_killed_ends_the_run_in_one_line() -> None:
    painters = Painters(os._exit, count(), workers=1, note=ignore)  # type: ignore[arg-type]
    try:
        with pytest.raises(
            TrainingError, match=r"was ended, perhaps for want of memory.*--workers"
        ):
            painters.take(wait_for_one=True)
    finally:
        painters.close()


PARENT = """
import time
from itertools import repeat
from motion_transfer.training.painters import Painters
if __name__ == "__main__":
    painters = Painters(time.sleep, repeat(0.1), workers=1, note=print)
    painters.take(wait_for_one=True)
    print(*painters._pool._processes, flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_painters_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        child = Path("/proc") / parent.stdout.readline().strip()
        assert child.exists()
        parent.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + 30
    while child.exists() and "State:\tZ" not in (child / "status").read_text():
        assert time.monotonic() < deadline
        time.sleep(0.1)
