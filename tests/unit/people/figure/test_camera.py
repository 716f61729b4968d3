"""The pinhole camera against geometry done by hand."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.people.figure.camera import Camera

CAMERA = Camera(200, 100, 100.0, 4.0, (0.0, 0.0, 1.0))


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
