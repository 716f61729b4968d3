"""Sampled poses: inside the limits, from all sides, limbs apart."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.people.motion.capsules import FIRST, PARTS, SECOND, Capsules
from motion_transfer.people.motion.pose_sampler import (
    GESTURES,
    KINDS,
    sample_pose,
    sample_turn,
    touches,
)
from motion_transfer.people.motion.poses import (
    Arm,
    Leg,
    Pose,
    angles,
    mirrored,
    numbers,
    pose_rotations,
)
from motion_transfer.people.motion.untangling import limbs_apart, untangled


@pytest.fixture(scope="module")
def capsules(body_model) -> Capsules:
    return Capsules(body_model, body_model.template)


@pytest.mark.parametrize("kind", KINDS)
def test_limits_are_respected(kind: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        for part, name, value, (low, high) in angles(sample_pose(rng, kind)):
            assert low <= value <= high, (part, name)


def test_the_generator_alone_decides() -> None:
    first, second = ([sample_pose(np.random.default_rng(seed)) for seed in range(20)] for _ in "ab")
    assert first == second
    assert len(set(first)) == 20


def test_all_sides_are_seen_the_front_most() -> None:
    rng = np.random.default_rng(2)
    turns = np.degrees([sample_turn(rng) for _ in range(4000)])
    off = np.abs((turns + 180) % 360 - 180)
    assert np.mean(off < 35) == pytest.approx(0.45, abs=0.03)
    assert np.mean(off > 145) == pytest.approx(0.15, abs=0.03)
    assert np.mean((turns > 35) & (turns < 145)) == pytest.approx(0.2, abs=0.03)


def test_an_unknown_kind_says_which_there_are() -> None:
    with pytest.raises(ValueError, match=r"'flying'.*standing.*dancing"):
        sample_pose(np.random.default_rng(0), "flying")


def test_gestures_touch_parts_that_are_tested() -> None:
    tested = {frozenset((PARTS[a], PARTS[b])) for a, b in zip(FIRST, SECOND, strict=True)}
    for name in GESTURES:
        for side in "LR":
            assert all(frozenset(pair) in tested for pair in touches(name, side)), name


def test_raised_arms_are_raised_and_seats_are_low(body_model) -> None:
    body, rng = body_model.template, np.random.default_rng(3)
    wrists = [body.skeleton.index[f"wrist.{side}"] for side in "LR"]
    head, heels = body.skeleton.index["head"], body.skeleton.index["foot.L"]

    def joints(kind: str) -> np.ndarray:
        pose = sample_pose(rng, kind)
        return body.posed_joints(body.transforms(pose_rotations(pose, body)))

    for _ in range(20):
        raised = joints("arms_up")
        assert raised[wrists, 2].max() > raised[head, 2] - 0.25
        seated = joints("sitting")
        assert seated[head, 2] - seated[heels, 2] < 1.35


def test_capsules_follow_the_bones(body_model, capsules: Capsules) -> None:
    """Their own quick kinematics agree with the body's."""
    body, rng = body_model.template, np.random.default_rng(4)
    for kind in KINDS:
        pose = sample_pose(rng, kind)
        joints = body.posed_joints(body.transforms(pose_rotations(pose, body)))
        placement = capsules.place(pose)
        for side in (0, 1):
            arm = [f"{bone}.{'LR'[side]}" for bone in ("upperarm01", "lowerarm01", "wrist")]
            leg = [f"{bone}.{'LR'[side]}" for bone in ("upperleg01", "lowerleg01", "foot")]
            index = body.skeleton.index
            found = np.concatenate([placement.arms[side][:3], placement.legs[side][:3]])
            np.testing.assert_allclose(
                found, joints[[index[bone] for bone in arm + leg]], atol=0.012
            )


@pytest.mark.parametrize(
    "pose",
    [
        Pose(left_arm=Arm(swing=0.3, turn_out=-1.2, elbow=1.2)),  # through the belly
        Pose(left_leg=Leg(hip=0.15, out=-0.35), right_leg=Leg(out=-0.35)),  # through each other
        Pose(left_arm=Arm(swing=2.2, elbow=2.3)),  # through the head
    ],
    ids=["belly", "legs", "head"],
)
def test_tangles_are_seen_and_undone(capsules: Capsules, pose: Pose) -> None:
    assert not limbs_apart(pose, capsules)
    parted = untangled(pose, capsules)
    assert limbs_apart(parted, capsules)
    assert parted == untangled(pose, capsules)
    assert all(low <= value <= high for *_, value, (low, high) in angles(parted))
    # the body is symmetric, and so is the way out
    other = mirrored(untangled(mirrored(pose), capsules))
    np.testing.assert_allclose(numbers(other), numbers(parted), atol=1e-3)


def test_a_hand_on_the_hip_touches_it_and_a_free_pose_stays(capsules: Capsules) -> None:
    free = Pose(left_arm=Arm(abduction=0.5), right_arm=Arm(abduction=0.5))
    assert untangled(free, capsules) is free
    away = Arm(swing=-0.2, abduction=0.9, turn_out=-1.0, elbow=1.4)
    pose = Pose(left_arm=away, right_arm=free.right_arm, touches=(("hand.L", "hips"),))
    pair = next(
        k
        for k, (a, b) in enumerate(zip(FIRST, SECOND, strict=True))
        if {PARTS[a], PARTS[b]} == {"hand.L", "hips"}
    )
    gaps = [
        capsules.contacts(capsules.place(p)).gaps[pair] for p in (pose, untangled(pose, capsules))
    ]
    assert gaps[0] > 0.03
    assert abs(gaps[1]) < 0.01


def test_limbs_are_apart_in_a_hundred_poses(capsules: Capsules) -> None:
    rng = np.random.default_rng(5)
    for index in range(100):
        pose = untangled(sample_pose(rng), capsules)
        assert limbs_apart(pose, capsules), index


def test_a_heavy_body_keeps_its_limbs_apart_too(body_model) -> None:
    from motion_transfer.people.figure.body import Shape

    capsules = Capsules(body_model, body_model.body(Shape(gender=0, weight=1.0)))
    rng = np.random.default_rng(6)
    assert all(limbs_apart(untangled(sample_pose(rng), capsules), capsules) for _ in range(30))
