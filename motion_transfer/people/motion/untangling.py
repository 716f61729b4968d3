"""Limbs that go through each other, and how to part them.

Each pair of capsules that sinks in too far asks for a push along the line between them; the joint
angles that give it with the least change are found by damped least squares, a few times over
(Wampler 1986: Manipulator inverse kinematic solutions based on damped least squares). Hands that
should touch something ask for a pull in the same way. No randomness.
"""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float64

from motion_transfer.people.motion.capsules import (
    FIRST,
    PARTS,
    SECOND,
    Capsules,
    Contacts,
    Placement,
)
from motion_transfer.people.motion.limbs import MIRROR, turned
from motion_transfer.people.motion.poses import Arm, Leg, Pose, arm_chain, clamped, leg_chain

SLACK = 0.004  # metres beyond what is asked, so that steps end instead of creeping
STEPS = 14  # a pose that is still tangled then is eased instead
DAMPING = 2e-3  # square metres a square radian: steps stay under some 0.3 radians
TOUCH_ERROR = 0.008  # metres; a hand this near counts as touching
ARM_ANGLES = ("swing", "abduction", "turn_out", "elbow")
LEG_ANGLES = ("hip", "out", "turn_out", "knee")
# how willingly an angle moves: legs carry the weight and stay, unless it is between the two
WILLING = np.tile([1.0, 1.0, 0.7, 1.0, 0.15, 0.3, 0.15, 0.15], 2)
Limb = TypeVar("Limb", Arm, Leg)
EASY_ARM = Arm(swing=0.1, abduction=0.5, elbow=0.4)
# shares of the way, of arms and of legs, to hanging free
EASIER = ((0.35, 0.0), (0.7, 0.0), (1.0, 0.0), (1.0, 0.4), (1.0, 0.7), (1.0, 1.0))
_PAIRS = {
    frozenset((PARTS[i], PARTS[j])): k for k, (i, j) in enumerate(zip(FIRST, SECOND, strict=True))
}


def limbs_apart(pose: Pose, capsules: Capsules) -> bool:
    """Tell whether no limb goes through another or through the torso; touching is allowed."""
    return not len(_tangled(capsules.contacts(capsules.place(pose)), capsules))


def untangled(pose: Pose, capsules: Capsules) -> Pose:
    """Part the limbs of a pose that go through each other, and bring hands to what they touch.

    Inside the limits. Where the pushes find no way, the arms are moved towards hanging free and
    then the legs towards standing, until the limbs are apart.
    """
    touching = np.array([_PAIRS[frozenset(pair)] for pair in pose.touches], np.intp)
    start = pose
    for _ in range(STEPS):
        placement = capsules.place(pose)
        contacts = capsules.contacts(placement)
        tangled = _tangled(contacts, capsules)
        untouched = touching[np.abs(contacts.gaps[touching]) > TOUCH_ERROR]
        if not len(tangled) and not len(untouched):
            return pose
        tangled = tangled[~np.isin(tangled, touching)]
        # a pair that touches has its own row, whether it is too near or too far
        rows = np.concatenate([tangled, touching])
        apart = capsules.allowed[tangled] - contacts.gaps[tangled] + SLACK
        wanted = np.concatenate([apart, -contacts.gaps[touching]])
        pose = _moved(pose, _jacobian(pose, placement, contacts, rows), wanted)
    for arms, legs in EASIER:
        if limbs_apart(pose, capsules):
            break
        pose = replace(
            start,
            left_arm=_mixed(start.left_arm, EASY_ARM, arms),
            right_arm=_mixed(start.right_arm, EASY_ARM, arms),
            left_leg=_mixed(start.left_leg, Leg(out=0.05), legs),
            right_leg=_mixed(start.right_leg, Leg(out=0.05), legs),
            touches=(),
        )
    return pose


def _tangled(contacts: Contacts, capsules: Capsules) -> np.ndarray:
    return np.flatnonzero(contacts.gaps < capsules.allowed)


def _mixed(limb: Limb, other: Limb, share: float) -> Limb:
    pairs = zip(astuple(limb), astuple(other), strict=True)
    return type(limb)(*((1 - share) * a + share * b for a, b in pairs))


def _moved(pose: Pose, jacobian: Float64[np.ndarray, "rows 16"], wanted: np.ndarray) -> Pose:
    """Change the angles by the damped least-squares answer, by 0.3 radians a step at most."""
    weighted = jacobian * WILLING
    square = weighted @ jacobian.T
    square.flat[:: len(square) + 1] += DAMPING
    step = np.clip(weighted.T @ np.linalg.solve(square, wanted), -0.3, 0.3).tolist()
    changes = {}
    for k, (part, names) in enumerate(_GROUPS):
        limb = getattr(pose, part)
        turns = {n: getattr(limb, n) + step[4 * k + i] for i, n in enumerate(names)}
        changes[part] = replace(limb, **turns)
    return clamped(replace(pose, **changes))


_GROUPS = (
    ("left_arm", ARM_ANGLES),
    ("left_leg", LEG_ANGLES),
    ("right_arm", ARM_ANGLES),
    ("right_leg", LEG_ANGLES),
)
# for each part: the group of four angles that moves it (4: none), and which of the four do
_GROUP = np.array(
    [
        (2 * part.endswith("R") + part.startswith(("thigh", "shin", "foot"))) if "." in part else 4
        for part in PARTS
    ]
)
_MOVES = np.array(
    [[True, True, True, not part.startswith(("upperarm", "thigh"))] for part in PARTS]
)


def _jacobian(
    pose: Pose, placement: Placement, contacts: Contacts, rows: np.ndarray
) -> Float64[np.ndarray, "rows 16"]:
    """Measure how fast each gap opens with each angle, metres a radian."""
    axes = np.zeros((5, 4, 3))  # of each group's angles; the fifth group is what none moves
    joints = np.zeros((5, 4, 3))  # about which each angle turns: three times the root, the middle
    for side, (arm, leg, mirror) in enumerate(
        (
            (pose.left_arm, pose.left_leg, np.ones(3)),
            (pose.right_arm, pose.right_leg, -MIRROR),  # a mirrored rotation turns the other way
        )
    ):
        # elbows bend forward and knees back, hence the signs
        for group, swing, chain, bend, carrier, places in (
            (2 * side, arm.swing, arm_chain(arm), -1, placement.chest, placement.arms),
            (2 * side + 1, leg.hip, leg_chain(leg), 1, placement.upright, placement.legs),
        ):
            lift = turned(-swing, 0, 0)
            local = np.array([[-1.0, 0, 0], -lift[:, 1], chain[:, 2], bend * chain[:, 0]])
            axes[group] = (local * mirror) @ carrier.T
            joints[group] = places[side][[0, 0, 0, 1]]
    out = np.zeros((len(rows), 5, 4))
    every = np.arange(len(rows))
    for parts, points, sign in (
        (FIRST[rows], contacts.near[rows], 1.0),
        (SECOND[rows], contacts.far[rows], -1.0),
    ):
        group = _GROUP[parts]
        # axis x (point - joint) . normal = axis . ((point - joint) x normal)
        levers = np.cross(points[:, None] - joints[group], contacts.normals[rows][:, None])
        speeds = np.einsum("rai,rai->ra", axes[group], levers) * _MOVES[parts]
        out[every, group] += sign * speeds
    return out[:, :4].reshape(len(rows), 16)
