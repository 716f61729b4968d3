"""Sewing patterns: the parts of the skin that close garments are made over, cut and laid flat.

What depends on the topology alone is worked out here, once a process: the sub-mesh, operators that
smooth it, flat panels, and maps that tell for each texel of a panel where on the body it lies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float32
from scipy.sparse import csr_array, diags_array, eye_array

from motion_transfer.people.clothes import flattening as flat
from motion_transfer.people.clothes.cuts import Places
from motion_transfer.people.clothes.surface import BodySurface, Limb, across_arm, along_polyline
from motion_transfer.people.figure.body import Faces, Points, SkinWeights

TEXELS_PER_METRE = 230.0
"""Of panels: 4 mm a texel, which is a pixel of a person some 420 pixels high."""

_FRONT_TO_BACK = -0.02  # y of the seam on the shoulders and at the sides


@dataclass(frozen=True)
class Pattern:
    """One kind of close garment, uncut.

    Attributes:
        kind: "top" or "bottom".
        index: Its vertices' numbers on the body.
        home: Its vertices on the template.
        charts: The panels, in metres.
        texels, vertices: Where on the body texels (H x W) and vertices lie.
        seam: How far inside its panel each texel lies, metres; 0 outside.
        smoother: V x V, one round of smoothing (half-way to the neighbours' mean).
        sums: V x F, sums triangles' normals.
        readers: Read the tables of tubes: "trunk" at all vertices, "arm.L" and so on at `limbs`.
        limbs: Numbers (in the pattern) of the vertices on each limb.
        shares: How much each of those vertices hangs from the tube, 0..1.
        loose: V, how much slow folds show, 0..1: less where another garment may lie over it.
        trunk_columns: The texels' columns that the first panel takes (a top's trunk).
    """

    kind: str
    index: np.ndarray
    faces: Faces
    home: Points
    weights: SkinWeights
    charts: flat.Charts
    texels: Places
    vertices: Places
    seam: Float32[np.ndarray, "H W"]
    smoother: csr_array
    sums: csr_array
    readers: dict[str, csr_array]
    limbs: dict[str, np.ndarray]
    shares: dict[str, np.ndarray]
    loose: np.ndarray
    trunk_columns: int


def _pattern(
    kind: str, surface: BodySurface, inside: np.ndarray, down: np.ndarray, is_cut: flat.IsCut
) -> Pattern:
    """Cut the sub-mesh out and lay it flat.

    Args:
        inside: V of the body; a triangle belongs to the pattern with all of its corners.
        down: F x 3 of the body, where the cloth's grain runs.
        is_cut: Takes numbers of the body's triangles.
    """
    faces = surface.model.faces
    own = np.nonzero(inside[faces].all(1))[0]
    index = np.unique(faces[own])
    renumber = np.full(len(inside), -1, np.int32)
    renumber[index] = np.arange(len(index), dtype=np.int32)
    local = renumber[faces[own]]
    points = surface.model.template.points[index]
    charts = flat.unfold(points, local, down[own], lambda a, b: is_cut(own[a], own[b]))
    vertices = surface.places.part(index)
    first = charts.corner_uv[charts.chart == charts.chart[0]]
    maps, seam = flat.flat_map(charts, np.stack(vertices, 1), local, TEXELS_PER_METRE)
    readers, limbs, shares = _hangers(kind, surface, index)
    links = surface.mesh[index][:, index]
    degree = np.asarray(links.sum(1)).ravel()
    means = diags_array(1 / np.maximum(degree, 1e-6)) @ links
    if kind == "bottom":  # close where another garment may lie over it: on hips, on shoulders
        loose = _ramp(surface.leg_along[index], 0.1, 0.3)
    else:
        loose = 0.4 + 0.6 * _ramp(surface.levels.armpit - surface.z[index], -0.05, 0.1)
    return Pattern(
        kind=kind,
        index=index,
        faces=local,
        home=points,
        weights=surface.model.weights.rows(index),
        charts=charts,
        texels=Places(*np.ascontiguousarray(np.moveaxis(maps, -1, 0))),
        vertices=vertices,
        seam=seam,
        smoother=csr_array((means + eye_array(len(index))) / 2, dtype=np.float32),
        sums=flat.corner_sums(local, len(index)),
        readers=readers,
        limbs=limbs,
        shares=shares,
        loose=loose,
        # half the gap between charts more, so that the seam's allowance is the trunk's
        trunk_columns=int((first[..., 0].max() + flat.GAP_METRES / 2) * TEXELS_PER_METRE),
    )


def _ramp(values: np.ndarray, start: float, end: float) -> np.ndarray:
    """Rise smoothly from 0 at `start` to 1 at `end`."""
    t = np.clip((values - start) / (end - start), 0, 1)
    return (t * t * (3 - 2 * t)).astype(np.float32)


def _hangers(
    kind: str, surface: BodySurface, index: np.ndarray
) -> tuple[dict[str, csr_array], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Find what hangs from which tube: a pattern's `readers`, `limbs` and `shares`."""
    readers = {"trunk": surface.torso_tube.reader(index)}
    arms = surface.on_arm[index]
    down = surface.levels.armpit - surface.z[index]
    shares = {"trunk": np.where(arms, 0, _ramp(down, -0.01, 0.07)).astype(np.float32)}
    limbs = {}
    if kind == "top":
        limb, along, start, on_limb = "arm", surface.arm_along, 0.05, arms
    else:
        limb, along, start = "leg", surface.leg_along, 0.08
        on_limb = surface.z[index] < surface.levels.crotch + 0.08
    for side, sign in (("L", 1), ("R", -1)):
        name = f"{limb}.{side}"
        own = limbs[name] = np.nonzero(on_limb & (sign * surface.x[index] > 0))[0]
        shares[name] = _ramp(along[index][own], start, start + 0.1)
        readers[name] = surface.limb_tubes[name].reader(index[own])
    return readers, limbs, shares


@cache
def top_pattern(surface: BodySurface) -> Pattern:
    """Make the pattern of tops: trunk, neck and arms, from the crotch to the chin and wrists."""
    inside = surface.is_limb(Limb.TORSO, Limb.ARM_L, Limb.ARM_R, Limb.NECK)
    inside |= surface.is_limb(Limb.LEG_L, Limb.LEG_R) & (surface.z > surface.levels.crotch - 0.01)
    wrist = surface.levels.arm + 0.03
    inside |= surface.is_limb(Limb.HAND_L, Limb.HAND_R) & (surface.arm_along < wrist)
    inside |= (surface.limb == Limb.HEAD) & (surface.below_neck > -0.085)
    faces = surface.model.faces
    x, y, z = surface.model.template.points[faces].mean(1).T
    arm = surface.on_arm[faces].mean(1) > 0.5
    front = y < _FRONT_TO_BACK
    # on the shoulders the grain runs away from the seam, to the front and to the back
    lean = 0.6 * np.clip((z - surface.levels.armpit - 0.05) / 0.08, 0, 1)
    down = np.stack([0 * x, np.where(front, -lean, lean), -np.ones_like(x)], 1)
    joints = surface.limb_joints(surface.model.template, "arm", "L")
    upper, lower = np.diff(joints, axis=0)
    long = np.linalg.norm(upper)
    # along the arms the bend at the elbow is rounded
    bent = np.clip((surface.arm_along[faces].mean(1) - long + 0.05) / 0.1, 0, 1)[:, None]
    along = upper / long * (1 - bent) + lower / np.linalg.norm(lower) * bent
    mirrored = np.where(surface.x[faces].mean(1)[:, None] < 0, [-1, 1, 1], 1)
    down = np.where(arm[:, None], along * mirrored, down)
    underarm = _underarm(surface)

    def is_cut(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        armhole = arm[a] != arm[b]
        # the left side is left whole below the armpit: front and back are one panel
        sides = (front[a] != front[b]) & ~arm[a] & ((x[a] < 0) | (z[a] > surface.levels.armpit))
        under = (underarm[a] * underarm[b] == -1) & arm[a]
        return armhole | sides | under

    return _pattern("top", surface, inside, down, is_cut)


def _underarm(surface: BodySurface) -> np.ndarray:
    """Number triangles 1 or -1 on either side of the seam under the arm, 2 away from it."""
    centre = surface.model.template.points[surface.model.faces].mean(1)
    out = np.full(len(centre), 2)
    for side, sign in (("L", 1), ("R", -1)):
        joints = surface.limb_joints(surface.model.template, "arm", side)
        _, axis = along_polyline(centre, joints)
        away = centre - axis
        own = (sign * centre[:, 0] > 0) & (across_arm(away, sign) < 0)
        out[own] = np.where(away[own, 1] < 0, 1, -1)
    return out


@cache
def bottom_pattern(surface: BodySurface) -> Pattern:
    """Make the pattern of trousers: hips and legs, from a hand above the waist to the ankles."""
    end = surface.levels.leg + 0.015
    inside = surface.is_limb(Limb.TORSO, Limb.LEG_L, Limb.LEG_R) & (
        surface.z < surface.levels.waist + 0.1
    )
    inside |= surface.is_limb(Limb.FOOT_L, Limb.FOOT_R) & (surface.leg_along < end)
    faces = surface.model.faces
    centre = surface.model.template.points[faces].mean(1)
    x, y, z = centre.T
    left = x > 0
    down = np.zeros((len(faces), 3))
    inner = np.zeros(len(faces), bool)
    front = np.zeros(len(faces), bool)
    for side, sign in (("L", 1), ("R", -1)):
        joints = surface.limb_joints(surface.model.template, "leg", side)
        _, axis = along_polyline(centre, joints)
        own = left == (sign > 0)
        leg = (joints[2] - joints[0]) / np.linalg.norm(joints[2] - joints[0])
        # on the hips straight down, along the legs from 10 cm below the crotch
        share = np.clip((surface.levels.crotch + 0.1 - z[own]) / 0.2, 0, 1)[:, None]
        down[own] = share * leg + (1 - share) * np.array([0, 0, -1])
        inner[own] = (sign * (x - axis[:, 0]) < 0)[own]
        front[own] = (y < axis[:, 1])[own]

    def is_cut(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        middle = left[a] != left[b]
        inseam = (front[a] != front[b]) & inner[a] & (z[a] < surface.levels.crotch + 0.03)
        return middle | inseam

    return _pattern("bottom", surface, inside, down, is_cut)
