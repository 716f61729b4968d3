"""Planning a driver: ranges, chunks, who is where."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from motion_transfer.drawing.person import Box, People, Person
from motion_transfer.drawing.window import Window
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.option import frame_range
from motion_transfer.render.plan import (
    CHUNK_FRAMES,
    DriverPlan,
    FramePlan,
    SeenFrame,
    list_stretches,
    plan_path,
    scan_people,
)


def plan(studio, iuvs: np.ndarray, **changes) -> DriverPlan:
    settings = {"frames": (None, None), "person": "largest", "workers": 2, "done": lambda _: None}
    settings |= changes
    reader = open_reader(open_stream(studio.array(iuvs)))
    name = str(reader.stream.path)
    chosen = frame_range(settings["frames"], reader.stream.frame_count, name)
    seen = scan_people(reader, chosen, settings["workers"], settings["done"])
    found = next((i for i, frame in enumerate(seen) if frame.people.persons), 0)
    return plan_path(
        seen,
        chosen=chosen,
        frame_rate=Fraction(25),
        person=settings["person"],
        where=name,
        where_first=reader.stream.where(chosen.start),
        where_found=reader.stream.where(chosen.start + found),
        missing=settings.get("missing"),
        cuts=settings.get("cuts", ()),
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
    chunks = DriverPlan(0, (frame,) * count, (), Fraction(25)).chunks
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
    assert planned.missing == [(3, 5), (9, 10), (11, 12)]


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
    assert planned.frames[1].person.box.right < 96


def test_held_frames_show_the_last_one_with_somebody(studio) -> None:
    frames = studio.walk(9)
    frames[[0, 1, 4, 5, 8]] = 0
    planned = plan(studio, frames, missing="hold")
    assert [frame.held for frame in planned.frames] == [2, 2, None, None, 3, 3, None, None, 7]
    assert planned.frames[4].person == planned.frames[3].person
    assert planned.frames[4].digest == planned.frames[3].digest
    assert planned.missing == [(0, 2), (4, 6), (8, 9)]


def test_background_may_begin_a_driver(studio) -> None:
    frames = studio.walk(5)
    frames[:2] = 0
    planned = plan(studio, frames, missing="background")
    assert [frame.person is None for frame in planned.frames] == [True, True, False, False, False]


def test_missing_fail_names_every_stretch_with_its_times(studio) -> None:
    frames = studio.walk(60)
    frames[[10, 11, 50]] = 0
    with pytest.raises(InputError, match=r"0:00.32-0:00.40 \(frames 10:12\), 0:01.92-0:01.96 \("):
        plan(studio, frames, missing="fail", frames=(2, None))
    assert plan(studio, frames[:10], missing="fail").missing == []


def test_long_lists_are_cut() -> None:
    text = list_stretches([(2 * i, 2 * i + 1) for i in range(13)], 0, Fraction(1, 60))
    assert text.startswith("0:00.00-1:00.00 (frames 0:1), 2:00.00-3:00.00")
    assert text.endswith("(frames 18:19) and 3 more")


def test_each_shot_has_its_own_window_and_person(studio) -> None:
    """Two shots: somebody on the left, then somebody on the right with a smaller one beside."""
    frames = np.zeros((8, 96, 240, 3), np.uint8)
    frames[:5, :, :64] = studio.walk(5)
    frames[5:, :, 160:224] = studio.walk(3)
    frames[5:, :, :64] = studio.iuv(parts=(2, 23, 24))
    planned = plan(studio, frames, cuts=(5,))
    assert [(shot.start, shot.stop) for shot in planned.shots] == [(0, 5), (5, 8)]
    left, right = (shot.window for shot in planned.shots)
    assert left.x + left.side < right.x
    assert all(frame.person.box.left >= 160 for frame in planned.frames[5:])
    (whole,) = plan(studio, frames).shots
    assert all(frame.person.box.right <= 64 for frame in plan(studio, frames).frames[:5])
    assert (whole.start, whole.stop) == (0, 8)


def test_cuts_outside_the_chosen_frames_do_not_count(studio) -> None:
    planned = plan(studio, studio.walk(10), cuts=(0, 2, 5, 9), frames=(2, 9))
    assert [(shot.start, shot.stop) for shot in planned.shots] == [(0, 3), (3, 7)]


def test_a_shot_without_anybody_is_drawn_in_the_last_window(studio) -> None:
    frames = studio.walk(6)
    frames[2:4] = 0
    first, second, third = plan(studio, frames, cuts=(2, 4)).shots
    assert second.window == first.window
    assert plan(studio, frames, cuts=(2, 4), missing="hold").frames[3].held == 1
    assert third.start == 4


def test_nobody_in_particular_is_whoever_is_there(studio) -> None:
    """One person who jumps to where nobody was, and grows, is still the one."""
    frames = np.zeros((2, 300, 300, 3), np.uint8)
    frames[0, :96, :64] = studio.iuv()
    frames[1, :, 100:300] = studio.iuv(scale=3, size=(300, 200))
    assert plan(studio, frames).frames[1].person is None
    assert plan(studio, frames, person=None).frames[1].person.box.left >= 100


def test_chunks_are_divided_at_cuts(studio) -> None:
    planned = plan(studio, studio.walk(CHUNK_FRAMES + 10), cuts=(7, CHUNK_FRAMES + 3))
    pieces = [[(s.start, s.stop) for s in planned.shots_in(chunk)] for chunk in planned.chunks]
    second = CHUNK_FRAMES
    assert pieces == [[(0, 7), (7, second)], [(second, second + 3), (second + 3, second + 10)]]


def test_a_given_window_is_every_shots() -> None:
    seen = [SeenFrame(People((Person(Box(4, 5, 20, 60), 500, (1,)),), 1), "")] * 6
    planned = plan_path(
        seen,
        chosen=range(6),
        frame_rate=Fraction(25),
        person="largest",
        where="d",
        where_first="d",
        where_found="d",
        cuts=(3,),
        window=Window(1, 2, 99),
    )
    assert [(s.start, s.stop, s.window) for s in planned.shots] == [
        (0, 3, Window(1, 2, 99)),
        (3, 6, Window(1, 2, 99)),
    ]
