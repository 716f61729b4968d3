"""Where things are on the body's skin: limbs, lengths along them, heights, the neck's base.

Everything is measured once, on the template, and holds for every shape because all bodies share
one topology: a field's value names an anatomical place. Garments are cut by such fields.

Convention: as in `body.py` (metres, z up, the person faces -y, left hand at +x). Fields are float32
arrays over the skin's vertices, in metres on the template unless said otherwise.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cached_property

import numpy as np
from jaxtyping import Float32, Int8
from scipy.sparse import csr_array, diags_array

from motion_transfer.people.clothes.cuts import Levels, Places
from motion_transfer.people.clothes.flattening import corner_sums, vertex_normals
from motion_transfer.people.clothes.tubes import Tube
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
    return Limb.HEAD


def along_polyline(points: Points, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far along a bent limb points lie, and the nearest place on its axis.

    Args:
        joints: 3 x 3: where the limb begins, bends and ends; it is prolonged beyond both ends.

    Returns: lengths V in metres from the first joint (negative before it), and V x 3.
    """
    first, bend, last = joints
    upper, lower = bend - first, last - bend
    long = float(np.linalg.norm(upper))
    s_upper = (points - first) @ (upper / long)
    s_lower = (points - bend) @ (lower / np.linalg.norm(lower))
    s = np.minimum(s_upper, long) + np.maximum(s_lower, 0)
    above = first + np.minimum(s, long)[:, None] * (upper / long)
    axis = above + np.maximum(s - long, 0)[:, None] * (lower / np.linalg.norm(lower))
    return s.astype(np.float32), axis.astype(np.float32)


class BodySurface:
    """Fields over the skin of all bodies.

    Attributes:
        model: whose skin.
        limb: V; the Limb of each vertex.
        x, y, z: of the template's vertices.
        sums: V x F, adds triangles' normals at their vertices.
        mesh: V x V, gives each vertex the mean of its neighbours.
        arm_along: from the shoulder joint down the arm; -1 away from the arms and chest.
        leg_along: from the hip joint down the leg, on hips, legs and feet; -1 elsewhere.
        below_neck: how far below the ring around the neck's base; negative on neck and head.
        crotch, waist, armpit: heights on the template.
    """

    def __init__(self, model: BodyModel) -> None:
        self.model = model
        body = model.template
        self.x, self.y, self.z = np.ascontiguousarray(body.points.T)
        self.limb = self._limbs()
        self.sums = corner_sums(model.faces, len(body.points))
        self.mesh = _neighbour_means(len(body.points), model.faces)
        middle = np.abs(self.x) < 0.004
        torso = self.limb == Limb.TORSO
        self.crotch = float(self.z[middle & torso & (self.z > 0.7)].min())
        self.waist = float(body.joint("spine04")[2])
        self.armpit = self._armpit()
        self.arm_along = self._along("arm")
        self.leg_along = self._along("leg")
        aside = np.maximum(np.abs(self.x) - 0.06, 0)
        ring = body.joint("neck01")[2] + 0.02 + 0.7 * (self.y - 0.03) + 0.5 * aside
        self.below_neck = (ring - self.z).astype(np.float32)

    def is_limb(self, *limbs: Limb) -> np.ndarray:
        """Which vertices belong to any of some limbs."""
        return np.isin(self.limb, limbs)

    def _limbs(self) -> Int8[np.ndarray, " V"]:
        shares = self.model.weights.matrix.toarray()
        total = np.zeros((len(shares), len(Limb)), np.float32)
        for bone, name in enumerate(self.model.skeleton.names):
            total[:, _limb_of_bone(name)] += shares[:, bone]
        return total.argmax(1).astype(np.int8)

    def _armpit(self) -> float:
        inner = self.is_limb(Limb.ARM_L) & (self.x < 0.2)
        return float(self.z[inner].min())

    def _along(self, kind: str) -> Field:
        body = self.model.template
        where = self.is_limb(Limb.ARM_L, Limb.HAND_L, Limb.TORSO) & (self.z > self.armpit - 0.1)
        if kind == "leg":
            low = self.is_limb(Limb.TORSO) & (self.z < self.waist)
            where = low | self.is_limb(Limb.LEG_L, Limb.FOOT_L)
        where |= self.is_limb(Limb.ARM_L, Limb.HAND_L) if kind == "arm" else False
        mirrored = body.points * np.where(self.x[:, None] < 0, [-1, 1, 1], 1)
        right = self.limb[:, None] == np.array(
            [Limb.ARM_R, Limb.HAND_R] if kind == "arm" else [Limb.LEG_R, Limb.FOOT_R]
        )
        where |= right.any(1)
        s, _ = along_polyline(mirrored.astype(np.float32), self.limb_joints(body, kind, "L"))
        return np.where(where, s, -1).astype(np.float32)

    @staticmethod
    def limb_joints(body: Body, kind: str, side: str) -> np.ndarray:
        """The three joints of an arm or a leg, 3 x 3.

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
        """From the first joint of an arm or a leg to the last, along its bones, metres."""
        joints = self.limb_joints(body, kind, "L")
        return float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum())

    @cached_property
    def template_lengths(self) -> dict[str, float]:
        """Lengths of the template's "arm" and "leg"."""
        return {kind: self.limb_length(self.model.template, kind) for kind in ("arm", "leg")}

    @cached_property
    def places(self) -> Places:
        """All vertices of the skin, as garments' edges are worked out for them."""
        on_arm = self.is_limb(Limb.ARM_L, Limb.ARM_R, Limb.HAND_L, Limb.HAND_R)
        fields = (self.x, self.y, self.z, self.arm_along, self.leg_along, self.below_neck)
        return Places(*fields, on_arm.astype(np.float32))

    @cached_property
    def levels(self) -> Levels:
        """Heights and lengths that garments are cut by."""
        lengths = self.template_lengths
        return Levels(self.crotch, self.waist, self.armpit, lengths["arm"], lengths["leg"])

    @cached_property
    def torso_tube(self) -> Tube:
        """Around the trunk from the armpits (level 0) down past the crotch."""
        where = self.is_limb(Limb.TORSO, Limb.LEG_L, Limb.LEG_R)
        down = self.armpit - self.z
        inside = where & (down > -0.03) & (down < self.armpit - self.crotch + 0.06)
        centre_y = float(self.y[inside & (down < 0.2)].mean())
        normals = vertex_normals(self.model.template.points, self.model.faces)
        radial = np.stack([self.x, self.y - centre_y], 1)
        outward = (normals[:, :2] * radial).sum(1) > 0.4 * np.linalg.norm(radial, axis=1)
        inside &= outward | (down < 0.2)  # not the insides of the thighs
        angle = np.arctan2(self.x, -(self.y - centre_y))
        return Tube(
            down, angle, inside, levels=np.linspace(0, self.armpit - self.crotch + 0.04, 16)
        )

    @cached_property
    def neck_tube(self) -> Tube:
        """Around the neck: levels are `below_neck`."""
        inside = (self.below_neck > -0.09) & (self.below_neck < 0.11) & (np.abs(self.x) < 0.13)
        inside &= self.is_limb(Limb.TORSO, Limb.NECK) | ((self.limb == Limb.HEAD) & (self.y > -0.1))
        centre_y = float(self.model.template.joint("neck01")[1]) - 0.01
        angle = np.arctan2(self.x, -(self.y - centre_y))
        return Tube(self.below_neck, angle, inside, levels=np.linspace(-0.06, 0.09, 16))

    @cached_property
    def limb_tubes(self) -> dict[str, Tube]:
        """Around arms ("arm.L", ...) from 4 cm and legs ("leg.L", ...) from the crotch down."""
        out = {}
        body = self.model.template
        for kind, start in (("arm", 0.09), ("leg", 0.10)):
            along = self.arm_along if kind == "arm" else self.leg_along
            end = self.template_lengths[kind]
            for side, sign in (("L", 1), ("R", -1)):
                own = self.is_limb(*(part for part in Limb if part.name in _limb_names(kind, side)))
                inside = own & (along > start - 0.05) & (along < end + 0.04)
                _, axis = along_polyline(body.points, self.limb_joints(body, kind, side))
                away = body.points - axis
                angle = np.arctan2(sign * away[:, 0], -away[:, 1])
                if kind == "arm":  # across the arm, which hangs at 45 degrees
                    across = sign * away[:, 0] * 0.7 + away[:, 2] * 0.7
                    angle = np.arctan2(across, -away[:, 1])
                out[f"{kind}.{side}"] = Tube(along, angle, inside, np.linspace(start, end, 16))
        return out


def _limb_names(kind: str, side: str) -> tuple[str, str]:
    extremity = "HAND" if kind == "arm" else "FOOT"
    return f"{kind.upper()}_{side}", f"{extremity}_{side}"


def _neighbour_means(count: int, faces: np.ndarray) -> csr_array:
    """The operator that gives each vertex the mean of its neighbours, V x V."""
    start, end = faces[:, [0, 1, 2, 1, 2, 0]].ravel(), faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    links = csr_array((np.ones(len(start), np.float32), (start, end)), (count, count))
    links.data[:] = 1
    degree = np.maximum(np.asarray(links.sum(1)).ravel(), 1)
    return csr_array(diags_array(1 / degree, dtype=np.float32) @ links)
