"""Runs wait for their turn, are stopped, and go on, also when the program was ended meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone
from motion_transfer.preview.renders import Render, RenderQueue
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.plan import CHUNK_FRAMES

COUNT = 2 * CHUNK_FRAMES + 8  # more than one piece


@pytest.fixture
def options(studio, tmp_path: Path) -> RenderOptions:
    return RenderOptions(
        source=(studio.source(),),
        driver=studio.driver(COUNT),
        output=tmp_path / "out",
        renderer="texture",
        workers=1,
    )


@pytest.fixture
def open_queue(tmp_path: Path) -> Iterator[Callable[[], RenderQueue]]:
    queues = []

    def make() -> RenderQueue:
        queues.append(RenderQueue(tmp_path / "renders", tmp_path / "estimates", lambda: None))
        return queues[-1]

    yield make
    for queue in queues:
        queue.close()


def ended(queue: RenderQueue, number: int) -> Render:
    end = time.monotonic() + 60
    while queue.get(number).status in ("waiting", "running"):
        assert time.monotonic() < end, "it did not end within a minute"
        time.sleep(0.02)
    return queue.get(number)


def stop_when_some_is_done(queue: RenderQueue, wanted: int) -> None:
    """Stop a run as soon as its first pieces are finished."""
    hear = queue._hear

    def listen(number: int, event) -> None:
        progress = queue.get(number).progress
        is_drawing = progress is not None and progress.stage == "render"
        if number == wanted and is_drawing and progress.done > CHUNK_FRAMES:
            queue.stop(number)
        hear(number, event)

    queue._hear = listen


def test_runs_take_turns(options: RenderOptions, open_queue, tmp_path) -> None:
    queue = open_queue()
    first = queue.add(options)
    second = queue.add(replace(options, output=tmp_path / "second", frames=(0, 4)))
    with pytest.raises(InputError, match="being rendered already"):
        queue.add(options)
    assert [ended(queue, each.number).status for each in (first, second)] == ["done", "done"]
    assert len(list((tmp_path / "second").iterdir())) == 4


def test_a_stopped_run_goes_on_where_it_was(options: RenderOptions, open_queue) -> None:
    queue = open_queue()
    stop_when_some_is_done(queue, 1)
    render = queue.add(options)
    assert ended(queue, render.number).status == "stopped"
    assert not options.output.exists()
    del queue._hear
    queue.resume(render.number)
    finished = ended(queue, render.number)
    assert finished.status == "done"
    assert finished.progress is not None
    assert finished.progress.found >= CHUNK_FRAMES, "what was finished is not drawn again"
    assert len(list(options.output.iterdir())) == COUNT


def test_what_the_program_left_goes_on_in_the_next(options: RenderOptions, open_queue) -> None:
    queue = open_queue()
    stop_when_some_is_done(queue, 1)
    number = queue.add(options).number
    ended(queue, number)
    queue.close()
    later = open_queue()
    (found,) = later.all
    assert (found.status, replace(found.options, workers=1)) == ("stopped", options)
    later.resume(found.number)
    assert ended(later, found.number).status == "done"
    later.close()
    assert [each.status for each in open_queue().all] == ["done"]


def test_one_that_waits_is_stopped_and_forgotten(options: RenderOptions, open_queue, tmp_path):
    queue = open_queue()
    first = queue.add(options)
    second = queue.add(replace(options, output=tmp_path / "second"))
    queue.stop(second.number)
    assert queue.get(second.number).status == "stopped"
    queue.remove(second.number)
    with pytest.raises(InputError, match="no render"):
        queue.get(second.number)
    ended(queue, first.number)
    assert [path.name for path in (tmp_path / "renders").iterdir()] == ["0001.yaml"]
    assert not (tmp_path / "second").exists()


def test_a_run_that_fails_says_why_and_the_next_one_has_its_turn(
    options: RenderOptions, open_queue, tmp_path
) -> None:
    queue = open_queue()
    failing = queue.add(replace(options, driver=tmp_path / "gone", output=tmp_path / "none"))
    working = queue.add(replace(options, frames=(0, 4)))
    assert ended(queue, failing.number).status == "failed"
    assert "does not exist" in queue.get(failing.number).message
    assert ended(queue, working.number).status == "done"


def test_a_result_that_somebody_took_away_is_told(options: RenderOptions, open_queue) -> None:
    queue = open_queue()
    render = ended(queue, queue.add(replace(options, frames=(0, 4))).number)
    assert (render.status, render.told()["gone"]) == ("done", False)
    options.output.rename(options.output.with_name("elsewhere"))
    assert render.told()["gone"]


def test_time_left_is_told_by_what_was_made_now() -> None:
    from motion_transfer.preview.progress import Progress

    began = time.monotonic() - 10
    progress = Progress("render", 60, 100, found=40, began=began)
    assert progress.seconds_left == pytest.approx(20, abs=0.5), "20 in 10 s, and 40 to go"
    assert Progress("render", 40, 100, found=40, began=began).seconds_left is None
    assert FramesDone(3).frame_count == progress.after(3).done - 60
