"""A body as seventeen capsules: quick to pose, quick to test for limbs that go through each other.

A capsule is a segment with a radius that changes evenly along it. The torso's lie from side to
side, because a torso is wider than deep. Radii are measured from the skin at rest; the body is
taken as symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from jaxtyping import Float64

from motion_transfer.people.figure.body import Body, BodyModel
from motion_transfer.people.motion.limbs import MIRROR, NECK, SPINE, Matrix, Rest, rotation, turned
from motion_transfer.people.motion.poses import (
    Arm,
    Leg,
    Pose,
    arm_chain,
    collar_bone,
    foot_chain,
    hand_chain,
    leg_chain,
)

Points = Float64[np.ndarray, "n 3"]
Numbers = Float64[np.ndarray, "n"]

TORSO = ("hips", "belly", "chest", "shoulders")
TORSO_BONES = ("root", "spine04", "spine02", "spine01")
LIMBS = ("upperarm", "forearm", "hand", "thigh", "shin", "foot")
PARTS = (*TORSO, "head", *(f"{limb}.{side}" for side in "LR" for limb in LIMBS))
INDEX = {part: i for i, part in enumerate(PARTS)}
MEASURED_STEP = 3
"""One in so many vertices is enough to take a limb's measure."""

TOUCHING = 0.01
"""How far parts may sink into each other, metres: skin gives way where a hand rests on it."""

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


def _tested() -> tuple[np.ndarray, np.ndarray]:
    """Pairs that can meet: not neighbours, nor the torso's parts among themselves."""
    limbs = {part: part.split(".")[0] for part in PARTS}
    near = {("upperarm", "forearm"), ("forearm", "hand"), ("thigh", "shin"), ("shin", "foot")}
    near |= {("thigh", "foot"), ("upperarm", "hand")}  # a limb's own joints limit those
    first, second = [], []
    for a, b in combinations(PARTS, 2):
        both_trunk = a in (*TORSO, "head") and b in (*TORSO, "head")
        same_side = a[-2:] == b[-2:]
        neighbours = same_side and (limbs[a], limbs[b]) in near
        thigh_and_trunk = a in (*TORSO, "head") and limbs[b] == "thigh"
        shoulder = (a, limbs[b]) == ("shoulders", "upperarm")  # grows out of it
        if not (both_trunk or neighbours or thigh_and_trunk or shoulder):
            first.append(INDEX[a])
            second.append(INDEX[b])
    return np.array(first), np.array(second)


FIRST, SECOND = _tested()


@dataclass(frozen=True)
class Placement:
    """Capsules of a posed body.

    Attributes:
        starts, ends: of the segments, metres.
        arms, legs: for left and right: shoulder, elbow, wrist / hip, knee, ankle in the world.
        chest, upright: rotations of what arms and legs are measured against.
    """

    starts: Points
    ends: Points
    arms: tuple[Points, Points]
    legs: tuple[Points, Points]
    chest: Matrix
    upright: Matrix


@dataclass(frozen=True)
class Contacts:
    """The tested pairs: gap, where they are closest, and the unit vector from second to first.

    Attributes:
        gaps: metres; negative where the two go through each other.
        near, far: closest points on the first and the second part's segment.
        normals: from the second to the first.
    """

    gaps: Numbers
    near: Points
    far: Points
    normals: Points


class Capsules:
    """One body's capsules.

    Attributes:
        rest: its limbs' rest frames.
        radii: 17 x 2, at start and end, metres.
        allowed: gap from which a pair counts as tangled: -1 cm, or what the rest pose already has.
    """

    def __init__(self, model: BodyModel, body: Body) -> None:
        self.rest = Rest.of(body)
        heads, index = body.heads, body.skeleton.index
        at = {name: heads[i] for name, i in index.items()}
        self._spine = np.array([at[name] for name in SPINE])
        self._neck = np.array([at[name] for name in NECK])
        self._collar = at["clavicle.L"] - at["spine01"]
        # the middle finger's first joint but one: a hand's capsule leaves out the fingertips
        arm = [at[f"{name}.L"] for name in ("clavicle", "upperarm01", "lowerarm01", "wrist")]
        self._arm = np.diff([*arm, at["finger3-2.L"]], axis=0)
        toes, heel = at["toe2-2.L"], at["foot.L"] * [1, 1, 0] + [0, 0.02, 0.035]
        leg = [at[f"{name}.L"] for name in ("upperleg01", "lowerleg01", "foot")]
        self._hip = leg[0] - at["root"]
        self._leg = np.array([leg[1] - leg[0], leg[2] - leg[1], heel - leg[2], toes - leg[2]])
        self._trunk_heads = np.array([at[name] for name in TORSO_BONES])
        self._crown = at["head"]
        self.radii = np.empty((len(PARTS), 2))
        self._trunk = np.empty((5, 2, 3))
        self._measure(
            model, body, dict(zip(LIMBS, self._rest_segments(arm, at, leg, heel), strict=True))
        )
        self.allowed = np.full(len(FIRST), -TOUCHING)
        self.allowed = np.minimum(self.allowed, self.contacts(self.at_rest()).gaps)

    @staticmethod
    def _rest_segments(arm: list, at: dict, leg: list, heel: np.ndarray) -> list:
        ends = [at["finger3-2.L"], leg[1], leg[2], at["toe2-2.L"]]
        starts = [arm[3], leg[0], leg[1], heel]
        return [(arm[1], arm[2]), (arm[2], arm[3]), *zip(starts, ends, strict=True)]

    def _measure(self, model: BodyModel, body: Body, segments: dict) -> None:
        """Radii of limbs; segments and radii of the trunk."""
        skin_of = _skin_parts(model)
        for limb, (start, end) in segments.items():
            low = _SPAN.get(limb, 0.0)
            skin = body.points[skin_of[limb]].astype(np.float64)
            radii = _radii(skin, start + low * (end - start), end)
            if limb in ("hand", "foot"):  # flat: between half the thickness and half the width
                radii = 0.75 * radii[0], 0.75 * radii[1]
            self.radii[[INDEX[f"{limb}.L"], INDEX[f"{limb}.R"]]] = radii
        trunk = body.points[skin_of["trunk"]].astype(np.float64)
        hips = body.joint("upperleg01.L")[2]
        heights = [hips - 0.01, body.joint("spine04")[2], body.joint("spine03")[2] + 0.06]
        heights.append(body.joint("spine01")[2] + 0.02)
        for i, height in enumerate(heights):
            self._trunk[i], self.radii[i] = _slab(
                trunk[np.abs(trunk[:, 2] - height) < 0.04], height
            )
        skull = body.points[skin_of["head"]].astype(np.float64)
        skull = skull[skull[:, 2] > body.joint("head")[2]]
        width = np.ptp(skull[:, 0]) / 2
        middle = (skull[:, 1].min() + skull[:, 1].max()) / 2
        self._trunk[4] = [[0, middle, body.joint("head")[2]], [0, middle, body.height - width]]
        self.radii[4] = width * 1.1  # a head is deeper than wide
        self._trunk[:4] -= self._trunk_heads[:, None]
        self._trunk[4] -= self._crown

    def at_rest(self) -> Placement:
        """Arms and legs a little away from the body, as in a relaxed stand with some room."""
        arm, leg = Arm(abduction=0.75, elbow=0.5), Leg(out=0.08)
        return self.place(Pose(left_arm=arm, right_arm=arm, left_leg=leg, right_leg=leg))

    def place(self, pose: Pose) -> Placement:
        """Pose the capsules (without the pose's offset, which moves all alike)."""
        upright = turned(0, 0, pose.turn)
        bend = pose.pelvis
        pelvis = upright @ rotation(bend.forward, bend.side, bend.turn)
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
        share = 1 / len(SPINE)
        bend = pose.spine
        step = rotation(share * bend.forward, share * bend.side, share * bend.turn)
        turn, place = pelvis, self._spine[0]
        for i in range(len(SPINE)):
            if i:
                place = place + turn @ (self._spine[i] - self._spine[i - 1])
            turn = turn @ step
            if i in (1, 3, 4):  # spine04, spine02, spine01
                part = (0, 1, 0, 2, 3)[i]
                segments[part] = place + self._trunk[part] @ turn.T
        chest, base = turn, place
        share = 1 / len(NECK)
        bend = pose.head
        step = rotation(share * bend.forward, share * bend.side, share * bend.turn)
        before = self._spine[-1]
        for head in self._neck:
            place = place + turn @ (head - before)
            turn, before = turn @ step, head
        segments[4] = place + self._trunk[4] @ turn.T
        return chest, base

    def _arm_points(self, arm: Arm) -> Points:
        """Shoulder, elbow, wrist and knuckles of a left arm against `spine01`."""
        chain = arm_chain(arm)
        upper = chain @ self.rest.upper_arm
        chain = chain @ turned(-arm.elbow, 0, 0)
        fore = chain @ self.rest.forearm
        hand = chain @ hand_chain(arm)
        points = np.empty((4, 3))
        points[0] = self._collar + collar_bone(upper, self.rest, arm.shrug) @ self._arm[0]
        points[1] = points[0] + upper @ self._arm[1]
        points[2] = points[1] + fore @ self._arm[2]
        points[3] = points[2] + hand @ (self.rest.hand @ self._arm[3])
        return points

    def _leg_points(self, leg: Leg) -> Points:
        """Hip, knee, ankle, heel and toes of a left leg against the hip."""
        chain = leg_chain(leg)
        points = np.empty((5, 3))
        points[0] = 0
        points[1] = (chain @ self.rest.leg) @ self._leg[0]
        chain = chain @ turned(leg.knee, 0, 0)
        points[2] = points[1] + (chain @ self.rest.leg) @ self._leg[1]
        points[3:] = points[2] + self._leg[2:] @ (chain @ foot_chain(leg)).T
        return points

    def contacts(self, placement: Placement) -> Contacts:
        """All tested pairs."""
        a, b = placement.starts, placement.ends - placement.starts
        s, t = _closest(a[FIRST], b[FIRST], a[SECOND], b[SECOND])
        near, far = a[FIRST] + s[:, None] * b[FIRST], a[SECOND] + t[:, None] * b[SECOND]
        between = near - far
        distance = np.sqrt(np.einsum("ij,ij->i", between, between))
        slope = self.radii[:, 1] - self.radii[:, 0]
        reach = self.radii[FIRST, 0] + s * slope[FIRST] + self.radii[SECOND, 0] + t * slope[SECOND]
        return Contacts(distance - reach, near, far, between / np.maximum(distance, 1e-6)[:, None])


@lru_cache(maxsize=1)
def _skin_parts(model: BodyModel) -> dict[str, np.ndarray]:
    """Which vertices belong to each of the left limbs, the trunk and the head, for every shape."""
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
    """A limb's radius near its start and near its end: what 70 % of the skin there lies within."""
    axis = end - start
    along = (skin - start) @ axis / (axis @ axis)
    distance = np.linalg.norm(skin - start - along[:, None] * axis, axis=1)
    near, far = distance[(along > 0) & (along < 0.4)], distance[(along > 0.6) & (along < 1)]
    return _exceeded_by_30_percent(near), _exceeded_by_30_percent(far)


def _exceeded_by_30_percent(values: Numbers) -> float:
    place = int(0.7 * (len(values) - 1))
    return float(np.partition(values, place)[place])  # ten times as quick as np.quantile


def _slab(skin: Points, height: float) -> tuple[np.ndarray, float]:
    """A segment from side to side, and its radius, that fill a slice of the torso."""
    front, back = skin[:, 1].min(), skin[:, 1].max()
    radius = (back - front) / 2
    half = max(np.quantile(np.abs(skin[:, 0]), 0.98) - radius, 0.01)
    middle = (front + back) / 2
    return np.array([[half, middle, height], [-half, middle, height]]), float(radius)


def _closest(p: Points, d: Points, q: Points, e: Points) -> tuple[Numbers, Numbers]:
    """Where along segments p + s d and q + t e they are closest, s and t in [0, 1].

    Source: Ericson, Real-Time Collision Detection (2005), Sec. 5.1.9.
    """
    r = p - q
    dd, ee, de = (np.einsum("ij,ij->i", x, y) for x, y in ((d, d), (e, e), (d, e)))
    dr, er = np.einsum("ij,ij->i", d, r), np.einsum("ij,ij->i", e, r)
    s = np.clip((de * er - dr * ee) / np.maximum(dd * ee - de * de, 1e-9), 0, 1)
    t = np.clip((de * s + er) / ee, 0, 1)
    return np.clip((de * t - dr) / dd, 0, 1), t
