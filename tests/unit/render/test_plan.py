"""Planning a driver: ranges, chunks, who is where."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_stream import open_reader, open_stream
from motion_transfer.render.plan import (
    CHUNK_FRAMES,
    DriverPlan,
    FramePlan,
    empty_stretches,
    frame_range,
    plan_path,
    scan_people,
)
from motion_transfer.render.window import Window


def plan(studio, iuvs: np.ndarray, **changes) -> DriverPlan:
    settings = {"frames": (None, None), "person": "largest", "workers": 2, "done": lambda _: None}
    settings |= changes
    reader = open_reader(open_stream(studio.array(iuvs)))
    name = str(reader.stream.path)
    chosen = frame_range(settings["frames"], reader.stream.frame_count, name)
    return plan_path(
        scan_people(reader, chosen, settings["workers"], settings["done"]),
        chosen=chosen,
        frame_rate=Fraction(25),
        person=settings["person"],
        where=name,
        where_first=reader.stream.where(chosen.start),
    )


@pytest.mark.parametrize(
    ("frames", "expected"),
    [((None, None), (0, 10)), ((3, None), (3, 10)), ((None, 4), (0, 4)), ((9, 10), (9, 10))],
)
def test_frame_range(frames: tuple, expected: tuple[int, int]) -> None:
    assert frame_range(frames, 10, "driver") == range(*expected)


@pytest.mark.parametrize("frames", [(10, None), (0, 11), (5, 5), (6, 5), (-3, None), (0, -1)])
def test_frames_that_are_not_there(frames: tuple) -> None:
    with pytest.raises(InputError, match="but driver has 10: 0:10 at most"):
        frame_range(frames, 10, "driver")


@pytest.mark.parametrize("count", [1, CHUNK_FRAMES - 1, CHUNK_FRAMES, CHUNK_FRAMES + 1, 200])
def test_chunks_cover_every_frame_once(count: int) -> None:
    frame = FramePlan(None, alone=True)
    chunks = DriverPlan(0, (frame,) * count, Window(0, 0, 16), Fraction(25)).chunks
    assert [i for chunk in chunks for i in range(chunk.start, chunk.stop)] == list(range(count))
    assert all(chunk.start == chunk.index * CHUNK_FRAMES for chunk in chunks)


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_the_plan_does_not_depend_on_workers(studio, workers: int) -> None:
    frames = studio.walk(40)
    assert plan(studio, frames, workers=workers) == plan(studio, frames, workers=1)


def test_progress_counts_every_frame(studio) -> None:
    counts: list[int] = []
    plan(studio, studio.walk(40), done=counts.append, frames=(3, 38))
    assert sum(counts) == 35


def test_stretches_without_anybody(studio) -> None:
    frames = studio.walk(12)
    frames[[3, 4, 9, 11]] = 0
    planned = plan(studio, frames, frames=(1, None))
    assert planned.first == 1
    assert list(empty_stretches(planned)) == [(3, 5), (9, 10), (11, 12)]


def test_an_empty_first_frame_says_where_to_start(studio) -> None:
    frames = studio.walk(8)
    frames[:5] = 0
    with pytest.raises(InputError, match=r"frame 2 of .*no person in the first.*--frames 5:8"):
        plan(studio, frames, frames=(2, None))


def test_an_empty_range_is_refused(studio) -> None:
    frames = studio.walk(8)
    frames[2:6] = 0
    with pytest.raises(InputError, match=r"no person in any of the frames 2:6"):
        plan(studio, frames, frames=(2, 6))


def test_only_crowded_frames_are_isolated(studio) -> None:
    frames = np.zeros((2, 96, 160, 3), np.uint8)
    frames[:, :, :64] = studio.walk(2)
    frames[1, :, 96:] = studio.iuv(parts=(2, 23, 24))
    planned = plan(studio, frames)
    assert [frame.alone for frame in planned.frames] == [True, False]
    assert planned.frames[1].person.x1 < 96
