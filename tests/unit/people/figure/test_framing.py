"""Cameras that are pointed at points."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.people.figure.framing import frame_points

SIZE = (240, 320)


@pytest.fixture
def points() -> np.ndarray:
    rng = np.random.default_rng(0)
    return (rng.uniform(-1, 1, (300, 3)) * [0.5, 0.3, 0.9] + [0.2, 0.5, 1]).astype(np.float32)


@pytest.mark.parametrize("azimuth", [0.0, 2.5])
@pytest.mark.parametrize("elevation", [-0.2, 0.5])
def test_points_fill_the_picture_up_to_the_margin(points, azimuth, elevation):
    camera = frame_points(
        points, SIZE, distance=3.0, azimuth=azimuth, elevation=elevation, roll=0.1, margin=0.1
    )
    seen = camera.project(points)[:, :2] / SIZE
    assert seen.min() >= 0.1 - 0.005 and seen.max() <= 0.9 + 0.005
    assert max(np.ptp(seen, axis=0)) == pytest.approx(0.8, abs=0.01)
    middle = (seen.min(0) + seen.max(0)) / 2
    assert middle == pytest.approx([0.5, 0.5], abs=0.01)


def test_a_shift_uses_the_free_space(points):
    still = frame_points(points, SIZE, distance=3.0, margin=0.1)
    moved = frame_points(points, SIZE, distance=3.0, margin=0.1, shift=(1, 1))
    before, after = (camera.project(points)[:, :2] for camera in (still, moved))
    assert (after - before).mean(0) == pytest.approx(SIZE - before.max(0), abs=6)
    assert after.max(0) == pytest.approx(SIZE, abs=6)  # perspective changes a little
