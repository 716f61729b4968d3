"""Regions: where they lie, and pixels in and out."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.blazepose.region import COARSE, Region


@pytest.mark.parametrize("degrees", [0, 30, 90, 179, -120])
def test_a_region_stands_along_the_body(degrees: float) -> None:
    angle = math.radians(degrees)
    hips = np.array([50.0, 60.0])
    top = hips + 20 * np.array([math.sin(angle), -math.cos(angle)])  # clockwise from upright
    region = Region.around_body(hips, top)
    assert (region.x, region.y) == (50, 60)
    assert region.side == pytest.approx(50)
    assert math.degrees(region.turn) == pytest.approx(degrees, abs=1e-4)
    (above,) = region.to_frame(np.array([[0.5, 0.1]], np.float32))
    assert above == pytest.approx(top, abs=1e-3)


def test_an_upright_region_of_the_same_size_is_a_piece_of_the_frame() -> None:
    frame = np.random.default_rng(0).integers(0, 256, (60, 80, 3), np.uint8)
    cut = Region(40, 30, 32).cut(frame, 32)
    assert np.array_equal(cut, frame[14:46, 24:56])


@pytest.mark.parametrize("side", [40, 40 * (COARSE + 1)])
def test_what_was_cut_can_be_pasted_back(side: float) -> None:
    factor = int(side / 40)
    picture = np.zeros((100 * factor, 120 * factor, 3), np.uint8)
    cv2.circle(picture, (60 * factor, 52 * factor), 12 * factor, (255, 255, 255), -1)
    region = Region(58 * factor, 50 * factor, side, 0.4)
    seen = region.cut(picture, 64)
    back = region.paste(np.ascontiguousarray(seen[..., 0]), Box(0, 0, *picture.shape[1::-1]))
    disc, found = picture[..., 0] > 127, back > 127
    assert (disc & found).sum() / (disc | found).sum() > 0.97


def test_a_coarse_region_is_averaged_and_in_the_same_place() -> None:
    frame = np.random.default_rng(1).integers(0, 256, (1600, 1200, 3), np.uint8)
    seen = Region(500, 900, 64 * 12).cut(frame, 64)
    assert seen.std() < 20  # single pixels vary by 74
    ramp = np.broadcast_to(np.arange(1200)[None, :, None] // 5, (1600, 1200, 3)).astype(np.uint8)
    seen = Region(500, 900, 64 * 12).cut(ramp, 64).astype(float)
    expected = (500 - 32 * 12 + 12 * np.arange(64)) / 5
    assert np.abs(seen[32, :, 0] - expected).max() < 2


def test_what_changes_a_region_is_measured() -> None:
    region = Region(100, 100, 200, math.pi - 0.01)
    assert region.change_to(region) == 0
    assert region.change_to(Region(103, 96, 200, math.pi - 0.01)) == pytest.approx(5 / 200)
    assert region.change_to(Region(100, 100, 190, math.pi - 0.01)) == pytest.approx(0.05)
    # a turn across half a circle is a small one
    assert region.change_to(Region(100, 100, 200, -math.pi + 0.01)) == pytest.approx(0.02)


def test_bad_regions_are_told() -> None:
    assert not Region(0, 0, 0.5).is_usable
    assert not Region(float("nan"), 0, 10).is_usable
    assert Region(0, 0, 10).is_usable
