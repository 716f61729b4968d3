"""A body as seventeen capsules: quick to pose, quick to test for limbs that go through each other.

A capsule is a segment with a radius that changes evenly along it. The torso's lie from side to
side, because a torso is wider than deep. Radii are measured from the skin at rest; the body is
taken as symmetric. Lengths are metres.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from functools import lru_cache
from itertools import combinations, pairwise

import numpy as np
from jaxtyping import Float64

from motion_transfer.people.figure.body import Body, BodyModel
from motion_transfer.people.motion.limbs import MIRROR, NECK, SPINE, Matrix, Rest, rotation, turned
from motion_transfer.people.motion.poses import (
    Arm,
    Bend,
    Leg,
    Pose,
    arm_turns,
    collar_bone,
    leg_chain,
    leg_turns,
)

Points = Float64[np.ndarray, "n 3"]
Numbers = Float64[np.ndarray, "n"]

TORSO = ("hips", "belly", "chest", "shoulders")
TORSO_BONES = ("root", "spine04", "spine02", "spine01")  # which carry those
LIMBS = ("upperarm", "forearm", "hand", "thigh", "shin", "foot")
PARTS = (*TORSO, "head", *(f"{limb}.{side}" for side in "LR" for limb in LIMBS))
INDEX = {part: i for i, part in enumerate(PARTS)}
MEASURED_STEP = 3
"""One in so many vertices is enough to take a limb's measure."""

TOUCHING = 0.01
"""How far parts may sink into each other: skin gives way where a hand rests on it."""

# bones whose skin belongs to a limb's capsule, by the start of their names
_SKIN = {
    "upperarm": ("upperarm",),
    "forearm": ("lowerarm",),
    "hand": ("metacarpal", "finger2", "finger3", "finger4", "finger5"),
    "thigh": ("upperleg",),
    "shin": ("lowerleg",),
    "foot": ("foot", "toe"),
}
_SPAN = {"upperarm": 0.45, "thigh": 0.35}  # from where on they can come free of the torso


def _can_meet(a: str, b: str) -> bool:
    """Tell pairs that can meet: not neighbours, nor the trunk's parts among themselves."""
    trunk = (*TORSO, "head")
    limb_a, limb_b = a.split(".")[0], b.split(".")[0]
    near = {("upperarm", "forearm"), ("forearm", "hand"), ("thigh", "shin"), ("shin", "foot")}
    near |= {("thigh", "foot"), ("upperarm", "hand")}  # a limb's own joints limit those
    neighbours = a[-2:] == b[-2:] and (limb_a, limb_b) in near
    grown_together = (a, limb_b) == ("shoulders", "upperarm") or (a in trunk and limb_b == "thigh")
    return not ((a in trunk and b in trunk) or neighbours or grown_together)


FIRST, SECOND = np.array(
    [(INDEX[a], INDEX[b]) for a, b in combinations(PARTS, 2) if _can_meet(a, b)]
).T
"""The pairs that are tested, as places in `PARTS`."""


@dataclass(frozen=True)
class Placement:
    """Capsules of a posed body.

    Attributes:
        starts, ends: The segments' ends.
        arms, legs: For left and right: shoulder, elbow, wrist, knuckles; hip, knee, ankle, heel,
            toes.
        chest, upright: Rotations of what arms and legs are measured against.
    """

    starts: Points
    ends: Points
    arms: tuple[Points, Points]
    legs: tuple[Points, Points]
    chest: Matrix
    upright: Matrix


@dataclass(frozen=True)
class Contacts:
    """The tested pairs of parts.

    Attributes:
        gaps: How far apart the two are; negative where they go through each other.
        near, far: Closest points on the first and the second part's segment.
        normals: Unit vectors from the second to the first.
    """

    gaps: Numbers
    near: Points
    far: Points
    normals: Points


class Capsules:
    """One body's capsules.

    Attributes:
        rest: Its limbs' rest frames.
        radii: 17 x 2, at start and end.
        allowed: Gap from which a pair counts as tangled: -1 cm, or what the rest pose already has.
    """

    def __init__(self, model: BodyModel, body: Body) -> None:
        self.rest = Rest.of(body)
        heads, index = body.heads, body.skeleton.index
        at = {name: heads[i] for name, i in index.items()}
        self._spine = np.array([at[name] for name in SPINE])
        self._neck = np.array([at[name] for name in NECK])
        self._collar = at["clavicle.L"] - at["spine01"]
        # to the middle finger's first joint but one: a hand's capsule leaves out the fingertips
        arm_bones = ("clavicle", "upperarm01", "lowerarm01", "wrist", "finger3-2")
        arm = [at[f"{name}.L"] for name in arm_bones]
        self._arm = np.diff(arm, axis=0)
        # a foot's capsule begins a little behind the ankle, low in the heel
        toes, heel = at["toe2-2.L"], at["foot.L"] * [1, 1, 0] + [0, 0.02, 0.035]
        hip, knee, ankle = (at[f"{name}.L"] for name in ("upperleg01", "lowerleg01", "foot"))
        self._hip = hip - at["root"]
        self._leg = np.array([knee - hip, ankle - knee, heel - ankle, toes - ankle])
        self._trunk_heads = np.array([at[name] for name in TORSO_BONES])
        self._crown = at["head"]
        self.radii = np.empty((len(PARTS), 2))
        self._trunk = np.empty((5, 2, 3))
        self._measure_limbs(
            model, body, [*pairwise(arm[1:]), (hip, knee), (knee, ankle), (heel, toes)]
        )
        self._measure_trunk(model, body)
        # at rest with some room: arms and legs a little away from the body
        away, leg = Arm(abduction=0.75, elbow=0.5), Leg(out=0.08)
        at_rest = self.place(Pose(left_arm=away, right_arm=away, left_leg=leg, right_leg=leg))
        self.allowed = np.minimum(-TOUCHING, self.contacts(at_rest).gaps)

    def _measure_limbs(self, model: BodyModel, body: Body, segments: list) -> None:
        skin_of = _skin_parts(model)
        for limb, (start, end) in zip(LIMBS, segments, strict=True):
            low = _SPAN.get(limb, 0.0)
            skin = body.points[skin_of[limb]].astype(np.float64)
            radii = _radii(skin, start + low * (end - start), end)
            if limb in ("hand", "foot"):  # flat: between half the thickness and half the width
                radii = 0.75 * radii[0], 0.75 * radii[1]
            self.radii[[INDEX[f"{limb}.L"], INDEX[f"{limb}.R"]]] = radii

    def _measure_trunk(self, model: BodyModel, body: Body) -> None:
        """Measure segments and radii of the torso, by slices at four heights, and of the head."""
        skin_of = _skin_parts(model)
        trunk = body.points[skin_of["trunk"]].astype(np.float64)
        # hips, waist, breast and armpits, so far above the joints nearest to them
        bones = (("upperleg01.L", -0.01), ("spine04", 0), ("spine03", 0.06), ("spine01", 0.02))
        for i, (bone, above) in enumerate(bones):
            height = body.joint(bone)[2] + above
            skin = trunk[np.abs(trunk[:, 2] - height) < 0.04]
            front, back = skin[:, 1].min(), skin[:, 1].max()
            radius, middle = (back - front) / 2, (front + back) / 2
            # from side to side; the outermost 2 % may be an arm's root
            half = max(np.quantile(np.abs(skin[:, 0]), 0.98) - radius, 0.01)
            self._trunk[i] = [[half, middle, height], [-half, middle, height]]
            self.radii[i] = radius
        skull = body.points[skin_of["head"]].astype(np.float64)
        skull = skull[skull[:, 2] > body.joint("head")[2]]
        width = np.ptp(skull[:, 0]) / 2
        middle = (skull[:, 1].min() + skull[:, 1].max()) / 2
        self._trunk[4] = [[0, middle, body.joint("head")[2]], [0, middle, body.height - width]]
        self.radii[4] = width * 1.1  # a head is deeper than wide
        self._trunk[:4] -= self._trunk_heads[:, None]
        self._trunk[4] -= self._crown

    def place(self, pose: Pose) -> Placement:
        """Pose the capsules, without the pose's offset, which moves all alike."""
        upright = turned(0, 0, pose.turn)
        pelvis = upright @ _share(pose.pelvis, 1)
        segments = np.empty((len(PARTS), 2, 3))
        root = self._trunk_heads[0]
        segments[0] = root + self._trunk[0] @ pelvis.T
        chest, base = self._place_spine(pose, pelvis, segments)
        arms = [self._arm_points(arm) for arm in (pose.left_arm, pose.right_arm)]
        legs = [self._leg_points(leg) for leg in (pose.left_leg, pose.right_leg)]
        arms[1] *= MIRROR
        legs[1] *= MIRROR
        hips = root + np.array([self._hip, self._hip * MIRROR]) @ pelvis.T
        for side in (0, 1):
            arm = arms[side] = base + arms[side] @ chest.T
            leg = legs[side] = hips[side] + legs[side] @ upright.T
            first = 5 + 6 * side
            low = _SPAN["upperarm"], _SPAN["thigh"]
            segments[first] = arm[0] + low[0] * (arm[1] - arm[0]), arm[1]
            segments[first + 1], segments[first + 2] = arm[1:3], arm[2:4]
            segments[first + 3] = leg[0] + low[1] * (leg[1] - leg[0]), leg[1]
            segments[first + 4], segments[first + 5] = leg[1:3], leg[3:5]
        return Placement(
            segments[:, 0], segments[:, 1], (arms[0], arms[1]), (legs[0], legs[1]), chest, upright
        )

    def _place_spine(
        self, pose: Pose, pelvis: Matrix, segments: np.ndarray
    ) -> tuple[Matrix, np.ndarray]:
        turn, place, before = pelvis, self._spine[0], self._spine[0]
        step = _share(pose.spine, len(SPINE))
        for bone, head in zip(SPINE, self._spine, strict=True):
            place, before = place + turn @ (head - before), head
            turn = turn @ step
            if bone in TORSO_BONES:
                part = TORSO_BONES.index(bone)
                segments[part] = place + self._trunk[part] @ turn.T
        chest, base = turn, place
        step = _share(pose.head, len(NECK))
        for head in self._neck:
            place, before = place + turn @ (head - before), head
            turn = turn @ step
        segments[4] = place + self._trunk[4] @ turn.T
        return chest, base

    def _arm_points(self, arm: Arm) -> Points:
        """Find shoulder, elbow, wrist and knuckles of a left arm against `spine01`."""
        upper, fore, hand = arm_turns(arm, self.rest)
        points = np.empty((4, 3))
        points[0] = self._collar + collar_bone(upper, self.rest, arm.shrug) @ self._arm[0]
        points[1] = points[0] + upper @ self._arm[1]
        points[2] = points[1] + fore @ self._arm[2]
        points[3] = points[2] + hand @ (self.rest.hand @ self._arm[3])
        return points

    def _leg_points(self, leg: Leg) -> Points:
        """Find hip, knee, ankle, heel and toes of a left leg against the hip."""
        thigh, shin, foot = leg_turns(leg_chain(leg), leg, self.rest)
        points = np.zeros((5, 3))
        points[1] = thigh @ self._leg[0]
        points[2] = points[1] + shin @ self._leg[1]
        points[3:] = points[2] + self._leg[2:] @ foot.T
        return points

    def contacts(self, placement: Placement) -> Contacts:
        """Measure all tested pairs."""
        a, b = placement.starts, placement.ends - placement.starts
        s, t = _closest(a[FIRST], b[FIRST], a[SECOND], b[SECOND])
        near, far = a[FIRST] + s[:, None] * b[FIRST], a[SECOND] + t[:, None] * b[SECOND]
        between = near - far
        distance = np.sqrt(np.einsum("ij,ij->i", between, between))
        slope = self.radii[:, 1] - self.radii[:, 0]
        reach = self.radii[FIRST, 0] + s * slope[FIRST] + self.radii[SECOND, 0] + t * slope[SECOND]
        return Contacts(distance - reach, near, far, between / np.maximum(distance, 1e-6)[:, None])


def _share(bend: Bend, bones: int) -> Matrix:
    """Give each of so many bones the same part of a bend."""
    return rotation(*(1 / bones * angle for angle in astuple(bend)))


@lru_cache(maxsize=1)
def _skin_parts(model: BodyModel) -> dict[str, np.ndarray]:
    """Choose the vertices of each of the left limbs, the trunk and the head, for every shape."""
    owner = np.asarray(model.weights.matrix.argmax(axis=1)).ravel()
    names = [model.skeleton.names[bone] for bone in owner]
    parts = {
        limb: [i for i, n in enumerate(names) if n.endswith(".L") and n.startswith(bones)]
        for limb, bones in _SKIN.items()
    }
    trunk = ("spine", "pelvis", "upperleg01", "root")
    parts["trunk"] = [i for i, name in enumerate(names) if name.startswith(trunk)]
    parts["head"] = [i for i, name in enumerate(names) if name == "head"]
    return {part: np.array(index[::MEASURED_STEP]) for part, index in parts.items()}


def _radii(skin: Points, start: np.ndarray, end: np.ndarray) -> tuple[float, float]:
    """Measure a limb near its start and near its end: what 70 % of the skin there lies within."""
    axis = end - start
    along = (skin - start) @ axis / (axis @ axis)
    distance = np.linalg.norm(skin - start - along[:, None] * axis, axis=1)
    near, far = distance[(along > 0) & (along < 0.4)], distance[(along > 0.6) & (along < 1)]
    places = [int(0.7 * (len(values) - 1)) for values in (near, far)]
    # ten times as quick as np.quantile
    low, high = (np.partition(v, k)[k] for v, k in zip((near, far), places, strict=True))
    return float(low), float(high)


def _closest(p: Points, d: Points, q: Points, e: Points) -> tuple[Numbers, Numbers]:
    """Find where segments p + s d and q + t e are closest, s and t in [0, 1].

    Source: Ericson, Real-Time Collision Detection (2005), Sec. 5.1.9.
    """
    r = p - q
    dd, ee, de = (np.einsum("ij,ij->i", x, y) for x, y in ((d, d), (e, e), (d, e)))
    dr, er = np.einsum("ij,ij->i", d, r), np.einsum("ij,ij->i", e, r)
    s = np.clip((de * er - dr * ee) / np.maximum(dd * ee - de * de, 1e-9), 0, 1)
    t = np.clip((de * s + er) / ee, 0, 1)
    return np.clip((de * t - dr) / dd, 0, 1), t
