"""Cuts, and what is none."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from skimage import data

from motion_transfer.estimate.shots import mark_shots


def scene(name: str, x: int = 0, width: int = 200) -> np.ndarray:
    """A window of a photo, moved to the right."""
    return np.ascontiguousarray(getattr(data, name)()[:200, x : x + width, :3])


def cuts(frames: Iterable[np.ndarray]) -> list[int]:
    return [index for index, (_, begins) in enumerate(mark_shots(frames)) if begins]


def test_a_cut_is_where_the_scene_changes() -> None:
    frames = [scene("astronaut", 3 * i) for i in range(10)]
    frames += [scene("rocket", 3 * i) for i in range(7)]
    frames += [scene("coffee", 3 * i) for i in range(5)]
    assert cuts(frames) == [0, 10, 17]


@pytest.mark.parametrize("step", [1, 12, 25])
def test_a_pan_is_no_cut(step: int) -> None:
    assert cuts(scene("astronaut", step * i) for i in range(300 // step)) == [0]


def test_a_cut_in_a_pan_is_found() -> None:
    frames = [scene("astronaut", 25 * i) for i in range(10)]
    frames += [scene("rocket", 25 * i) for i in range(10)]
    assert cuts(frames) == [0, 10]


@pytest.mark.parametrize("length", [1, 2])
def test_a_flash_is_no_cut(length: int) -> None:
    frames = [scene("astronaut", i) for i in range(20)]
    for index in range(8, 8 + length):
        frames[index] = np.full_like(frames[0], 250)
    assert cuts(frames) == [0]


def test_slowly_falling_dark_is_no_cut() -> None:
    frames = [(scene("astronaut") * (1 - i / 25)).astype(np.uint8) for i in range(25)]
    assert cuts(frames) == [0]


def test_every_frame_comes_back_once_and_in_order() -> None:
    frames = [np.full((4, 5, 3), i, np.uint8) for i in range(7)]
    assert [int(frame[0, 0, 0]) for frame, _ in mark_shots(frames)] == list(range(7))
    assert cuts([]) == []
    assert cuts([np.zeros((1, 1, 3), np.uint8)]) == [0]


def test_only_three_frames_are_kept() -> None:
    taken = 0

    def frames() -> Iterable[np.ndarray]:
        nonlocal taken
        for i in range(50):
            taken += 1
            yield scene("astronaut", i)

    marked = mark_shots(frames())
    next(marked)
    assert taken == 3
