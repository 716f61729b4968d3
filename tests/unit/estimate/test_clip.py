"""Clips as IUV: shots, people, and frames without any, with an estimator that sees rectangles."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing

import numpy as np
import pytest
from estimate_stubs import BLUE, COLOURS, GREEN, RED, FramesInMemory, RectangleEstimator, scene
from skimage import data

from motion_transfer.drawing.person import Box, Follower, choose_box, find_people
from motion_transfer.errors import InputError
from motion_transfer.estimate.clip import ClipSummary, estimate_clip, lay_iuv
from motion_transfer.estimate.interface import PersonEstimate

LEFT, RIGHT = Box(5, 10, 20, 50), Box(40, 5, 65, 55)
EMPTY = scene()


def parts(frames: list[np.ndarray], **options) -> tuple[list[set[int]], ClipSummary]:
    """The parts in each frame; the stub's people are parts 2 (red), 3 (green) and 4 (blue)."""
    summary = ClipSummary()
    iuv = estimate_clip(FramesInMemory(frames), RectangleEstimator(), summary=summary, **options)
    return [set(np.unique(frame[..., 0])) - {0} for frame in iuv], summary


def test_every_frame_is_estimated_and_counted() -> None:
    frames = [scene((RED, LEFT)), scene((RED, LEFT), (GREEN, RIGHT)), EMPTY, scene((RED, LEFT))]
    seen, summary = parts(frames)
    assert seen == [{2}, {2, 3}, set(), {2}]
    assert (summary.frame_count, summary.most_people) == (4, 2)
    assert summary.empty == [(2, 3)]
    assert summary.shots == [0]


class StagedRectangles(RectangleEstimator):
    """Looks at frames one after the other, and at what is in them whenever it is asked to."""

    def locate(self, frame: np.ndarray) -> Callable[[], list[PersonEstimate]]:
        self.located = [*getattr(self, "located", []), int(frame[0, 0, 0])]

        def finish() -> list[PersonEstimate]:
            time.sleep(0.01 * (frame[0, 0, 0] % 3))  # later frames are finished first
            return self.estimate(frame)

        return finish


def test_frames_finished_out_of_order_come_in_order() -> None:
    frames = [
        scene((COLOURS[index % 3], Box(5 + index, 10, 20 + index, 50)), ground=90 + index)
        for index in range(9)
    ]
    estimator = StagedRectangles()
    seen = list(estimate_clip(FramesInMemory(frames), estimator))
    assert estimator.located == list(range(90, 99))
    for one, other in zip(
        seen, estimate_clip(FramesInMemory(frames), RectangleEstimator()), strict=True
    ):
        assert np.array_equal(one, other)


@pytest.mark.parametrize(
    ("missing", "expected"),
    [
        ("background", [set(), set(), {2}, set(), {3}, set()]),
        ("hold", [{2}, {2}, {2}, {2}, {3}, {3}]),
    ],
)
def test_frames_without_anybody(missing: str, expected: list) -> None:
    frames = [EMPTY, EMPTY, scene((RED, LEFT)), EMPTY, scene((GREEN, LEFT)), EMPTY]
    seen, summary = parts(frames, missing=missing)
    assert seen == expected
    assert summary.empty == [(0, 2), (3, 4), (5, 6)]


def test_frames_without_anybody_can_be_an_error() -> None:
    with pytest.raises(InputError, match=r"frame 1: nobody found; .*--missing hold"):
        parts([scene((RED, LEFT)), EMPTY, scene((RED, LEFT))], missing="fail")


@pytest.mark.parametrize("missing", ["background", "hold", "fail"])
def test_a_clip_of_nobody_is_refused(missing: str) -> None:
    with pytest.raises(InputError, match="nobody"):
        parts([EMPTY, EMPTY], missing=missing)


def test_a_cut_starts_a_shot() -> None:
    estimator = RectangleEstimator()
    grounds = [np.ascontiguousarray(getattr(data, n)()[:60, :80]) for n in ("coffee", "rocket")]
    frames = [ground.copy() for ground in grounds for _ in range(5)]
    for frame in frames:
        frame[LEFT.slices] = RED
    summary = ClipSummary()
    assert len(list(estimate_clip(FramesInMemory(frames), estimator, summary=summary))) == 10
    assert summary.shots == [0, 5]
    assert estimator.shots == 2


def test_one_person_is_followed_through_an_encounter() -> None:
    """Two cross: at the middle frame green covers red; the largest (red) is followed."""
    frames = []
    for step in range(9):
        red, green = (
            Box(5 + 6 * step, 8, 30 + 6 * step, 55),
            Box(55 - 6 * step, 20, 70 - 6 * step, 50),
        )
        frames.append(scene((RED, red), (GREEN, green)))
    assert parts(frames, person="largest")[0] == [{2}] * 9
    assert parts(frames, person="1")[0] == [{3}] * 9
    assert parts(frames, person="50,20,75,50")[0] == [{3}] * 9


def test_whoever_is_asked_for_must_be_there_at_first() -> None:
    with pytest.raises(InputError, match="person 1 asked for, but only 1 found"):
        parts([scene((RED, LEFT))], person="1")
    with pytest.raises(InputError, match=r"nobody in the box .* people are at 5,10,20,50"):
        parts([scene((RED, LEFT))], person="70,0,80,10")
    with pytest.raises(InputError, match="write largest, an index"):
        Follower("everyone")


def test_a_later_shot_without_the_asked_for_takes_the_largest() -> None:
    follower, estimator = Follower("1"), RectangleEstimator()
    both = estimator.estimate(scene((RED, LEFT), (GREEN, RIGHT)))
    assert [p.track for p in follower.pick(both, "a")] == [1]
    follower.start_shot()
    one = estimator.estimate(scene((BLUE, LEFT)))
    assert [p.track for p in follower.pick(one, "b")] == [2]


def test_the_lost_are_found_by_place_and_size() -> None:
    follower, estimator = Follower("0"), RectangleEstimator()
    follower.pick(estimator.estimate(scene((RED, LEFT), (GREEN, RIGHT))), "a")
    there = estimator.estimate(scene((BLUE, Box(8, 12, 22, 52)), (GREEN, RIGHT)))
    assert [p.track for p in follower.pick(there, "b")] == [2]
    elsewhere = estimator.estimate(scene((RED, Box(60, 12, 74, 52)), (GREEN, Box(30, 5, 50, 55))))
    assert follower.pick(elsewhere, "c") == []


def test_people_who_overlap_stay_apart() -> None:
    red, green = Box(10, 5, 40, 55), Box(30, 20, 60, 50)
    people = RectangleEstimator().estimate(scene((RED, red), (GREEN, green)))
    iuv = lay_iuv(people, 60, 80)
    assert len(find_people(iuv).persons) == 2
    assert iuv[30, 35, 0] == 3  # green stands in front
    assert iuv[10, 35, 0] == 2
    lost = (iuv[..., 0] == 0)[green.slices] & np.ones((30, 30), bool)
    assert 0 < lost.sum() <= 2 * (30 + 30)
    assert set(np.unique(lay_iuv(people[:1], 60, 80)[..., 0])) == {0, 2}


def test_nobody_is_an_empty_image() -> None:
    assert not lay_iuv([], 3, 4).any()


def test_choices_by_size_order_and_place() -> None:
    boxes = [RIGHT, LEFT]
    assert choose_box(boxes, [10, 20], "largest", "") == 1
    assert choose_box(boxes, [10, 20], "0", "") == 1
    assert choose_box(boxes, [10, 20], "45,5,60,50", "") == 0


def test_a_clip_that_is_not_read_to_its_end_is_let_go() -> None:
    clip = FramesInMemory([scene((RED, LEFT))] * 200)
    with closing(estimate_clip(clip, RectangleEstimator())) as frames:
        next(frames)
    assert clip.taken < 30
