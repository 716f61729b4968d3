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
from motion_transfer.people.clothes.surface import BodySurface, Limb, along_polyline
from motion_transfer.people.figure.body import Faces, Points, SkinWeights

TEXELS_PER_METRE = 230.0
_FRONT_TO_BACK = -0.02  # y of the seam on the shoulders and at the sides


@dataclass(frozen=True)
class Pattern:
    """One kind of close garment, uncut.

    Attributes:
        kind: "top" or "bottom".
        index: its vertices' numbers on the body.
        faces: of the sub-mesh.
        home: its vertices on the template.
        weights: of its vertices.
        charts: the panels, in metres.
        texels, vertices: where on the body texels (H x W) and vertices lie.
        seam: how far inside its panel each texel lies, metres; 0 outside.
        smoother: V x V, one round of smoothing (half-way to the neighbours' mean).
        sums: V x F, sums triangles' normals.
        on_arm: V, which vertices are a sleeve's.
        readers: read the tables of tubes: "trunk" at all vertices, "arm.L" and so on at `limbs`.
        limbs: numbers (in the pattern) of the vertices on each limb.
        shares: how much each of those vertices hangs from the tube, 0..1.
        loose: V, how much slow folds show, 0..1: less where another garment may lie over it.
        trunk_columns: the texels' columns that the first panel takes (a top's trunk).
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
    on_arm: np.ndarray
    readers: dict[str, csr_array]
    limbs: dict[str, np.ndarray]
    shares: dict[str, np.ndarray]
    loose: np.ndarray
    trunk_columns: int


def _smoother(surface: BodySurface, index: np.ndarray) -> csr_array:
    links = surface.mesh[index][:, index]
    degree = np.asarray(links.sum(1)).ravel()
    mean = diags_array(1 / np.maximum(degree, 1e-6)) @ links
    half = (mean + eye_array(len(index))) / 2
    return csr_array(half, dtype=np.float32)


def _pattern(
    kind: str, surface: BodySurface, inside: np.ndarray, down: np.ndarray, is_cut: flat.IsCut
) -> Pattern:
    """Args: inside: V of the body; down: F_body x 3; is_cut: numbers the body's triangles."""
    faces = surface.model.faces
    own = np.nonzero(inside[faces].all(1))[0]
    index = np.unique(faces[own])
    renumber = np.full(len(inside), -1, np.int32)
    renumber[index] = np.arange(len(index), dtype=np.int32)
    local = renumber[faces[own]]
    points = surface.model.template.points[index]
    charts = flat.unfold(points, local, down[own], lambda a, b: is_cut(own[a], own[b]))
    on_arm = surface.is_limb(Limb.ARM_L, Limb.ARM_R, Limb.HAND_L, Limb.HAND_R)[index]
    fields = [surface.x, surface.y, surface.z, surface.arm_along, surface.leg_along]
    fields.append(surface.below_neck)
    values = np.stack([field[index] for field in fields] + [on_arm.astype(np.float32)], 1)
    first = charts.corner_uv[charts.chart == charts.chart[0]]
    maps, seam = flat.flat_map(charts, values, local, TEXELS_PER_METRE)
    readers, limbs, shares = _hangers(kind, surface, index)
    columns = [np.ascontiguousarray(maps[..., k]) for k in range(maps.shape[2])]
    return Pattern(
        kind=kind,
        index=index,
        faces=local,
        home=points,
        weights=surface.model.weights.rows(index),
        charts=charts,
        texels=Places(*columns),
        vertices=Places(*(np.ascontiguousarray(column) for column in values.T)),
        seam=seam,
        smoother=_smoother(surface, index),
        sums=flat.corner_sums(local, len(index)),
        on_arm=on_arm,
        readers=readers,
        limbs=limbs,
        shares=shares,
        loose=_loose(kind, surface, index),
        trunk_columns=int((first[..., 0].max() + 0.006) * TEXELS_PER_METRE),
    )


def _ramp(values: np.ndarray, start: float, end: float) -> np.ndarray:
    t = np.clip((values - start) / (end - start), 0, 1)
    return (t * t * (3 - 2 * t)).astype(np.float32)


def _loose(kind: str, surface: BodySurface, index: np.ndarray) -> np.ndarray:
    if kind == "bottom":
        return _ramp(surface.leg_along[index], 0.1, 0.3)
    return 0.4 + 0.6 * _ramp(surface.armpit - surface.z[index], -0.05, 0.1)


def _hangers(
    kind: str, surface: BodySurface, index: np.ndarray
) -> tuple[dict[str, csr_array], dict[str, np.ndarray], dict[str, np.ndarray]]:
    readers = {"trunk": surface.torso_tube.reader(index)}
    arms = surface.is_limb(Limb.ARM_L, Limb.ARM_R, Limb.HAND_L, Limb.HAND_R)[index]
    down = surface.armpit - surface.z[index]
    shares = {"trunk": np.where(arms, 0, _ramp(down, -0.01, 0.07)).astype(np.float32)}
    limbs = {}
    along, start = (surface.arm_along, 0.05) if kind == "top" else (surface.leg_along, 0.08)
    for side, sign in (("L", 1), ("R", -1)):
        name = f"{'arm' if kind == 'top' else 'leg'}.{side}"
        on_limb = arms if kind == "top" else surface.z[index] < surface.crotch + 0.08
        own = np.nonzero(on_limb & (sign * surface.x[index] > 0))[0]
        limbs[name] = own
        shares[name] = _ramp(along[index][own], start, start + 0.1)
        readers[name] = surface.limb_tubes[name].reader(index[own])
    return readers, limbs, shares


@cache
def top_pattern(surface: BodySurface) -> Pattern:
    """Trunk, neck and arms, from the crotch to the chin and the wrists."""
    inside = surface.is_limb(Limb.TORSO, Limb.ARM_L, Limb.ARM_R, Limb.NECK)
    inside |= surface.is_limb(Limb.LEG_L, Limb.LEG_R) & (surface.z > surface.crotch - 0.01)
    wrist = surface.template_lengths["arm"] + 0.03
    inside |= surface.is_limb(Limb.HAND_L, Limb.HAND_R) & (surface.arm_along < wrist)
    inside |= (surface.limb == Limb.HEAD) & (surface.below_neck > -0.085)
    faces = surface.model.faces
    x, y, z = surface.model.template.points[faces].mean(1).T
    arm = surface.is_limb(Limb.ARM_L, Limb.ARM_R, Limb.HAND_L, Limb.HAND_R)[faces].mean(1) > 0.5
    lower = _arm_directions(surface)
    front = y < _FRONT_TO_BACK
    # on the shoulders the grain runs away from the seam, to the front and to the back
    lean = 0.6 * np.clip((z - surface.armpit - 0.05) / 0.08, 0, 1)
    down = np.stack([0 * x, np.where(front, -lean, lean), -np.ones_like(x)], 1)
    down = np.where(arm[:, None], lower, down)
    underarm = _underarm(surface, faces)

    def is_cut(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        armhole = arm[a] != arm[b]
        sides = (front[a] != front[b]) & ~arm[a] & ((x[a] < 0) | (z[a] > surface.armpit))
        under = (underarm[a] * underarm[b] == -1) & arm[a]
        return armhole | sides | under

    return _pattern("top", surface, inside, down, is_cut)


def _arm_directions(surface: BodySurface) -> np.ndarray:
    """Where arms run, F x 3; the bend at the elbow is rounded."""
    faces, body = surface.model.faces, surface.model.template
    s = surface.arm_along[faces].mean(1)
    x = surface.x[faces].mean(1)
    joints = surface.limb_joints(body, "arm", "L")
    upper, lower = joints[1] - joints[0], joints[2] - joints[1]
    long = np.linalg.norm(upper)
    share = np.clip((s - long + 0.05) / 0.1, 0, 1)[:, None]
    out = upper / long * (1 - share) + lower / np.linalg.norm(lower) * share
    return out * np.where(x[:, None] < 0, [-1, 1, 1], 1)


def _underarm(surface: BodySurface, faces: Faces) -> np.ndarray:
    """1 or -1 on either side of the seam under the arm, 2 away from it; per triangle."""
    points = surface.model.template.points
    out = np.full(len(faces), 2)
    centre = points[faces].mean(1)
    for side, sign in (("L", 1), ("R", -1)):
        joints = surface.limb_joints(surface.model.template, "arm", side)
        _, axis = along_polyline(centre, joints)
        away = centre - axis
        across = sign * away[:, 0] * 0.7 + away[:, 2] * 0.7
        own = (sign * centre[:, 0] > 0) & (across < 0)
        out[own] = np.where(away[own, 1] < 0, 1, -1)
    return out


@cache
def bottom_pattern(surface: BodySurface) -> Pattern:
    """Hips and legs, from a hand above the waist to the ankles."""
    end = surface.template_lengths["leg"] + 0.015
    inside = surface.is_limb(Limb.TORSO, Limb.LEG_L, Limb.LEG_R) & (surface.z < surface.waist + 0.1)
    inside |= surface.is_limb(Limb.FOOT_L, Limb.FOOT_R) & (surface.leg_along < end)
    faces = surface.model.faces
    x, y, z = surface.model.template.points[faces].mean(1).T
    left = x > 0
    down = np.zeros((len(faces), 3))
    inner = np.zeros(len(faces), bool)
    front = np.zeros(len(faces), bool)
    for side, sign in (("L", 1), ("R", -1)):
        joints = surface.limb_joints(surface.model.template, "leg", side)
        centre = surface.model.template.points[faces].mean(1)
        _, axis = along_polyline(centre, joints)
        own = left == (sign > 0)
        leg = (joints[2] - joints[0]) / np.linalg.norm(joints[2] - joints[0])
        share = np.clip((surface.crotch + 0.1 - z[own]) / 0.2, 0, 1)[:, None]
        down[own] = share * leg + (1 - share) * np.array([0, 0, -1])
        inner[own] = (sign * (x - axis[:, 0]) < 0)[own]
        front[own] = (y < axis[:, 1])[own]

    def is_cut(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        middle = left[a] != left[b]
        inseam = (front[a] != front[b]) & inner[a] & (z[a] < surface.crotch + 0.03)
        return middle | inseam

    return _pattern("bottom", surface, inside, down, is_cut)
