"""Where the trunk and each limb of a BVH skeleton point, frame by frame, in our body's axes.

Convention: after `body_frames` z is up and the person faces -y in the first frame, whatever the
file's axes were; lengths are in legs (hip to ankle). Limbs of the right side are mirrored, so that
they read like left ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from motion_transfer.errors import InputError
from motion_transfer.people.motion.bvh.file import BvhMotion
from motion_transfer.people.motion.bvh.skeleton import Limb, Roles, Tracks, find_roles, tracks
from motion_transfer.people.motion.limbs import MIRROR, Matrix, Vector

Vectors = Float64[np.ndarray, "N 3"]
Matrices = Float64[np.ndarray, "N 3 3"]

PRIOR = 0.02  # weight of the assumed hinge against the squared sines of the bends that are seen
SHORTEST_LEG = 1e-6  # in whatever unit: what is divided by
STRAIGHT = 0.966  # cosine of 15 degrees: a leg less bent than that at rest was meant to be straight
UPRIGHT = 0.8  # cosine of how far a rest pose may lean and still be taken for a standing one


@dataclass(frozen=True)
class LimbFrames:
    """One limb; columns of the frames: direction, hinge, their cross product.

    Attributes:
        upper, lower: Upper arm and forearm, or thigh and shin.
        tip: An arm's hand (direction, thumb's side, palm); a leg's foot as a rotation from rest.
    """

    upper: Matrices
    lower: Matrices
    tip: Matrices


@dataclass(frozen=True)
class Frames:
    """A motion without its skeleton.

    Attributes:
        pelvis, chest, head: Rotations from upright and facing -y.
        legs, arms: Left and right, the right ones mirrored; arms may be missing.
        hips: The point between the hip joints, in legs.
    """

    pelvis: Matrices
    chest: Matrices
    head: Matrices
    legs: tuple[LimbFrames, LimbFrames]
    arms: tuple[LimbFrames, LimbFrames] | None
    hips: Vectors


def body_frames(motion: BvhMotion) -> Frames:
    """Take a motion off its skeleton.

    Raises: InputError where the skeleton has no hips with two legs, see `find_roles`, or they have
        no length.
    """
    roles = find_roles(motion)
    moving, rest = _faced(tracks(motion), tracks(motion, at_rest=True), roles)
    places, turns = moving.places, moving.turns
    left, right = roles.legs
    hips = (places[:, left.root] + places[:, right.root]) / 2
    chest = roles.chest if roles.chest >= 0 else roles.hips
    head = roles.head if roles.head >= 0 else chest
    one = np.ones(3)
    legs = _leg(motion, moving, rest, left, one), _leg(motion, moving, rest, right, MIRROR)
    arms = None
    if roles.arms is not None:
        left, right = roles.arms
        arms = _arm(motion, moving, rest, left, one), _arm(motion, moving, rest, right, MIRROR)
    length = _leg_length(places, roles)
    if length < SHORTEST_LEG:
        raise InputError(
            f"{motion.path}: the legs of the skeleton have no length; check its OFFSETs"
        )
    scale = 1 / length
    return Frames(turns[:, roles.hips], turns[:, chest], turns[:, head], legs, arms, hips * scale)


def _leg_length(places: np.ndarray, roles: Roles) -> float:
    lengths = [
        np.linalg.norm(places[:, a] - places[:, b], axis=1).mean()
        for leg in roles.legs
        for a, b in ((leg.root, leg.middle), (leg.middle, leg.end))
    ]
    return float(sum(lengths)) / 2


def _upward(places: np.ndarray, roles: Roles) -> Vector:
    """Point from the ankles to the top of the skeleton, averaged over frames, not a unit."""
    tops = [i for i in (roles.head, roles.neck, roles.chest, roles.hips) if i >= 0]
    ankles = (places[:, roles.legs[0].end] + places[:, roles.legs[1].end]) / 2
    return (places[:, tops[0]] - ankles).mean(0)


def _axis(rise: Vector) -> Vector:
    """Find the axis nearest to a direction, as a unit vector."""
    axis = int(np.abs(rise).argmax())
    return np.eye(3)[axis] * np.sign(rise[axis])


def _stands(rest: Tracks, roles: Roles) -> bool:
    """Tell whether the rest pose is a standing person: rotations against another mean nothing."""
    places = rest.places
    rise = _upward(places, roles)
    up, leg = _axis(rise), _leg_length(places, roles)
    left, right = places[0, roles.legs[0].root], places[0, roles.legs[1].root]
    ankles = (places[0, roles.legs[0].end] + places[0, roles.legs[1].end]) / 2
    # some files' rest poses lay all bones along one axis (LAFAN1): legs and spine the same way
    upright = rise @ up > UPRIGHT * np.linalg.norm(rise) and rise @ up > leg
    level = np.linalg.norm(left - right) > 0 and abs((left - right) @ up) < 0.3 * leg
    return bool(upright and level and ((left + right) / 2 - ankles) @ up > 0.7 * leg)


def _faced(moving: Tracks, rest: Tracks, roles: Roles) -> tuple[Tracks, Tracks]:
    """Turn both so that z is up and both face -y, the motion in its first frame.

    A rest pose that does not stand is replaced by the first frame.
    """
    stands = _stands(rest, roles)
    up = _axis(_upward(rest.places if stands else moving.places, roles))
    if not stands:
        first = moving.turns[:1].transpose(0, 1, 3, 2)
        rest = Tracks(moving.places[:1], np.eye(3)[None], moving.tips[:1])
        moving = Tracks(moving.places, moving.turns @ first, moving.tips)
    before, after = (_facing(t.places[0], roles, up) for t in (rest, moving))
    rest = Tracks(rest.places @ before.T, rest.turns, rest.tips @ before.T)
    turns = after @ moving.turns @ before.T
    return Tracks(moving.places @ after.T, turns, moving.tips @ after.T), rest


def _facing(places: Float64[np.ndarray, "joints 3"], roles: Roles, up: np.ndarray) -> Matrix:
    """Find the rotation that takes `up` to z and the person's left to +x: then they face -y."""
    left = _unit(places[roles.legs[0].root] - places[roles.legs[1].root])
    if roles.arms is not None:  # shoulders and hips turn against each other; between them is ahead
        left = left + _unit(places[roles.arms[0].root] - places[roles.arms[1].root])
    left = _unit(left - (left @ up) * up)
    return np.stack([left, np.cross(up, left), up])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def _frame(direction: Vectors, side: Vectors) -> Matrices:
    """Make unit columns: direction, `side` made perpendicular to it, their cross product."""
    first = _unit(direction)
    second = _unit(side - (side * first).sum(-1, keepdims=True) * first)
    return np.stack([first, second, np.cross(first, second)], -1)


def _hinges(
    upper: Vectors, lower: Vectors, turns: Matrices, assumed: Vector
) -> tuple[Vectors, Vector]:
    """Find the hinge of an elbow or knee in each frame, and at rest.

    A bent joint shows its hinge. A straight one does not: there the hinge that was seen over the
    whole motion, fixed to the upper limb, is carried along by the joint's rotation.
    """
    seen = np.cross(_unit(upper), _unit(lower))
    bend = np.linalg.norm(seen, axis=1)
    local = np.einsum("nji,nj->ni", turns, seen)
    at_rest = _unit((local * bend[:, None]).mean(0) + PRIOR * assumed)
    carried = turns @ at_rest
    # bent less than 9 degrees a joint shows nothing but noise, at 30 all of its hinge
    trust = np.clip((bend - 0.15) / 0.35, 0, 1)
    trust = (trust * trust * (3 - 2 * trust))[:, None]
    return trust * _unit(seen) + (1 - trust) * carried, at_rest


def _mirrored(moving: Tracks, joint: int, mirror: np.ndarray) -> Matrices:
    return moving.turns[:, joint] * np.outer(mirror, mirror)


def _segments(
    motion: BvhMotion, moving: Tracks, rest: Tracks, limb: Limb, mirror: np.ndarray
) -> tuple[Vectors, Vectors, Matrices, Vector]:
    """Find the directions of both parts, how the upper one turns, and its direction at rest."""
    points = moving.places * mirror
    upper = points[:, limb.middle] - points[:, limb.root]
    lower = points[:, limb.end] - points[:, limb.middle]
    at_rest = (rest.places[0, limb.middle] - rest.places[0, limb.root]) * mirror
    return upper, lower, _mirrored(moving, motion.parents[limb.middle], mirror), _unit(at_rest)


def _arm(
    motion: BvhMotion, moving: Tracks, rest: Tracks, limb: Limb, mirror: np.ndarray
) -> LimbFrames:
    upper, lower, turns, at_rest = _segments(motion, moving, rest, limb, mirror)
    # bending an elbow brings the hand forward, -y, from any arm held sideways or down
    assumed = np.cross(at_rest, [0.0, -1.0, 0.0])
    hinge, rest_hinge = _hinges(upper, lower, turns, assumed)
    tips = moving.places if limb.tip >= 0 else moving.tips
    hand = (tips[:, limb.tip if limb.tip >= 0 else limb.end] - moving.places[:, limb.end]) * mirror
    # some files end with a hand of no length
    short = np.linalg.norm(hand, axis=1) < 1e-3 * np.linalg.norm(lower, axis=1)
    hand = np.where(short[:, None], lower, hand)
    # with forearm and hand in line, the palm looks along the hinge where the forearm is not turned;
    # rest poses (T with palms down, A with palms to the body) are like that
    palm = _mirrored(moving, limb.end, mirror) @ rest_hinge
    across = np.cross(palm, _unit(hand))
    return LimbFrames(_frame(upper, hinge), _frame(lower, hinge), _frame(hand, across))


def _leg(
    motion: BvhMotion, moving: Tracks, rest: Tracks, limb: Limb, mirror: np.ndarray
) -> LimbFrames:
    upper, lower, turns, _ = _segments(motion, moving, rest, limb, mirror)
    hinge, rest_hinge = _hinges(upper, lower, turns, np.array([1.0, 0, 0]))
    thigh, shin = _frame(upper, hinge), _frame(lower, hinge)
    points = rest.places[0] * mirror
    hip, knee, ankle = points[limb.root], points[limb.middle], points[limb.end]
    parts = [_frame(part[None], rest_hinge[None])[0] for part in (knee - hip, ankle - knee)]
    if parts[0][:, 0] @ parts[1][:, 0] > STRAIGHT:
        # a straight leg's joints need not lie on a line; what counts is its line from hip to ankle
        line = _frame((ankle - hip)[None], rest_hinge[None])[0]
        thigh, shin = thigh @ parts[0].T @ line, shin @ parts[1].T @ line
    return LimbFrames(thigh, shin, _mirrored(moving, limb.end, mirror))
