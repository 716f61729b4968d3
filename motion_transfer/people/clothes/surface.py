"""Where things are on the body's skin: limbs, lengths along them, heights, the neck's base.

Everything is measured once, on the template, and holds for every shape because all bodies share
one topology: a field's value names an anatomical place. Garments are cut by such fields.

Convention: that of `body.py` (metres, z up, the person faces -y, left hand at +x). Fields are
float32 arrays over the skin's vertices, in metres on the template unless said otherwise. Numbers
that name places were read off the template.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cached_property

import numpy as np
from jaxtyping import Float32, Int8
from scipy.sparse import csr_array, diags_array

from motion_transfer.people.clothes.cuts import Levels, Places
from motion_transfer.people.clothes.flattening import Tube, vertex_normals
from motion_transfer.people.figure.body import Body, BodyModel, Points

Field = Float32[np.ndarray, " V"]


class Limb(IntEnum):
    """Parts of the skin, by the bones that move them most."""

    TORSO = 0
    HEAD = 1
    NECK = 2
    ARM_L = 3
    ARM_R = 4
    HAND_L = 5
    HAND_R = 6
    LEG_L = 7
    LEG_R = 8
    FOOT_L = 9
    FOOT_R = 10


_ARMS = (Limb.ARM_L, Limb.ARM_R, Limb.HAND_L, Limb.HAND_R)
_LEGS = (Limb.LEG_L, Limb.LEG_R, Limb.FOOT_L, Limb.FOOT_R)
_TORSO = ("spine", "shoulder", "clavicle", "pelvis", "root", "breast")
_SIDED = (
    ("upperarm", "lowerarm", Limb.ARM_L),
    ("wrist", "metacarpal", Limb.HAND_L),
    ("finger", "finger", Limb.HAND_L),
    ("upperleg", "lowerleg", Limb.LEG_L),
    ("foot", "toe", Limb.FOOT_L),
)


def _limb_of_bone(name: str) -> Limb:
    if name.startswith(_TORSO):
        return Limb.TORSO
    if name.startswith("neck"):
        return Limb.NECK
    for first, second, limb in _SIDED:
        if name.startswith((first, second)):
            return Limb(limb + 1) if name.endswith(".R") else limb
    return Limb.HEAD  # its bones have many names: of eyes, jaw, tongue, ...


def along_polyline(points: Points, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measure how far along a bent limb points lie, and find the nearest place on its axis.

    Args:
        joints: Where the limb begins, bends and ends, 3 x 3; it is prolonged beyond both ends.
    Returns: Lengths V in metres from the first joint (negative before it), and V x 3.
    """
    first, bend, last = joints
    upper, lower = bend - first, last - bend
    long = float(np.linalg.norm(upper))
    upper, lower = upper / long, lower / np.linalg.norm(lower)
    s = np.minimum((points - first) @ upper, long) + np.maximum((points - bend) @ lower, 0)
    axis = first + np.minimum(s, long)[:, None] * upper + np.maximum(s - long, 0)[:, None] * lower
    return s.astype(np.float32), axis.astype(np.float32)


def across_arm(away: np.ndarray, sign: int) -> np.ndarray:
    """Measure how far above its axis places on an arm lie, which hangs at 45 degrees at rest.

    Args:
        away: From the axis to the places, N x 3.
        sign: 1 for the left arm, -1 for the right one.
    """
    return sign * away[:, 0] * 0.7 + away[:, 2] * 0.7


class BodySurface:
    """Fields over the skin of all bodies.

    Attributes:
        model: The one whose skin it is.
        limb: The Limb of each vertex, V.
        on_arm: V; whether a vertex is an arm's or a hand's.
        x, y, z: Of the template's vertices.
        mesh: V x V, gives each vertex the mean of its neighbours.
        arm_along: From the shoulder joint down the arm; -1 away from the arms and chest.
        leg_along: From the hip joint down the leg, on hips, legs and feet; -1 elsewhere.
        below_neck: How far below the ring around the neck's base; negative on neck and head.
        places: All vertices, for which garments' edges are worked out by `levels`.
    """

    def __init__(self, model: BodyModel) -> None:
        self.model = model
        body = model.template
        self.x, self.y, self.z = np.ascontiguousarray(body.points.T)
        shares = model.weights.matrix.toarray()
        total = np.zeros((len(shares), len(Limb)), np.float32)
        for bone, name in enumerate(model.skeleton.names):
            total[:, _limb_of_bone(name)] += shares[:, bone]
        self.limb: Int8[np.ndarray, " V"] = total.argmax(1).astype(np.int8)
        self.on_arm = self.is_limb(*_ARMS)
        start, end = model.faces[:, [0, 1, 2, 1, 2, 0]], model.faces[:, [1, 2, 0, 0, 1, 2]]
        ones, size = np.ones(start.size, np.float32), (len(body.points),) * 2
        links = csr_array((ones, (start.ravel(), end.ravel())), size)
        links.data[:] = 1
        degree = np.maximum(np.asarray(links.sum(1)).ravel(), 1)
        self.mesh = csr_array(diags_array(1 / degree, dtype=np.float32) @ links)
        middle = (np.abs(self.x) < 0.004) & (self.limb == Limb.TORSO)
        self.levels = Levels(
            crotch=float(self.z[middle & (self.z > 0.7)].min()),
            waist=float(body.joint("spine04")[2]),
            armpit=float(self.z[self.is_limb(Limb.ARM_L) & (self.x < 0.2)].min()),
            arm=self.limb_length(body, "arm"),
            leg=self.limb_length(body, "leg"),
        )
        self.arm_along = self._along("arm")
        self.leg_along = self._along("leg")
        # the neck's base: higher behind than in front, and higher at the sides
        aside = np.maximum(np.abs(self.x) - 0.06, 0)
        ring = body.joint("neck01")[2] + 0.02 + 0.7 * (self.y - 0.03) + 0.5 * aside
        self.below_neck = (ring - self.z).astype(np.float32)
        fields = (self.x, self.y, self.z, self.arm_along, self.leg_along, self.below_neck)
        self.places = Places(*fields, self.on_arm.astype(np.float32))

    def is_limb(self, *limbs: Limb) -> np.ndarray:
        """Tell which vertices belong to any of some limbs."""
        return np.isin(self.limb, limbs)

    def _along(self, kind: str) -> Field:
        body = self.model.template
        near = self.z > self.levels.armpit - 0.1 if kind == "arm" else self.z < self.levels.waist
        where = self.is_limb(*_ARMS if kind == "arm" else _LEGS) | (self.limb == Limb.TORSO) & near
        mirrored = body.points * np.where(self.x[:, None] < 0, [-1, 1, 1], 1)
        s, _ = along_polyline(mirrored.astype(np.float32), self.limb_joints(body, kind, "L"))
        return np.where(where, s, -1).astype(np.float32)

    @staticmethod
    def limb_joints(body: Body, kind: str, side: str) -> np.ndarray:
        """Take the three joints of an arm or a leg, 3 x 3.

        Args:
            kind: "arm" or "leg".
            side: "L" or "R".
        """
        names = {
            "arm": ("upperarm01", "lowerarm01", "wrist"),
            "leg": ("upperleg01", "lowerleg01", "foot"),
        }[kind]
        return np.stack([body.joint(f"{name}.{side}") for name in names])

    def limb_length(self, body: Body, kind: str) -> float:
        """Measure an arm or a leg along its bones, from the first joint to the last, metres."""
        joints = self.limb_joints(body, kind, "L")
        return float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum())

    @cached_property
    def torso_tube(self) -> Tube:
        """The tube around the trunk, from the armpits (level 0) down past the crotch."""
        where = self.is_limb(Limb.TORSO, Limb.LEG_L, Limb.LEG_R)
        down = self.levels.armpit - self.z
        inside = where & (down > -0.03) & (down < self.levels.armpit - self.levels.crotch + 0.06)
        centre_y = float(self.y[inside & (down < 0.2)].mean())
        normals = vertex_normals(self.model.template.points, self.model.faces)
        radial = np.stack([self.x, self.y - centre_y], 1)
        outward = (normals[:, :2] * radial).sum(1) > 0.4 * np.linalg.norm(radial, axis=1)
        inside &= outward | (down < 0.2)  # not the insides of the thighs
        angle = np.arctan2(self.x, -(self.y - centre_y))
        return Tube(
            down, angle, inside, np.linspace(0, self.levels.armpit - self.levels.crotch + 0.04, 16)
        )

    @cached_property
    def neck_tube(self) -> Tube:
        """The tube around the neck; its levels are `below_neck`."""
        inside = (self.below_neck > -0.09) & (self.below_neck < 0.11) & (np.abs(self.x) < 0.13)
        inside &= self.is_limb(Limb.TORSO, Limb.NECK) | ((self.limb == Limb.HEAD) & (self.y > -0.1))
        centre_y = float(self.model.template.joint("neck01")[1]) - 0.01
        angle = np.arctan2(self.x, -(self.y - centre_y))
        return Tube(self.below_neck, angle, inside, np.linspace(-0.06, 0.09, 16))

    @cached_property
    def limb_tubes(self) -> dict[str, Tube]:
        """Tubes around arms ("arm.L", ...) and legs ("leg.L", ...), from 10 cm below the joint."""
        out = {}
        body = self.model.template
        for kind, extremity, along, start, end in (
            ("arm", "HAND", self.arm_along, 0.09, self.levels.arm),
            ("leg", "FOOT", self.leg_along, 0.10, self.levels.leg),
        ):
            for side, sign in (("L", 1), ("R", -1)):
                own = self.is_limb(Limb[f"{kind.upper()}_{side}"], Limb[f"{extremity}_{side}"])
                inside = own & (along > start - 0.05) & (along < end + 0.04)
                _, axis = along_polyline(body.points, self.limb_joints(body, kind, side))
                away = body.points - axis
                outwards = across_arm(away, sign) if kind == "arm" else sign * away[:, 0]
                angle = np.arctan2(outwards, -away[:, 1])
                out[f"{kind}.{side}"] = Tube(along, angle, inside, np.linspace(start, end, 16))
        return out
