"""Faces: where they are looked for, and when they are left alone."""

from __future__ import annotations

from math import pi
from pathlib import Path

import cv2
import numpy as np
import pytest

import motion_transfer.demo as demo
from motion_transfer.estimate.blazepose.faces import (
    FIRST_CROP,
    OUTER_EYES,
    POINT_COUNT,
    FaceModel,
    find_face,
    first_region,
    next_region,
)
from motion_transfer.estimate.blazepose.tracker import BodyTracker
from motion_transfer.estimate.interface import LANDMARK, Landmarks

PERSON = Path(demo.__file__).parent / "source.png"


def somebody(turn: float = 0.0, size: float = 40.0) -> Landmarks:
    """A face that is seen from the front, its eyes and its mouth a size apart."""
    places = {"nose": (0, 0.5), "mouth-left": (0.4, 1), "mouth-right": (-0.4, 1)}
    places |= {"left-ear": (1, 0.3), "right-ear": (-1, 0.3)}
    for side, x in (("left", 0.5), ("right", -0.5)):
        places |= {f"{side}-eye-{part}": (x, 0) for part in ("inner", "middle", "outer")}
    image = np.zeros((33, 3), np.float32)
    c, s = np.cos(turn), np.sin(turn)
    for name, (x, y) in places.items():
        image[LANDMARK[name], :2] = 200 + size * np.array([c * x - s * y, s * x + c * y])
    sure = np.ones(33, np.float32)
    return Landmarks(image, np.zeros((33, 3), np.float32), sure, sure)


@pytest.mark.parametrize("turn", [0.0, 0.5, -1.2, 3.0])
def test_a_faces_region_is_upright_on_it(turn: float) -> None:
    region = first_region(somebody(turn))
    assert (region.turn - turn + pi) % (2 * pi) - pi == pytest.approx(0, abs=1e-5)
    assert region.side == pytest.approx(FIRST_CROP * 40, rel=1e-5)
    middle = 20 * np.array([-np.sin(turn), np.cos(turn)])
    assert (region.x, region.y) == pytest.approx(tuple(200 + middle), abs=1e-3)


def test_a_second_look_is_where_the_points_are() -> None:
    points = np.zeros((468, 3), np.float32)
    points[:, :2] = np.random.default_rng(0).uniform((80, 60), (120, 160), (468, 2))
    points[0, :2], points[1, :2] = (80, 60), (120, 160)
    points[list(OUTER_EYES), :2] = (85, 90), (115, 90)
    region = next_region(points)
    assert (region.x, region.y, region.turn) == pytest.approx((100, 110, 0), abs=1e-4)
    assert region.side == pytest.approx(150)
    points[list(OUTER_EYES), :2] = (90, 85), (90, 115)  # the head lies on its side
    assert next_region(points).turn == pytest.approx(pi / 2)


@pytest.mark.parametrize("size", [0.0, 3.0, 40.0])
def test_no_face_is_seen_in_noise_nor_looked_for_where_it_is_small(models, size: float) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (400, 400, 3), np.uint8)
    assert FaceModel().find(picture, somebody(size=size)) is None


def test_a_face_is_found(models) -> None:
    picture = cv2.imread(str(PERSON))
    assert picture is not None
    frame = np.ascontiguousarray(picture[..., ::-1])
    ((_, body),) = BodyTracker(most_people=1).follow(frame)
    points = find_face(frame, body.landmarks)
    assert points is not None and points.shape == (POINT_COUNT, 3)
    known = body.landmarks.image[[LANDMARK[f"{side}-eye-outer"] for side in ("right", "left")], :2]
    assert np.abs(points[list(OUTER_EYES), :2] - known).max() < 0.15 * np.ptp(points[:, 1])
