"""BlazePose's landmarks on synthetic bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("anny")

from motion_transfer.estimate.interface import LANDMARK, LANDMARK_NAMES
from motion_transfer.people.figure.body import load_body_model
from motion_transfer.people.figure.camera import frame_points
from motion_transfer.people.motion.poses import Arm, Pose, posed
from motion_transfer.tracking.landmarks import ANCHORS, anchor_of, exact_landmarks, posed_places


def seen_from(azimuth: float, pose: Pose | None = None):
    model = load_body_model()
    body = posed(model.template, pose or Pose(), model)
    camera = frame_points(body.points, (256, 256), distance=4, azimuth=math.radians(azimuth))
    return exact_landmarks(body, model, camera), posed_places(body, model), body


def test_every_landmark_has_an_anchor() -> None:
    kinds = [anchor_of(name) for name in LANDMARK_NAMES]
    assert {kind for kind, _ in kinds} == set(ANCHORS)
    assert kinds[0] == ("nose", "")
    assert kinds[9:11] == [("mouth", "L"), ("mouth", "R")]


def test_left_and_right_are_the_persons_own() -> None:
    front, places, _ = seen_from(0)
    back, _, _ = seen_from(180)
    for name in LANDMARK_NAMES:
        if name.startswith("left-"):
            left, right = LANDMARK[name], LANDMARK[name.replace("left", "right")]
            assert front.image[left, 0] > front.image[right, 0]
            assert back.image[left, 0] < back.image[right, 0]
            assert places[left] * (-1, 1, 1) == pytest.approx(places[right], abs=0.02)


def test_heights_are_a_bodys() -> None:
    _, places, body = seen_from(0)
    height = dict(zip(LANDMARK_NAMES, places[:, 2] / body.body.height, strict=True))
    order = ["left-eye-middle", "nose", "mouth-left", "left-shoulder", "left-elbow", "left-wrist"]
    order += ["left-knee", "left-ankle", "left-foot-index"]
    assert [height[name] for name in order] == sorted([height[n] for n in order], reverse=True)
    assert 0.9 < height["left-eye-middle"] < 0.96
    assert height["left-heel"] < 0.05
    assert places[LANDMARK["nose"], 1] < places[LANDMARK["left-ear"], 1]  # faces -y
    assert places[LANDMARK["left-foot-index"], 1] < places[LANDMARK["left-heel"], 1] - 0.1


def test_depth_is_measured_from_the_hips_in_pixels() -> None:
    found, _, _ = seen_from(90)  # the camera stands at the left hand
    hips = found.image[[LANDMARK["left-hip"], LANDMARK["right-hip"]], 2]
    assert hips.mean() == pytest.approx(0, abs=0.01)
    assert hips[0] < 0 < hips[1]
    front, places, _ = seen_from(0)
    tall = np.ptp(front.image[:, 1]) / np.ptp(places[:, 2])
    # seen from the side, depth is the width that is seen from the front
    assert hips[0] == pytest.approx(-tall * places[LANDMARK["left-hip"], 0], rel=0.1)
    assert found.world[LANDMARK["left-hip"], 2] < 0


def test_what_is_behind_the_body_is_not_visible() -> None:
    pose = Pose(left_arm=Arm(elbow=1.9, turn_out=-1.2, swing=-0.5))
    assert seen_from(0, pose)[0].visibility[LANDMARK["right-wrist"]] == 1
    side, _, _ = seen_from(90)
    assert side.visibility[LANDMARK["right-shoulder"]] == 0
    assert side.visibility[LANDMARK["left-shoulder"]] == 1
