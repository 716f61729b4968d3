"""The pinhole camera against geometry done by hand, and cameras that are pointed at points."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.people.figure.camera import Camera, frame_points

CAMERA = Camera(200, 100, 100.0, 4.0, (0.0, 0.0, 1.0))
SIZE = (240, 320)


def project(camera: Camera, *point: float) -> list[float]:
    return camera.project(np.array([point], np.float32))[0].tolist()


def test_the_target_is_the_middle_of_the_picture():
    assert project(CAMERA, 0, 0, 1) == pytest.approx([100, 50, 4])


def test_the_left_hand_of_a_person_who_faces_the_camera_is_on_the_right():
    assert project(CAMERA, 0.4, 0, 1) == pytest.approx([110, 50, 4], abs=1e-4)


def test_up_is_up_and_near_things_are_larger():
    assert project(CAMERA, 0, 0, 1.4) == pytest.approx([100, 40, 4], abs=1e-4)
    assert project(CAMERA, 0.4, -2, 1) == pytest.approx([120, 50, 2], abs=1e-4)


def test_azimuth_walks_to_the_persons_left_and_elevation_climbs():
    side = Camera(200, 100, 100.0, 4.0, (0, 0, 1), azimuth=np.pi / 2)
    assert side.position == pytest.approx([4, 0, 1])
    assert project(side, 0, 0.4, 1) == pytest.approx([110, 50, 4], abs=1e-4)
    above = Camera(200, 100, 100.0, 4.0, (0, 0, 1), elevation=np.pi / 6)
    assert above.position == pytest.approx([0, -4 * np.cos(np.pi / 6), 3])


def test_roll_turns_the_picture_clockwise():
    rolled = Camera(200, 100, 100.0, 4.0, (0, 0, 1), roll=np.pi / 2)
    assert project(rolled, 0, 0, 1.4)[:2] == pytest.approx([110, 50], abs=1e-4)


def test_a_finer_picture_shows_the_same():
    x, y, z = project(CAMERA, 0.3, 0.1, 1.7)
    assert project(CAMERA.scaled(3), 0.3, 0.1, 1.7) == pytest.approx([3 * x, 3 * y, z], rel=1e-5)


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
