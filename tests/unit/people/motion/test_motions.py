"""Loops without a seam that look like what they are called."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.people.motion.motions import MOTIONS, walk_pose
from motion_transfer.people.motion.poses import angles, numbers, placed, pose_rotations

STEPS = 240


def rows(name: str, steps: int = STEPS) -> np.ndarray:
    """Poses over one cycle and back at its start, turns unwrapped."""
    table = np.array([numbers(MOTIONS[name].pose(k / steps)) for k in range(steps + 1)])
    table[:, 0] = np.unwrap(table[:, 0])
    return table


@pytest.fixture(scope="module")
def walk(body_model) -> dict[str, np.ndarray]:
    """Joints over a walk, on the floor: bone -> frames x 3."""
    body, count = body_model.template, 60
    places = []
    for k in range(count):
        pose = walk_pose(k / count)
        transforms = body.transforms(pose_rotations(pose, body))
        shift = placed(body_model.pose(body, transforms), pose)
        places.append(body.posed_joints(transforms) + shift)
    return dict(zip(body.skeleton.names, np.array(places).transpose(1, 0, 2), strict=True))


def test_the_names_that_users_ask_for() -> None:
    assert set(MOTIONS) == {"walk", "turntable", "dance", "wave", "jumping-jacks"}
    assert all(MOTIONS[name].name == name for name in MOTIONS)
    assert all(0.5 < motion.seconds < 20 for motion in MOTIONS.values())


@pytest.mark.parametrize("name", MOTIONS)
def test_no_seam(name: str) -> None:
    """The step over the seam is no larger than the largest inside, nor is the change of speed."""
    motion = MOTIONS[name]
    table = np.array([numbers(motion.pose(k / STEPS)) for k in range(-3, STEPS + 3)])
    table[:, 0] = np.unwrap(table[:, 0])
    steps = np.abs(np.diff(table, axis=0)).max(1)
    bends = np.abs(np.diff(table, n=2, axis=0)).max(1)
    assert steps[:4].max() <= 1.001 * steps[4:-4].max() + 1e-9
    assert bends[:4].max() <= 1.05 * bends[4:-4].max() + 1e-9
    np.testing.assert_allclose(numbers(motion.pose(1.0)), numbers(motion.pose(0.0)), atol=1e-12)


@pytest.mark.parametrize("name", MOTIONS)
def test_speeds_are_continuous(name: str) -> None:
    """Sampled twice as finely, the largest change of speed from step to step halves or better."""
    coarse, fine = (
        np.abs(np.diff(rows(name, steps), n=2, axis=0)).max() * steps for steps in (480, 1920)
    )
    assert fine < 0.55 * coarse + 1e-9


@pytest.mark.parametrize("name", MOTIONS)
def test_limits_are_respected(name: str) -> None:
    for k in range(STEPS):
        for part, angle, value, (low, high) in angles(MOTIONS[name].pose(k / STEPS)):
            assert low <= value <= high, (k, part, angle, np.degrees(value))


@pytest.mark.parametrize("name", MOTIONS)
def test_limbs_stay_apart(body_model, name: str) -> None:
    from motion_transfer.people.motion.capsules import Capsules
    from motion_transfer.people.motion.untangling import limbs_apart

    capsules = Capsules(body_model, body_model.template)
    for k in range(96):
        assert limbs_apart(MOTIONS[name].pose(k / 96), capsules), k


@pytest.mark.parametrize(("name", "turns"), [("turntable", 1), ("dance", 1), ("walk", 0)])
def test_whole_turns(name: str, turns: int) -> None:
    table = rows(name)
    assert table[-1, 0] - table[0, 0] == pytest.approx(2 * np.pi * turns)


def test_the_turntable_is_one_still_pose() -> None:
    table = rows("turntable")
    np.testing.assert_allclose(table[:, 1:], np.tile(table[:1, 1:], (len(table), 1)), atol=1e-12)
    np.testing.assert_allclose(np.diff(table[:, 0]), 2 * np.pi / STEPS)


def test_wave_raises_the_left_hand(body_model) -> None:
    body = body_model.template
    left, right, head = (body.skeleton.index[name] for name in ("wrist.L", "wrist.R", "head"))
    for phase in np.arange(8) / 8:
        pose = MOTIONS["wave"].pose(phase)
        joints = body.posed_joints(body.transforms(pose_rotations(pose, body)))
        assert joints[left, 2] > joints[head, 2] - 0.1
        assert joints[left, 0] > 0.3
        assert joints[right, 2] < 1.1


def test_jumping_jacks_leave_the_floor_twice() -> None:
    table = np.array([MOTIONS["jumping-jacks"].pose(k / STEPS).offset[2] for k in range(STEPS)])
    aloft = table > 0
    assert np.count_nonzero(aloft & ~np.roll(aloft, 1)) == 2
    assert 0.08 < table.max() < 0.3
    spread = MOTIONS["jumping-jacks"].pose(0.5)
    assert min(spread.left_arm.abduction, spread.right_arm.abduction) > np.radians(150)
    assert spread.left_leg.out > np.radians(12)
    assert MOTIONS["jumping-jacks"].pose(0.0).left_arm.abduction < np.radians(15)


def test_arms_swing_against_legs() -> None:
    """At the left heel's strike the left leg is in front, the left arm behind."""
    pose = walk_pose(0.0)
    assert pose.left_leg.hip > np.radians(15) > pose.right_leg.hip
    assert pose.left_arm.swing < 0 < pose.right_arm.swing
    half = walk_pose(0.5)
    assert half.right_leg.hip == pytest.approx(pose.left_leg.hip, abs=1e-6)
    assert half.right_arm.swing == pytest.approx(pose.left_arm.swing, abs=1e-6)


def test_the_knee_bends_in_the_swing_phase() -> None:
    knees = np.degrees([walk_pose(k / 100).left_leg.knee for k in range(100)])
    assert 60 <= knees.argmax() <= 80
    assert 45 < knees.max() < 70
    assert knees[20:40].min() < 10


def test_the_heel_strikes_first_and_the_toes_leave_last(walk) -> None:
    heel, toe = walk["foot.L"][:, 2], walk["toe2-2.L"][:, 2]
    at_rest = 0.081 - 0.025  # ankle above toes on a flat foot
    assert heel[0] - toe[0] < at_rest - 0.03
    leaves = round(0.57 * len(heel))
    assert heel[leaves] - toe[leaves] > at_rest + 0.05
    assert toe[leaves] < 0.05


def test_the_standing_foot_stays_on_the_floor_and_moves_evenly(walk) -> None:
    """As on a treadmill: between foot-flat and heel-off the ankle moves back at one speed."""
    count = len(walk["foot.L"])
    flat = slice(round(0.12 * count), round(0.36 * count))
    place = walk["foot.L"][flat] - walk["root"][flat] * [0, 1, 0]
    speed = np.diff(place[:, 1])
    assert speed.min() > 0
    assert speed.std() < 0.1 * speed.mean()
    assert np.ptp(place[:, 2]) < 0.012


def test_the_body_bobs_twice_a_cycle(walk) -> None:
    height = walk["root"][:, 2]
    spectrum = np.abs(np.fft.rfft(height - height.mean()))
    assert spectrum.argmax() == 2
    assert 0.015 < np.ptp(height) < 0.06
