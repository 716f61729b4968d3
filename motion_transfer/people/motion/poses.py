"""A pose as joint angles with a meaning, the bone rotations that make it, and the body in it.

Convention: radians. All zero is an upright person who faces the camera (-y), arms and legs straight
down, palms to the body, toes forward. Every angle of a limb means the same on both sides (positive
abduction moves either arm away from the body). Chains are read from the trunk outwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass, field, fields, replace
from itertools import islice
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from motion_transfer.people.figure.body import Body, BodyModel, Rotations
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.people.motion.limbs import (
    Bones,
    Matrix,
    Rest,
    arm_bones,
    finger_bones,
    leg_bones,
    rotation,
    turned,
    whole_body,
)

Row = Float64[np.ndarray, "numbers"]

RELAXED = 0.3
"""Curl of the fingers of a hand that does nothing."""


@dataclass(frozen=True)
class Arm:
    """Angles of one arm against the chest.

    Attributes:
        swing: Lifts the arm forward (shoulder flexion), applied after `abduction`: at a swing of
            90 degrees abduction moves the arm sideways in the horizontal plane.
        abduction: Lifts it sideways, away from the body.
        turn_out: Turns it outwards about its own length.
        elbow: Bends it; the forearm comes forward when the arm hangs.
        pronation: Turns the hand, thumb towards the body when the arm hangs; palm back.
        wrist: Bends the hand to the palm's side (flexion).
        wrist_side: Bends it to the thumb's side (radial deviation).
        shrug: Lifts the shoulder, besides what a raised arm does by itself.
        curl: Closes the fingers: 0 flat, 0.3 relaxed, 1 a fist; no angle.
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
        hip: Lifts the thigh forward, applied after `out`.
        out: Lifts it sideways (abduction).
        turn_out: Turns it outwards about its own length.
        knee: Bends it, the shin goes back.
        ankle: Lifts the foot (dorsiflexion); negative points it.
        roll: Turns the sole inwards (inversion); keeps it flat under a leg that stands out.
        toes: Lifts the toes against the foot.
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
        forward: Bends forward.
        side: Bends to the person's left.
        turn: Turns to the person's left.
    """

    forward: float = 0.0
    side: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True)
class Pose:
    """A whole body.

    Attributes:
        turn: Turns all about the vertical: 0 faces the camera, positive to the person's left.
        left_arm, right_arm, left_leg, right_leg: Limbs.
        pelvis: Bends the pelvis against the upright; carries spine and head, not the legs.
        spine: Bends the chest against the pelvis, spread over the spine.
        head: Bends the head against the chest, spread over the neck.
        offset: Metres. x and y move the pelvis from where it rests; z is the height of the body's
            lowest point above the floor (0 stands or sits, positive jumps): see `placed`.
        touches: Pairs of body parts (`hand.L`, `hips`, ...: see `capsules`) that should rest on
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
_KINDS: dict[str, type[Arm | Leg | Bend]] = dict(
    zip(PARTS, (Arm, Arm, Leg, Leg, Bend, Bend, Bend), strict=True)
)


def _degrees(low: float, high: float) -> tuple[float, float]:
    return float(np.radians(low)), float(np.radians(high))


LIMITS: dict[str, dict[str, tuple[float, float]]] = {
    "arm": {
        "swing": _degrees(-60, 180),  # extension, flexion
        "abduction": _degrees(-50, 180),  # adduction in front (Kapandji: 30 to 45), abduction
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
        "turn_out": _degrees(-45, 60),  # AAOS 45 and 45; more with a bent hip (cross-legged)
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


def angles(pose: Pose) -> Iterator[tuple[str, str, float, tuple[float, float]]]:
    """List every limited angle: part, name, value, and its lowest and highest value."""
    for part in PARTS:
        values = getattr(pose, part)
        for name, limits in LIMITS[part.removeprefix("left_").removeprefix("right_")].items():
            yield part, name, getattr(values, name), limits


def clamped(pose: Pose) -> Pose:
    """Bring every angle of a pose inside its limits."""
    kept: dict[str, dict[str, float]] = {part: {} for part in PARTS}
    for part, name, value, (low, high) in angles(pose):
        kept[part][name] = min(max(value, low), high)
    parts: dict[str, Any] = {part: _KINDS[part](**values) for part, values in kept.items()}
    return replace(pose, **parts)


def numbers(pose: Pose) -> Row:
    """Write a pose as one row, for interpolation; `touches` is not in it."""
    values = [value for part in PARTS for value in astuple(getattr(pose, part))]
    return np.array([pose.turn, *pose.offset, *values])


def from_numbers(row: Row) -> Pose:
    """Read a pose from a row of `numbers`."""
    values = iter(row.tolist())
    turn, offset = next(values), (next(values), next(values), next(values))
    parts: dict[str, Any] = {
        part: kind(*islice(values, len(fields(kind)))) for part, kind in _KINDS.items()
    }
    return Pose(turn=turn, offset=offset, **parts)


def _other_side(bend: Bend) -> Bend:
    return Bend(bend.forward, -bend.side, -bend.turn)


def mirrored(pose: Pose) -> Pose:
    """Turn a pose into what a mirror shows: left and right change places, turns change sign."""
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


def arm_chain(arm: Arm) -> Matrix:
    """Find the shoulder's rotation from the zero pose, in the chest's axes, left side."""
    return turned(-arm.swing, -arm.abduction, arm.turn_out)


def leg_chain(leg: Leg) -> Matrix:
    """Find the hip's rotation from the zero pose, in the upright's axes, left side."""
    return turned(-leg.hip, -leg.out, leg.turn_out)


def arm_turns(arm: Arm, rest: Rest) -> tuple[Matrix, Matrix, Matrix]:
    """Turn the upper arm and the forearm from the rest pose, and the hand from the zero pose."""
    chain = arm_chain(arm)
    upper = chain @ rest.upper_arm
    chain = chain @ turned(-arm.elbow, 0, 0)
    hand = turned(0, 0, -arm.pronation) @ turned(-arm.wrist_side, arm.wrist, 0)
    return upper, chain @ rest.forearm, chain @ hand


def leg_turns(chain: Matrix, leg: Leg, rest: Rest) -> tuple[Matrix, Matrix, Matrix]:
    """Turn thigh, shin and foot from the rest pose, given the hip's rotation (see `leg_chain`)."""
    thigh = chain @ rest.leg
    chain = chain @ turned(leg.knee, 0, 0)
    # the rest pose's foot is flat and points forward, as the zero pose's does
    return thigh, chain @ rest.leg, chain @ turned(-leg.ankle, leg.roll, 0)


def collar_bone(upper: Matrix, rest: Rest, shrug: float = 0.0) -> Matrix:
    """Let the shoulder follow the upper arm: up with a raised one, forward with one in front.

    The shoulder blade does about a third of an arm's lift beyond the first 30 degrees
    (scapulohumeral rhythm, Inman 1944); the collar bone, which alone is in the model, rises about
    30 degrees for a fully raised arm. Smooth in the upper arm's direction.
    """
    direction = upper @ rest.upper_axis
    raised = 0.5 * (1 + direction[2])  # 0 hanging, 0.5 level, 1 straight up
    lift = 0.55 * raised**1.5 + shrug
    forward = -0.22 * direction[1]
    return turned(0, -lift, -forward)


def _limbs(arm: Arm, leg: Leg, pelvis: Matrix, rest: Rest) -> Bones:
    """Turn the bones of one side, as if it were the left one."""
    upper, fore, hand = arm_turns(arm, rest)
    collar = collar_bone(upper, rest, arm.shrug)
    return {
        **arm_bones(rest, collar, upper, fore, hand @ rest.hand),
        **finger_bones(rest, arm.curl),
        **leg_bones(rest, *leg_turns(pelvis.T @ leg_chain(leg), leg, rest), leg.toes),
    }


def pose_rotations(pose: Pose, body: Body) -> Bones:
    """Find each turned bone's rotation, for `body.transforms`.

    Leave `pose.offset` to `placed`, which knows the posed skin.
    """
    rest = Rest.of(body)
    pelvis = rotation(*astuple(pose.pelvis))
    other = rotation(*astuple(_other_side(pose.pelvis)))  # legs are both written as left ones
    return whole_body(
        turned(0, 0, pose.turn) @ pelvis,
        np.array(astuple(pose.spine)),
        np.array(astuple(pose.head)),
        _limbs(pose.left_arm, pose.left_leg, pelvis, rest),
        _limbs(pose.right_arm, pose.right_leg, other, rest),
    )


def placed(points: Float32[np.ndarray, "V 3"], pose: Pose) -> Float32[np.ndarray, " 3"]:
    """Find the shift that puts posed points where the pose wants them; add it to all that is drawn.

    Args:
        points: The posed skin (without shift), metres.
    Returns: `pose.offset` in x and y; in z what brings the lowest point to `pose.offset[2]`.
    """
    x, y, z = pose.offset
    return np.array([x, y, z - points[:, 2].min()], np.float32)


def posed(body: Body, pose: Pose, model: BodyModel) -> PosedBody:
    """Pose a body, standing on the floor z = 0 (or as high above it as the pose says)."""
    transforms = body.transforms(pose_rotations(pose, body))
    points = model.pose(body, transforms)
    shift = placed(points, pose)
    points += shift
    transforms[..., 3] += shift
    return PosedBody(body, transforms, points, body.posed_joints(transforms))


def moved(
    body: Body, rotations: Rotations, offset: tuple[float, float, float], model: BodyModel
) -> PosedBody:
    """Turn a body's bones and move the whole of it by an offset in metres."""
    transforms = body.transforms(rotations, offset)
    points = model.pose(body, transforms)
    return PosedBody(body, transforms, points, body.posed_joints(transforms))
