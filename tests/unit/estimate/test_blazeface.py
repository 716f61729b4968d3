"""The face detector: its anchors, and that it tells a face from a head without one."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import cv2
import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.estimate.blazeface import FACE_SIZE, FaceDetector, anchor_centres
from motion_transfer.estimate.models import FACE_DETECTOR, find_model
from motion_transfer.media.pictures.photo import read_photo

ASTRONAUT = Path(str(files("motion_transfer.demo") / "astronaut.jpg"))


def test_anchors_cover_the_picture() -> None:
    centres = anchor_centres()
    assert centres.shape == (896, 2)
    np.testing.assert_allclose(centres[[0, 1, 2]] * 128, [[4, 4], [4, 4], [12, 4]])
    np.testing.assert_allclose(
        centres[[511, 512, 517, 518]] * 128, [[124, 124], [8, 8], [8, 8], [24, 8]]
    )
    np.testing.assert_allclose(centres.mean(0), 0.5)


@pytest.fixture(scope="module")
def detector() -> FaceDetector:
    try:
        return FaceDetector(find_model(FACE_DETECTOR))
    except InputError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(("left", "top", "side"), [(120, 30, 200), (150, 40, 160), (60, 0, 300)])
def test_a_face_is_found_where_it_is(
    detector: FaceDetector, left: int, top: int, side: int
) -> None:
    """The astronaut's face: eyes at y = 108 px, mouth at 159, in the middle at x = 223."""
    crop = read_photo(ASTRONAUT, "photo").rgb[top : top + side, left : left + side]
    found = detector.detect(cv2.resize(crop, (FACE_SIZE, FACE_SIZE), interpolation=cv2.INTER_AREA))
    assert found.score > 0.9
    x, y = left + found.middle[0] * side, top + found.middle[1] * side
    assert (x, y) == pytest.approx((223, 125), abs=8)
    assert found.size[0] * side == pytest.approx(100, abs=12)


def test_where_no_face_is_none_is_certain(detector: FaceDetector) -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (FACE_SIZE, FACE_SIZE, 3), np.uint8)
    for picture in (noise, np.zeros_like(noise), np.full_like(noise, 200)):
        assert detector.detect(picture).score < 0.5
