"""The hand surface: what ships, how it follows 21 points, and how it is laid over an IUV image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.interface import LANDMARK, Landmarks
from motion_transfer.estimate.surfaces.hand_drawing import hand_room, lay_hand
from motion_transfer.estimate.surfaces.hand_surface import SIDES, load_hand, turn_between
from motion_transfer.estimate.surfaces.raster import draw_charts

PART = {"right": 3, "left": 4}
PX_PER_METRE = 500.0
CENTRE = np.array([100.0, 150.0, 0.0], np.float32)
INDEX_TIP = 8


def shown(side: str) -> np.ndarray:
    """The hand at rest, its fingers up the picture."""
    joints = load_hand(side).joints
    up = joints[9] - joints[0]
    turn = turn_between(up, np.array([0.0, -1.0, 0.0]))
    return (joints @ turn.T * PX_PER_METRE + CENTRE).astype(np.float32)


def body(side: str, points: np.ndarray) -> Landmarks:
    """Somebody whose forearm comes from below."""
    image = np.zeros((33, 3), np.float32)
    image[LANDMARK[f"{side}-wrist"]] = points[0]
    image[LANDMARK[f"{side}-elbow"]] = points[0] + (0, 150, 0)
    sure = np.ones(33, np.float32)
    return Landmarks(image, np.zeros((33, 3), np.float32), sure, sure)


@pytest.mark.parametrize("side", SIDES)
def test_what_ships_is_a_whole_surface(side: str) -> None:
    hand = load_hand(side)
    assert hand.faces.min() == 0 and hand.faces.max() == len(hand.points) - 1
    assert hand.weights.sum(1) == pytest.approx(1, abs=1e-6)
    assert (hand.part == PART[side]).mean() > 0.8
    assert 0.12 < np.ptp(hand.points, axis=0).max() < 0.35  # metres, with the forearm's end


@pytest.mark.parametrize("side", SIDES)
def test_at_its_own_points_it_rests(side: str) -> None:
    hand = load_hand(side)
    moved = hand.pose(hand.joints * 500 + 7)
    assert moved == pytest.approx(hand.points * 500 + 7, abs=0.5)


def test_a_finger_moves_alone() -> None:
    hand, points = load_hand("left"), shown("left")
    rest = hand.pose(points)
    bent = points.copy()
    bent[INDEX_TIP] = points[INDEX_TIP - 1] + (0, 0, -15)  # its last bone, towards the camera
    away = np.linalg.norm(hand.pose(bent) - rest, axis=1)
    assert away.max() > 8
    last_bone = hand.weights[:, 2 + 3 * 1 + 2] > 0
    assert away[~last_bone].max() < 1e-3


@pytest.mark.parametrize("side", SIDES)
def test_a_hand_is_laid_with_gaps_between_its_fingers(side: str) -> None:
    points = shown(side)
    iuv = np.zeros((200, 200, 3), np.uint8)
    iuv[30:150, 40:160] = PART[side], 9, 9  # a mitt
    iuv[198:] = 2, 50, 60  # something else, far off
    lay_hand(iuv, Box(0, 0, 200, 200), side, points, body(side, points))
    hand = iuv[..., 0] == PART[side]
    assert set(np.unique(iuv[..., 0])) <= {0, 2, PART[side], *range(19, 23)}
    assert not (iuv[hand] == (PART[side], 9, 9)).all(1).any(), "nothing is left of the mitt"
    for tip in (8, 12, 16):
        x, y = points[tip, :2].astype(int)
        assert hand[y - 3 : y + 4, x - 3 : x + 4].any()
    # half-way between two tips there is nothing
    x, y = points[[8, 12], :2].mean(0).astype(int)
    assert not hand[y, x]
    assert (iuv[198:] == (2, 50, 60)).all()


def test_over_a_body_gaps_show_the_body() -> None:
    points = shown("right")
    iuv = np.full((200, 200, 3), (2, 50, 60), np.uint8)
    lay_hand(iuv, Box(0, 0, 200, 200), "right", points, body("right", points))
    assert (iuv[..., 0] > 0).all()
    assert 400 < (iuv[..., 0] == 3).sum() < 10000


def test_a_hand_outside_of_its_persons_box_changes_nothing() -> None:
    points = shown("left") + np.array([900, 0, 0], np.float32)
    iuv = np.zeros((200, 200, 3), np.uint8)
    lay_hand(iuv, Box(0, 0, 200, 200), "left", points, body("left", points))
    assert not iuv.any()


def test_there_is_room_for_a_hand_in_the_frame_only() -> None:
    points = shown("left")
    box = hand_room(points, Box(90, 90, 110, 110), 400, 400)
    assert box.left < points[:, 0].min() and box.top < points[:, 1].min()
    assert hand_room(points - 100, Box(0, 0, 5, 5), 60, 60) == Box(0, 0, *_ends(points - 100, 60))


def _ends(points: np.ndarray, most: int) -> tuple[int, int]:
    low, high = points[:, :2].min(0), points[:, :2].max(0)
    right, bottom = np.ceil(high + 0.15 * (high - low).max()).clip(max=most).astype(int)
    return int(right), int(bottom)


def test_the_nearer_triangle_hides_the_farther() -> None:
    points = np.array(
        [[0, 0, 5], [8, 0, 5], [0, 8, 5], [0, 0, 1], [4, 0, 1], [0, 4, 1]], np.float32
    )
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    uv = np.zeros((2, 3, 2), np.uint8)
    uv[0] = [[0, 0], [80, 0], [0, 80]]
    drawn = draw_charts(points, faces, np.array([7, 9], np.uint8), uv, Box(0, 0, 8, 8))
    assert drawn[0, 0, 0] == 9
    assert drawn[0, 6].tolist() == [7, 65, 5]  # U and V run evenly: 10 a pixel
    assert drawn[7, 7, 0] == 0
    backwards = draw_charts(points, faces[:, ::-1], np.array([7, 9], np.uint8), uv, Box(0, 0, 8, 8))
    assert not backwards.any()


def test_the_table_is_small() -> None:
    import motion_transfer.estimate.surfaces as home

    assert (Path(home.__file__).parent / "hand.npz").stat().st_size < 100_000
