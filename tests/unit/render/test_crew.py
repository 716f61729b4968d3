"""Processes that help a run: they change nothing, tell what went wrong, and are gone in the end."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from motion_transfer import render_video
from motion_transfer.errors import IuvFileError, RenderError
from motion_transfer.render import crew
from motion_transfer.render.crew import Crew, result_of

FRAMES = 150
SCRIPT = """
import sys
from motion_transfer import render_video
from motion_transfer.render import crew
crew.LEAST_SHARED = 0
render_video(source=sys.argv[1], driver=sys.argv[2], output=sys.argv[3], renderer="texture",
             workers=2)
print("made")
"""


@pytest.fixture
def tasks(monkeypatch) -> Counter[str]:
    """Let processes do everything, in however short a run; count what they were asked."""
    counts: Counter[str] = Counter()
    begin, offer = Crew.begin, Crew.offer

    def begin_and_wait(self: Crew, count: int, frame_count: int) -> None:
        begin(self, count, frame_count)
        while self._workers is not None and self._free.qsize() < count:
            time.sleep(0.01)

    def counted(self: Crew, task: Callable[..., Any], *arguments: Any) -> Any:
        future = offer(self, task, *arguments)
        counts[task.__name__] += future is not None
        return future

    monkeypatch.setattr(crew, "LEAST_SHARED", 1)  # one worker alone has no processes
    monkeypatch.setattr(Crew, "begin", begin_and_wait)
    monkeypatch.setattr(Crew, "offer", counted)
    return counts


def draw(studio, driver: Path, workers: int, name: str) -> Path:
    return render_video(
        source=studio.source(),
        driver=driver,
        output=studio.folder / name / "out.mkv",
        sheet=studio.folder / name / "sheet.png",
        renderer="texture",
        workers=workers,
    ).output


def test_processes_change_nothing(studio, tasks: Counter[str]) -> None:
    driver = studio.array(FRAMES)
    alone = draw(studio, driver, 1, "alone")
    assert not tasks.total()
    helped = draw(studio, driver, 2, "helped")
    assert tasks["_look"] and tasks["render"]
    for name in ("out.mkv", "sheet.png"):
        assert (helped.parent / name).read_bytes() == (alone.parent / name).read_bytes()
    assert {path.name for path in helped.parent.iterdir()} == {"out.mkv", "sheet.png"}
    assert multiprocessing.active_children() == []


def test_a_damaged_frame_is_told_as_by_threads(studio, tasks: Counter[str]) -> None:
    driver = studio.driver(FRAMES)
    broken = sorted(driver.iterdir())[FRAMES // 2]
    broken.write_bytes(broken.read_bytes()[:-20])
    words = []
    for workers in (1, 2):
        with pytest.raises(IuvFileError) as caught:
            draw(studio, driver, workers, f"out{workers}")
        words.append(str(caught.value))
        assert not (studio.folder / f"out{workers}").exists()
    assert tasks["_look"]
    assert words[0] == words[1]
    assert broken.name in words[0]
    assert multiprocessing.active_children() == []


def test_a_process_that_was_killed_is_one_line(tmp_path: Path, tasks: Counter[str]) -> None:
    with Crew(tmp_path / "scratch") as crew:
        crew.begin(2, FRAMES)
        future = crew.offer(os._exit, 9)
        assert future is not None
        with pytest.raises(RenderError, match="a worker process was killed"):
            result_of(future)
    assert multiprocessing.active_children() == []
    assert not (tmp_path / "scratch").exists()


def test_a_script_is_not_run_again_by_its_processes(studio) -> None:
    """One that does not ask for its `__name__` would begin processes of its own in each of them."""
    script = studio.folder / "script.py"
    script.write_text(SCRIPT)
    arguments = (studio.source(), studio.array(FRAMES), studio.folder / "out.mp4")
    result = subprocess.run(
        [sys.executable, script, *arguments], capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "made\n", "")
