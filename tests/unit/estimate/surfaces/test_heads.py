"""The head surface: what ships, how it follows a face's points, and how it is laid over IUV."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.surfaces.head_drawing import lay_head
from motion_transfer.estimate.surfaces.head_surface import load_head

PX_PER_METRE = 400.0
MIDDLE = np.array([100.0, 90.0, 0.0])
WHOLE = Box(0, 0, 200, 200)
HAIR, NECK, HAND = (23, 7, 7), (24, 8, 8), (4, 60, 70)


def seen(yaw: float = 0.0) -> np.ndarray:
    """A face's points on the picture; with a positive angle, degrees, it looks to the right."""
    turn = cv2.Rodrigues(np.array([0, -np.radians(yaw), 0]))[0]
    return (load_head().marks @ turn.T * PX_PER_METRE + MIDDLE).astype(np.float32)


def painted() -> np.ndarray:
    """Hair wider than the head, with a neck."""
    iuv = np.zeros((200, 200, 3), np.uint8)
    iuv[10:122, 40:160] = HAIR
    iuv[122:150, 80:120] = NECK
    iuv[150:] = 2, 50, 60
    return iuv


def test_what_ships_is_a_whole_surface() -> None:
    head = load_head()
    assert head.faces.min() == 0 and head.faces.max() == len(head.points) - 1
    assert set(np.unique(head.part)) == {23, 24}
    assert 0.2 < np.ptp(head.points[:, 1]) < 0.32  # metres, from crown to chin
    assert np.isfinite(head.points).all() and np.isfinite(head.marks).all()
    # the face's points lie on it, nearer to who looks than its middle
    away = np.linalg.norm(head.marks[:, None] - head.points, axis=2).min(1)
    assert np.median(away) < 0.02
    assert head.marks[:, 2].mean() < -0.04


@pytest.mark.parametrize("yaw", [-50, 0, 20])
def test_a_fit_finds_turn_scale_and_place(yaw: float) -> None:
    scale, turn, middle = load_head().fit(seen(yaw))
    assert scale == pytest.approx(PX_PER_METRE, rel=1e-4)
    assert middle == pytest.approx(MIDDLE, abs=0.05)
    ahead = turn @ np.array([0, 0, -1])
    assert np.degrees(np.arctan2(ahead[0], -ahead[2])) == pytest.approx(yaw, abs=0.05)


def test_a_head_replaces_what_was_painted_of_it() -> None:
    iuv = painted()
    lay_head(iuv, WHOLE, seen())
    assert not (iuv == HAIR).all(-1).any(), "hair is not the head's"
    assert iuv[20, 45, 0] == 0
    assert (iuv[145:150, 85:115] == NECK).all(), "the neck stays"
    assert (iuv[150:] == (2, 50, 60)).all()
    head = iuv[40:120, 60:140, 0]
    right, left = (np.nonzero(head == part)[1].mean() for part in (23, 24))
    assert right < left, "the person's right is the picture's left"
    assert (iuv[50:120, 100, 0] >= 23).all(), "its halves meet"


def test_a_turned_head_shows_more_of_one_side() -> None:
    iuv = painted()
    lay_head(iuv, WHOLE, seen(40))
    right, left = ((iuv[..., 0] == part)[:120].sum() for part in (23, 24))
    assert right > 2 * left


def test_hands_before_the_face_stay() -> None:
    iuv = painted()
    iuv[90:110, 90:110] = HAND
    lay_head(iuv, WHOLE, seen())
    assert (iuv[90:110, 90:110] == HAND).all()


def test_a_head_outside_of_its_persons_box_changes_nothing() -> None:
    iuv = painted()
    lay_head(iuv, WHOLE, seen() + np.array([900, 0, 0], np.float32))
    assert np.array_equal(iuv, painted())


def test_the_table_is_small() -> None:
    import motion_transfer.estimate.surfaces as home

    assert (Path(home.__file__).parent / "head.npz").stat().st_size < 40_000
