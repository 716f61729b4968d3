"""BVH files that are written can be read, by this project's reader and by others."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("anny")

from motion_transfer.people.figure.body import load_body_model
from motion_transfer.people.motion.bvh import bvh_poses, read_bvh
from motion_transfer.people.motion.bvh.skeleton import find_roles, tracks
from motion_transfer.people.motion.bvh.writing import JOINTS, NAMES, TO_FILE, write_bvh
from motion_transfer.people.motion.motions import MOTIONS
from motion_transfer.people.motion.poses import pose_rotations

RATE = Fraction(30000, 1001)


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, list]:
    body, motion = load_body_model().template, MOTIONS["dance"]
    frames = [(pose_rotations(motion.pose(i / 30), body), (0.1 * i, 0.0, 0.02)) for i in range(30)]
    path = tmp_path / "dance.bvh"
    assert write_bvh(path, body, frames, RATE) == 30
    return path, frames


def test_joints_come_back(written: tuple[Path, list]) -> None:
    path, frames = written
    body = load_body_model().template
    read = read_bvh(path)
    assert read.frame_rate == RATE
    assert list(read.names) == NAMES
    places = tracks(read).places
    index = [body.skeleton.index[joint.bone] for joint in JOINTS]
    for frame, (bones, offset) in enumerate(frames):
        true = body.posed_joints(body.transforms(bones, offset))[index] @ TO_FILE.T
        away = np.linalg.norm(places[frame] - true, axis=1)
        # knees lie a centimetre off the axis about which the thigh's twist is spread
        assert away.max() < 0.025
        assert away.mean() < 0.006


def test_lengths_are_the_bodys_in_metres(written: tuple[Path, list]) -> None:
    read, body = read_bvh(written[0]), load_body_model().template
    shin = np.linalg.norm(body.joint("foot.L") - body.joint("lowerleg01.L"))
    assert np.linalg.norm(read.offsets[NAMES.index("LeftFoot")]) == pytest.approx(shin, abs=1e-5)
    rest = tracks(read, at_rest=True).places[0]
    # y up, facing +z with the left hand at +x
    assert rest[NAMES.index("Head"), 1] - rest[NAMES.index("LeftFoot"), 1] > 1.3
    assert rest[NAMES.index("LeftHand"), 0] > 0.3
    assert rest[NAMES.index("LeftToeBase"), 2] > rest[NAMES.index("LeftFoot"), 2] + 0.05


def test_the_reader_knows_all_limbs(written: tuple[Path, list]) -> None:
    read = read_bvh(written[0])
    roles = find_roles(read)
    assert roles.arms is not None
    named = [NAMES[limb.middle] for limb in (*roles.legs, *roles.arms)]
    assert named == ["LeftLeg", "RightLeg", "LeftForeArm", "RightForeArm"]
    assert (NAMES[roles.hips], NAMES[roles.chest], NAMES[roles.head]) == ("Hips", "Spine4", "Head")


def test_the_body_moves_as_it_was_written(written: tuple[Path, list]) -> None:
    path, frames = written
    body = load_body_model().template
    poses = bvh_poses(read_bvh(path), body)
    names = [
        f"{bone}.{side}" for bone in ("lowerarm01", "wrist", "lowerleg01", "foot") for side in "LR"
    ]
    index = [body.skeleton.index[name] for name in (*names, "head")]
    root = body.skeleton.index["root"]
    away = []
    for frame, (bones, offset) in enumerate(frames):
        before, after = (
            body.posed_joints(body.transforms(*pair)) for pair in ((bones, offset), poses[frame])
        )
        # the reader turns the first frame to the camera: compare what turning leaves
        reach = [np.linalg.norm(j[index] - j[root], axis=1) for j in (before, after)]
        away.append(np.abs(reach[0] - reach[1]))
    assert np.mean(away) < 0.02
