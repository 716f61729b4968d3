"""A pose as joint angles with a meaning, and the bone rotations that make it.

Convention: radians. All zero is an upright person who faces the camera (-y), arms and legs straight
down, palms to the body, toes forward. Every angle of a limb means the same on both sides (positive
abduction moves either arm away from the body). Chains are read from the trunk outwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from motion_transfer.people.figure.body import Body
from motion_transfer.people.motion.limbs import (
    Bones,
    Matrix,
    Rest,
    Vector,
    arm_bones,
    both_sides,
    finger_bones,
    leg_bones,
    neck_bones,
    rotation,
    spine_bones,
    turned,
)

Row = Float64[np.ndarray, "numbers"]
Shift = Float32[np.ndarray, "3"]

RELAXED, FIST, OPEN = 0.3, 1.0, 0.0
"""Finger curls."""


@dataclass(frozen=True)
class Arm:
    """Angles of one arm against the chest.

    Attributes:
        swing: lifts the arm forward (shoulder flexion), applied after `abduction`: at a swing of
            90 degrees abduction moves the arm sideways in the horizontal plane.
        abduction: lifts it sideways, away from the body.
        turn_out: turns it outwards about its own length.
        elbow: bends it; the forearm comes forward when the arm hangs.
        pronation: turns the hand, thumb towards the body when the arm hangs; palm back.
        wrist: bends the hand to the palm's side (flexion).
        wrist_side: bends it to the thumb's side (radial deviation).
        shrug: lifts the shoulder, besides what a raised arm does by itself.
        curl: of the fingers: 0 flat, 0.3 relaxed, 1 a fist.
    """

    swing: float = 0.0
    abduction: float = 0.0
    turn_out: float = 0.0
    elbow: float = 0.0
    pronation: float = 0.0
    wrist: float = 0.0
    wrist_side: float = 0.0
    shrug: float = 0.0
    curl: float = RELAXED


@dataclass(frozen=True)
class Leg:
    """Angles of one leg, measured from the upright, so that a tilting pelvis leaves legs in place.

    Attributes:
        hip: lifts the thigh forward, applied after `out`.
        out: lifts it sideways (abduction).
        turn_out: turns it outwards about its own length.
        knee: bends it, the shin goes back.
        ankle: lifts the foot (dorsiflexion); negative points it.
        roll: turns the sole inwards (inversion); keeps it flat under a leg that stands out.
        toes: lifts the toes against the foot.
    """

    hip: float = 0.0
    out: float = 0.0
    turn_out: float = 0.0
    knee: float = 0.0
    ankle: float = 0.0
    roll: float = 0.0
    toes: float = 0.0


@dataclass(frozen=True)
class Bend:
    """A rotation vector of pelvis, spine or head against what carries it.

    Attributes:
        forward: bends forward.
        side: bends to the person's left.
        turn: turns to the person's left.
    """

    forward: float = 0.0
    side: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True)
class Pose:
    """A whole body.

    Attributes:
        turn: about the vertical, 0 faces the camera, positive to the person's left.
        left_arm, right_arm, left_leg, right_leg: limbs.
        pelvis: against the upright; carries spine and head, not the legs.
        spine: of the chest against the pelvis, spread over the spine.
        head: against the chest, spread over the neck.
        offset: metres. x and y move the pelvis from where it rests; z is the height of the body's
            lowest point above the floor (0 stands or sits, positive jumps): see `placed`.
        touches: pairs of body parts (`hand.L`, `hips`, ...: see `capsules`) that should rest on
            each other; `untangled` closes the gap that another body's build leaves.
    """

    turn: float = 0.0
    left_arm: Arm = field(default_factory=Arm)
    right_arm: Arm = field(default_factory=Arm)
    left_leg: Leg = field(default_factory=Leg)
    right_leg: Leg = field(default_factory=Leg)
    pelvis: Bend = field(default_factory=Bend)
    spine: Bend = field(default_factory=Bend)
    head: Bend = field(default_factory=Bend)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    touches: tuple[tuple[str, str], ...] = ()


PARTS = ("left_arm", "right_arm", "left_leg", "right_leg", "pelvis", "spine", "head")


def _degrees(low: float, high: float) -> tuple[float, float]:
    return float(np.radians(low)), float(np.radians(high))


LIMITS: dict[str, dict[str, tuple[float, float]]] = {
    "arm": {
        "swing": _degrees(-60, 180),  # extension, flexion
        "abduction": _degrees(
            -50, 180
        ),  # adduction across the front (Kapandji: 30 to 45), abduction
        "turn_out": _degrees(-95, 90),  # internal (AAOS 70; a hand on the back needs 95), external
        "elbow": _degrees(0, 150),
        "pronation": _degrees(-80, 80),
        "wrist": _degrees(-70, 80),  # extension, flexion
        "wrist_side": _degrees(-30, 20),  # ulnar, radial
        "shrug": _degrees(-10, 40),  # depression, elevation of the collar bone (Kapandji)
        "curl": (0.0, 1.0),
    },
    "leg": {
        "hip": _degrees(-40, 145),  # AAOS -30, 120 against the pelvis, which can tilt along
        "out": _degrees(-30, 60),  # adduction; abduction AAOS 45, more in a dancer with hips turned
        "turn_out": _degrees(
            -45, 60
        ),  # AAOS 45 and 45; more with a bent hip (sitting cross-legged)
        "knee": _degrees(0, 140),
        "ankle": _degrees(-50, 20),  # plantar flexion, dorsiflexion
        "roll": _degrees(-20, 35),  # eversion, inversion
        "toes": _degrees(-30, 60),
    },
    # against the upright, so forward includes what the hips allow
    "pelvis": {"forward": _degrees(-30, 70), "side": _degrees(-20, 20), "turn": _degrees(-30, 30)},
    "spine": {"forward": _degrees(-25, 80), "side": _degrees(-35, 35), "turn": _degrees(-45, 45)},
    "head": {"forward": _degrees(-45, 45), "side": _degrees(-45, 45), "turn": _degrees(-70, 70)},
}
"""Lowest and highest angle of each joint: the American Academy of Orthopaedic Surgeons' normal
ranges of motion (Joint Motion: Method of Measuring and Recording, 1965) unless a line says more."""


def limits_of(part: str) -> dict[str, tuple[float, float]]:
    """The limits of a pose's part: `left_arm` has those of `arm`. Raises: KeyError."""
    return LIMITS[part.removeprefix("left_").removeprefix("right_")]


def angles(pose: Pose) -> Iterator[tuple[str, str, float, tuple[float, float]]]:
    """Every limited angle: part, name, value and its limits."""
    for part in PARTS:
        values = getattr(pose, part)
        for name, limits in limits_of(part).items():
            yield part, name, getattr(values, name), limits


def clamped(pose: Pose) -> Pose:
    """The same pose with every angle inside its limits."""
    changes = {}
    for part in PARTS:
        values = getattr(pose, part)
        kept = {
            name: min(max(getattr(values, name), low), high)
            for name, (low, high) in limits_of(part).items()
        }
        changes[part] = type(values)(**kept)
    return replace(pose, **changes)


def numbers(pose: Pose) -> Row:
    """A pose as one row, for interpolation; `touches` is not in it."""
    rows = [getattr(getattr(pose, part), f.name) for part in PARTS for f in fields(_KINDS[part])]
    return np.array([pose.turn, *pose.offset, *rows])


def from_numbers(row: Row) -> Pose:
    """The way back from `numbers`."""
    values = iter(row.tolist())
    turn, offset = next(values), (next(values), next(values), next(values))
    parts: dict[str, Any] = {
        part: _KINDS[part](*(next(values) for _ in fields(_KINDS[part]))) for part in PARTS
    }
    return Pose(turn=turn, offset=offset, **parts)


_KINDS = dict(zip(PARTS, (Arm, Arm, Leg, Leg, Bend, Bend, Bend), strict=True))


def _other_side(bend: Bend) -> Bend:
    return Bend(bend.forward, -bend.side, -bend.turn)


def mirrored(pose: Pose) -> Pose:
    """The pose as a mirror shows it: left and right change places, turns change sign."""
    swap = str.maketrans("LR", "RL")
    return Pose(
        turn=-pose.turn,
        left_arm=pose.right_arm,
        right_arm=pose.left_arm,
        left_leg=pose.right_leg,
        right_leg=pose.left_leg,
        pelvis=_other_side(pose.pelvis),
        spine=_other_side(pose.spine),
        head=_other_side(pose.head),
        offset=(-pose.offset[0], pose.offset[1], pose.offset[2]),
        touches=tuple((a.translate(swap), b.translate(swap)) for a, b in pose.touches),
    )


def blend(a: Pose, b: Pose, t: float) -> Pose:
    """Between two poses, each angle by itself: t = 0 is `a`, t = 1 is `b`.

    `turn` goes the short way round. What touches in both keeps touching.
    """
    first, second = numbers(a), numbers(b)
    second[0] = first[0] + (second[0] - first[0] + np.pi) % (2 * np.pi) - np.pi
    touches = tuple(pair for pair in a.touches if pair in b.touches)
    return replace(from_numbers(first + t * (second - first)), touches=touches)


def arm_chain(arm: Arm) -> Matrix:
    """The shoulder's rotation from the zero pose, in the chest's axes, left side."""
    return turned(-arm.swing, -arm.abduction, arm.turn_out)


def leg_chain(leg: Leg) -> Matrix:
    """The hip's rotation from the zero pose, in the upright's axes, left side."""
    return turned(-leg.hip, -leg.out, leg.turn_out)


def hand_chain(arm: Arm) -> Matrix:
    """The hand's rotation against the forearm, left side."""
    return turned(0, 0, -arm.pronation) @ turned(-arm.wrist_side, arm.wrist, 0)


def foot_chain(leg: Leg) -> Matrix:
    """The foot's rotation against the shin, left side."""
    return turned(-leg.ankle, leg.roll, 0)


def collar_bone(upper: Matrix, rest: Rest, shrug: float = 0.0) -> Matrix:
    """How the shoulder follows the upper arm: up with a raised arm, forward with one in front.

    The shoulder blade does about a third of an arm's lift beyond the first 30 degrees
    (scapulohumeral rhythm, Inman 1944); the collar bone, which alone is in the model, rises about
    30 degrees for a fully raised arm. Smooth in the upper arm's direction.
    """
    direction = upper @ rest.upper_axis
    raised = 0.5 * (1 + direction[2])  # 0 hanging, 0.5 level, 1 straight up
    lift = 0.55 * raised**1.5 + shrug
    forward = -0.22 * direction[1]
    return turned(0, -lift, -forward)


def _arm(arm: Arm, rest: Rest, fingers: bool) -> Bones:
    chain = arm_chain(arm)
    upper = chain @ rest.upper_arm
    chain = chain @ turned(-arm.elbow, 0, 0)
    fore = chain @ rest.forearm
    hand = chain @ hand_chain(arm) @ rest.hand
    bones = arm_bones(rest, collar_bone(upper, rest, arm.shrug), upper, fore, hand)
    return bones | finger_bones(rest, arm.curl) if fingers else bones


def _leg(leg: Leg, rest: Rest, pelvis: Matrix) -> Bones:
    chain = pelvis.T @ leg_chain(leg)
    thigh = chain @ rest.leg
    chain = chain @ turned(leg.knee, 0, 0)
    foot = chain @ foot_chain(leg)  # the rest pose's foot is flat and points forward
    return leg_bones(rest, thigh, chain @ rest.leg, foot, leg.toes)


def _vector(bend: Bend) -> Vector:
    return np.array([bend.forward, bend.side, bend.turn])


def rotations_at(pose: Pose, rest: Rest, *, fingers: bool = True) -> Bones:
    """`pose_rotations` for a body already measured; without fingers where they do not matter."""
    pelvis = rotation(*_vector(pose.pelvis))
    other = rotation(*_vector(_other_side(pose.pelvis)))  # legs are both written as left ones
    left = _arm(pose.left_arm, rest, fingers) | _leg(pose.left_leg, rest, pelvis)
    right = _arm(pose.right_arm, rest, fingers) | _leg(pose.right_leg, rest, other)
    return {
        "root": turned(0, 0, pose.turn) @ pelvis,
        **spine_bones(_vector(pose.spine)),
        **neck_bones(_vector(pose.head)),
        **both_sides(left, right),
    }


def pose_rotations(pose: Pose, body: Body) -> Bones:
    """Each turned bone's rotation, for `body.transforms`.

    Leave `pose.offset` to `placed`, which knows the posed skin.
    """
    return rotations_at(pose, Rest.of(body))


def placed(points: Float32[np.ndarray, "V 3"], pose: Pose) -> Shift:
    """The shift that puts posed points where the pose wants them: add it to all that is drawn.

    Args:
        points: the posed skin (without shift), metres.
    Returns: `pose.offset` in x and y; in z what brings the lowest point to `pose.offset[2]`.
    """
    x, y, z = pose.offset
    return np.array([x, y, z - points[:, 2].min()], np.float32)
