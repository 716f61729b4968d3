"""Angles mean what they say, on both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motion_transfer.people.motion.limbs import Rest, about, rotation, turned, twist_angle
from motion_transfer.people.motion.poses import (
    LIMITS,
    Arm,
    Bend,
    Leg,
    Pose,
    angles,
    clamped,
    from_numbers,
    mirrored,
    numbers,
    placed,
    pose_rotations,
)
from motion_transfer.people.motion.stances import Foot, ankle_height, standing

SOME = Pose(
    turn=0.4,
    left_arm=Arm(0.3, 0.4, 0.2, 0.9, 0.5, 0.2, 0.1, 0.1, 0.7),
    right_arm=Arm(swing=1.2, elbow=0.4),
    left_leg=Leg(0.5, 0.2, 0.1, 0.8, 0.1, 0.05, 0.2),
    pelvis=Bend(0.1, 0.1, -0.1),
    spine=Bend(0.2, -0.1, 0.3),
    head=Bend(-0.1, 0.1, 0.5),
    offset=(0.1, 0.2, 0.3),
    touches=(("hand.L", "hips"),),
)


@pytest.fixture(scope="module")
def joints(body_model):
    """Posed joints by bone name, of the body in the middle of all ranges."""
    body = body_model.template

    def find(pose: Pose) -> dict[str, np.ndarray]:
        places = body.posed_joints(body.transforms(pose_rotations(pose, body)))
        return dict(zip(body.skeleton.names, places, strict=True))

    return find


def test_numbers_and_back_lose_nothing_but_touches() -> None:
    assert from_numbers(numbers(SOME)) == replace(SOME, touches=())


def test_mirroring_twice_is_the_pose_and_once_is_not() -> None:
    assert mirrored(mirrored(SOME)) == SOME
    other = mirrored(SOME)
    assert other.left_arm == SOME.right_arm
    assert other.turn == -SOME.turn
    assert other.spine == Bend(0.2, 0.1, -0.3)
    assert other.touches == (("hand.R", "hips"),)


def test_clamping_moves_only_what_is_outside() -> None:
    wild = replace(SOME, left_arm=replace(SOME.left_arm, elbow=3.0), head=Bend(turn=-2.0))
    kept = clamped(wild)
    assert kept.left_arm == replace(SOME.left_arm, elbow=LIMITS["arm"]["elbow"][1])
    assert kept.head == Bend(turn=LIMITS["head"]["turn"][0])
    assert clamped(SOME) == SOME


def test_every_angle_has_limits_that_contain_zero() -> None:
    listed = {(part, name) for part, name, *_ in angles(Pose())}
    assert len(listed) == 2 * 9 + 2 * 7 + 3 * 3
    assert all(low <= 0 < high for limits in LIMITS.values() for low, high in limits.values())


def test_turns_one_after_the_other() -> None:
    expected = rotation(0.3, 0, 0) @ rotation(0, -0.4, 0) @ rotation(0, 0, 0.7)
    np.testing.assert_allclose(turned(0.3, -0.4, 0.7), expected, atol=1e-12)


def test_twist_is_what_turns_about_the_axis() -> None:
    axis = np.array([0.6, 0.0, -0.8])
    swing = about(np.array([0.8, 0.0, 0.6]), 1.1)  # perpendicular to the axis
    assert twist_angle(swing @ about(axis, 0.7), axis) == pytest.approx(0.7)
    assert twist_angle(about(axis, -0.7) @ swing, axis) == pytest.approx(-0.7)


def test_feet_of_a_stance_are_level_whatever_the_pelvis_does() -> None:
    """Both ankles end up as high above the floor as their feet need."""
    pelvis = Bend(side=0.12, turn=0.2)
    feet = Foot(0.1, 0.2, 0.0, 0.3), Foot(-0.2, 0.05, 0.4, 0.1)
    heights = []
    pose = standing(*feet, pelvis, sink=0.02)
    for leg, foot, side in zip((pose.left_leg, pose.right_leg), feet, (1, -1), strict=True):
        chain = turned(-leg.hip, -leg.out, leg.turn_out)
        down = np.array([0, 0, -0.5])
        ankle = chain @ down + chain @ turned(leg.knee, 0, 0) @ down
        hip = -side * 0.128 * np.sin(pelvis.side)
        heights.append(hip + ankle[2] - ankle_height(foot.heel))
        sole = chain @ turned(leg.knee, 0, 0) @ turned(-leg.ankle - foot.heel, leg.roll, 0)
        np.testing.assert_allclose(sole[:, 2], [0, 0, 1], atol=1e-9)
    assert heights[0] == pytest.approx(heights[1])


def test_zero_hangs_the_limbs_straight_down(joints) -> None:
    found = joints(Pose())
    for upper, lower in (("upperarm01", "lowerarm01"), ("lowerarm01", "wrist")):
        for side in "LR":
            along = found[f"{lower}.{side}"] - found[f"{upper}.{side}"]
            np.testing.assert_allclose(along / np.linalg.norm(along), [0, 0, -1], atol=0.02)
    leg = found["foot.L"] - found["upperleg01.L"]
    np.testing.assert_allclose(leg / np.linalg.norm(leg), [0, 0, -1], atol=1e-3)
    # the palm looks at the body: the thumb's side is in front
    assert found["finger2-1.L"][1] < found["finger5-1.L"][1] - 0.04
    assert abs(found["finger2-1.L"][0] - found["finger5-1.L"][0]) < 0.02


@pytest.mark.parametrize(
    ("arm", "bone", "direction"),
    [
        (Arm(swing=1.5), "lowerarm01", (0, -1, 0)),
        (Arm(abduction=1.5), "lowerarm01", (1, 0, 0)),
        (Arm(elbow=1.5), "wrist", (0, -1, 0)),
        (Arm(turn_out=1.0, elbow=1.5), "wrist", (1, 0, 0)),
        (Arm(shrug=0.4), "upperarm01", (0, 0, 1)),
        (Arm(wrist=1.0), "finger3-1", (-1, 0, 0)),
        (Arm(wrist_side=0.4), "finger3-1", (0, -1, 0)),
        (Arm(pronation=1.0), "finger2-1", (-1, 0, 0)),
    ],
)
def test_arm_angles_move_the_arm_where_they_say(joints, arm: Arm, bone: str, direction) -> None:
    """The left one; the right one is its mirror image."""
    zero, found = joints(Pose()), joints(Pose(left_arm=arm))
    moved = found[f"{bone}.L"] - zero[f"{bone}.L"]
    assert moved @ direction > 0.02
    assert moved @ direction > 0.4 * np.linalg.norm(moved)
    np.testing.assert_allclose(found[f"{bone}.R"], zero[f"{bone}.R"], atol=1e-6)
    other = joints(Pose(right_arm=arm))
    np.testing.assert_allclose(other[f"{bone}.R"], found[f"{bone}.L"] * [-1, 1, 1], atol=2e-3)


@pytest.mark.parametrize(
    ("leg", "bone", "direction"),
    [
        (Leg(hip=1.0), "lowerleg01", (0, -1, 0)),
        (Leg(out=0.5), "lowerleg01", (1, 0, 0)),
        (Leg(knee=1.0), "foot", (0, 1, 0)),
        (Leg(turn_out=0.5), "toe2-1", (1, 0, 0)),
        (Leg(ankle=0.3), "toe2-1", (0, 0, 1)),
        (Leg(roll=0.3), "toe1-1", (0, 0, 1)),
        (Leg(toes=0.5), "toe2-2", (0, 0, 1)),
    ],
)
def test_leg_angles_move_the_leg_where_they_say(joints, leg: Leg, bone: str, direction) -> None:
    moved = joints(Pose(left_leg=leg))[f"{bone}.L"] - joints(Pose())[f"{bone}.L"]
    assert moved @ direction > 0.006
    assert moved @ direction > 0.4 * np.linalg.norm(moved)


@pytest.mark.parametrize(
    ("pose", "direction"),
    [
        (Pose(spine=Bend(forward=0.4)), (0, -1, 0)),
        (Pose(spine=Bend(side=0.3)), (1, 0, 0)),
        (Pose(pelvis=Bend(forward=0.3)), (0, -1, 0)),
        (Pose(head=Bend(side=0.3)), (1, 0, 0)),
    ],
)
def test_the_trunk_bends_where_it_says_and_the_feet_stay(joints, pose: Pose, direction) -> None:
    zero, found = joints(Pose()), joints(pose)
    assert (found["eye.L"] - zero["eye.L"]) @ direction > 0.02
    np.testing.assert_allclose(found["foot.L"], zero["foot.L"], atol=0.01)


def test_turning_left_brings_the_face_to_the_left(joints) -> None:
    for pose in (Pose(turn=0.8), Pose(spine=Bend(turn=0.8)), Pose(head=Bend(turn=0.8))):
        found = joints(pose)
        assert found["eye.L"][0] + found["eye.R"][0] > 0.05


def test_twists_are_spread_over_two_bones(body_model) -> None:
    """Half of the upper arm at its middle, 60 % of the hand in the forearm."""
    body, rest = body_model.template, Rest.of(body_model.template)

    def twist(arm: Arm, bone: str, axis: np.ndarray) -> float:
        return twist_angle(pose_rotations(Pose(left_arm=arm), body)[f"{bone}.L"], axis)

    for arm, upper, lower, axis, share in (
        (Arm(turn_out=-1.0), "upperarm02", "upperarm01", rest.upper_axis, 0.5),
        (Arm(pronation=1.0), "lowerarm02", "wrist", rest.fore_axis, 0.6),
    ):
        one, other = (twist(arm, bone, axis) - twist(Arm(), bone, axis) for bone in (upper, lower))
        assert one == pytest.approx(share, abs=0.05)
        assert other == pytest.approx(1 - share, abs=0.1)


def test_a_fist_is_shorter_than_a_flat_hand(joints) -> None:
    lengths = []
    for curl in (0.0, 1.0):
        found = joints(Pose(left_arm=Arm(curl=curl)))
        lengths.append(np.linalg.norm(found["finger3-3.L"] - found["wrist.L"]))
    assert lengths[1] < 0.75 * lengths[0]


def test_placed_stands_on_the_floor_or_jumps() -> None:
    points = np.array([[0, 0, 0.3], [1, 1, 1.5]], np.float32)
    shift = placed(points, Pose(offset=(0.1, 0.2, 0.25)))
    np.testing.assert_allclose(shift, [0.1, 0.2, -0.05], atol=1e-6)
