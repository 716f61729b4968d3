"""Skirts, and the lower parts of dresses, coats and tunics: tubes of their own that hang.

A skirt is a grid of rows (down) and columns (around). At rest it stands off hips and spread legs;
posed, it follows pelvis and thighs, and is then pushed out of the legs and drawn taut over them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float32
from scipy.sparse import csr_array

from motion_transfer.people.clothes.cuts import ramp
from motion_transfer.people.clothes.fit import Fitting
from motion_transfer.people.clothes.surface import BodySurface
from motion_transfer.people.clothes.wardrobe import Skirt
from motion_transfer.people.figure.body import Faces, Points, SkinWeights
from motion_transfer.people.figure.mesh import PosedBody

COLUMNS = 48
ROWS = 26
_CLEARANCE = 0.012  # metres between legs and cloth
_RINGS = (0, 3, 6, 9, 12, 15)  # rows of a leg's table that bound the cones standing for the leg
Grid = Float32[np.ndarray, "rows columns"]


@dataclass(frozen=True)
class SkirtShape:
    """A skirt at rest.

    Attributes:
        points: ROWS * COLUMNS x 3, row by row from the top.
        outward: unit vectors away from the axis, the same order.
        weights: how the bones move them.
        down: ROWS, metres along the cloth from the upper edge.
        around: mean circumference, metres.
    """

    points: Points
    outward: Points
    weights: SkinWeights
    down: Float32[np.ndarray, " rows"]
    around: float


@cache
def grid_faces(rows: int, columns: int) -> Faces:
    """Triangles of a tube seen from outside; column 0 closes on the last one."""
    r, c = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a, b = r * columns + c, r * columns + (c + 1) % columns
    below_a, below_b = a + columns, b + columns
    upper, lower = np.stack([a, below_b, b], -1), np.stack([a, below_a, below_b], -1)
    return np.stack([upper, lower], 2).reshape(-1, 3).astype(np.int32)


@cache
def grid_uv(rows: int, columns: int) -> np.ndarray:
    """Texture coordinates of `grid_faces`: u once around, v from top to bottom; F x 3 x 2."""
    r, c = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    u0, u1 = c / columns, (c + 1) / columns
    v0, v1 = r / (rows - 1), (r + 1) / (rows - 1)

    def corner(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.stack([u, v], -1)

    upper = np.stack([corner(u0, v0), corner(u1, v1), corner(u1, v0)], 2)
    lower = np.stack([corner(u0, v0), corner(u0, v1), corner(u1, v1)], 2)
    return np.stack([upper, lower], 2).reshape(-1, 3, 2).astype(np.float32)


def shape_skirt(
    skirt: Skirt, fitting: Fitting, ease: float = 0.0, flare_below: float = 9.0
) -> SkirtShape:
    """Cut a skirt to a body's measure.

    Args:
        ease: of what is worn below it at the upper edge, metres.
        flare_below: height on the template below which it may stand off, metres.
    """
    body = fitting.body
    scale = body.height / fitting.surface.model.template.height
    axis = fitting.trunk[2]
    hip = float(body.joint("upperleg01.L")[2]) - 0.07 * scale
    top = float(body.joint("spine04")[2]) + skirt.top * scale
    ankle = float(body.joint("foot.L")[2])
    hip_joint = float(body.joint("upperleg01.L")[2])
    hem = hip_joint - skirt.length * (hip_joint - ankle)
    angles = np.arange(COLUMNS, dtype=np.float32) * np.float32(2 * np.pi / COLUMNS)
    z = np.linspace(top, hem, ROWS, dtype=np.float32)
    reach = np.maximum(_trunk_reach(fitting, z, angles), _legs_reach(fitting, z, angles))
    snug = _hull_radii(reach) + np.float32(skirt.ease + ease)
    near_top = ramp(top - z, 0.0, 0.08)[:, None]  # snug at the waistband
    snug = snug - np.float32(skirt.ease * 0.3) * (1 - near_top)
    radius = _flared(skirt, snug, z, hip, angles, flare_below * scale)
    x, y = radius * np.sin(angles), axis - radius * np.cos(angles)
    points = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], -1).reshape(-1, 3)
    outward = np.stack([np.sin(angles), -np.cos(angles), 0 * angles], -1)
    outward = np.broadcast_to(outward, (ROWS, COLUMNS, 3)).reshape(-1, 3)
    steps = np.hypot(np.diff(z), np.diff(radius.mean(1)))
    return SkirtShape(
        points=points.astype(np.float32),
        outward=outward.astype(np.float32),
        weights=_weights(fitting, z, x, radius, hip),
        down=np.concatenate([[0], np.cumsum(steps)]).astype(np.float32),
        around=float(2 * np.pi * radius[ROWS // 3 :].mean()),
    )


def _reach(cells: np.ndarray, z: np.ndarray, angles: np.ndarray, axis: float) -> Grid:
    """How far a tube's rings reach from the skirt's axis in each direction, 0 off its ends."""
    across = cells[..., :1] * np.sin(angles) - (cells[..., 1:2] - axis) * np.cos(angles)
    across = across.max(1)
    heights = cells[..., 2].mean(1)
    at = np.interp(-z, -heights, np.arange(len(heights)))
    low = np.minimum(at.astype(int), len(heights) - 2)
    share = (at - low)[:, None]
    out = across[low] * (1 - share) + across[low + 1] * share
    beyond = (z > heights[0] + 0.02) | (z < heights[-1] - 0.05)
    return np.where(beyond[:, None], 0, out).astype(np.float32)


def _trunk_reach(fitting: Fitting, z: np.ndarray, angles: np.ndarray) -> Grid:
    cells = fitting.surface.torso_tube.gather(fitting.body.points)
    return _reach(cells, z, angles, fitting.trunk[2])


def _legs_reach(fitting: Fitting, z: np.ndarray, angles: np.ndarray) -> Grid:
    out = np.zeros((len(z), len(angles)), np.float32)
    for name in ("leg.L", "leg.R"):
        cells = fitting.surface.limb_tubes[name].gather(fitting.body.points)
        out = np.maximum(out, _reach(cells, z, angles, fitting.trunk[2]))
    return out


@cache
def _secants() -> np.ndarray:
    """1 / cos of the angle between columns; large where they are more than 80 degrees apart."""
    turn = np.arange(COLUMNS) * 2 * np.pi / COLUMNS
    cosine = np.cos(turn[:, None] - turn)
    return np.where(cosine > 0.17, 1 / np.maximum(cosine, 0.17), 1e3).astype(np.float32)


def _hull_radii(reach: Grid) -> Grid:
    """Radii of the convex outlines that reach so far in each direction."""
    return (reach[:, None, :] * _secants()).min(2)


def _flared(
    skirt: Skirt, snug: Grid, z: np.ndarray, hip: float, angles: np.ndarray, highest: float
) -> Grid:
    """Radii: snug down to the hips, then falling outwards, with waves towards the hem."""
    below = np.maximum(min(hip, highest) - z, 0)
    start = min(float(z[0]), highest)
    radius = snug
    at_hip = int(np.argmin(np.abs(z - hip)))
    if z[-1] < hip:
        oval = radius[at_hip]
        rounder = oval + (oval.mean() - oval) * np.minimum(below * 1.2, 0.7)[:, None]
        flare = rounder + np.float32(skirt.flare) * below[:, None]
        radius = np.where(below[:, None] > 0, np.maximum(radius, flare), radius)
    if skirt.kind in ("circle", "a_line", "maxi", "tiered") and skirt.flare > 0.15:
        early = radius[0] + np.float32(0.6 * skirt.flare) * (start - z)[:, None]
        radius = np.where((z < start)[:, None], np.maximum(radius, early), radius)
    if skirt.waves:
        rng = np.random.default_rng(skirt.seed)
        phase = skirt.waves * angles + 0.5 * np.sin(2 * angles + rng.uniform(0, 6.28))
        wave = np.sin(phase + rng.uniform(0, 6.28))
        grown = ramp(start - z, 0.06, max(start - float(z[-1]), 0.2))
        radius = radius + np.float32(skirt.wave_height) * grown[:, None] * (wave + 0.6)
    return radius.astype(np.float32)


def _weights(fitting: Fitting, z: np.ndarray, x: Grid, radius: Grid, hip: float) -> SkinWeights:
    """Rigid with the pelvis above the hips, then shared by the thighs, then by the shins."""
    body = fitting.body
    names = body.skeleton.index
    knee = float(body.joint("lowerleg01.L")[2])
    waist = float(body.joint("spine04")[2])
    thighs = 0.88 * ramp(z, hip + 0.13, hip - 0.12)
    shins = 0.85 * ramp(z, knee + 0.03, knee - 0.2)
    above = ramp(z, waist - 0.02, waist + 0.12)  # of a dress's waist: the spine's
    side = ramp(x / radius.max(1, keepdims=True), -0.75, 0.75)
    count = ROWS * COLUMNS
    matrix = np.zeros((count, len(names)), np.float32)
    pelvis = ((1 - thighs) * (1 - above))[:, None] * np.ones_like(x)
    matrix[:, names["root"]] = pelvis.ravel()
    matrix[:, names["spine04"]] = (((1 - thighs) * above)[:, None] * np.ones_like(x)).ravel()
    for name, share in (("L", side), ("R", 1 - side)):
        thigh = (thighs * (1 - shins))[:, None] * share
        matrix[:, names[f"upperleg01.{name}"]] = thigh.ravel()
        matrix[:, names[f"lowerleg01.{name}"]] = ((thighs * shins)[:, None] * share).ravel()
    return SkinWeights(csr_array(matrix))


@dataclass(frozen=True)
class Cones:
    """Legs as cones.

    Attributes:
        start, end: N x 3, the axes.
        radius: N x 2 at start and end, metres.
    """

    start: np.ndarray
    end: np.ndarray
    radius: np.ndarray


def leg_cones(surface: BodySurface, points: Points, clearance: float = 0.0) -> Cones:
    """The legs of a posed skin as chains of cones that enclose them."""
    starts, ends, radii = [], [], []
    for name in ("leg.L", "leg.R"):
        rings = surface.limb_tubes[name].gather(points)[list(_RINGS)]
        centre = rings.mean(1)
        away = np.sort(np.linalg.norm(rings - centre[:, None], axis=2), axis=1)
        radius = away[:, -2] + clearance  # thighs are not round
        starts.append(centre[:-1])
        ends.append(centre[1:])
        radii.append(np.stack([radius[:-1], radius[1:]], 1))
    return Cones(np.concatenate(starts), np.concatenate(ends), np.concatenate(radii))


def exit_distance(points: Points, outward: Points, cones: Cones) -> np.ndarray:
    """How far each point has to go along its outward direction until all cones lie behind it.

    Returns: N; negative where they do already, -1 where the line meets none.
    """
    ray = np.full(len(points), -1, np.float32)
    for start, end, radii in zip(cones.start, cones.end, cones.radius, strict=True):
        axis = end - start
        long = float(np.sqrt(axis @ axis)) + 1e-9
        unit = (axis / long).astype(np.float32)
        offset = points - start.astype(np.float32)
        along_p, along_d = offset @ unit, outward @ unit
        m = offset - along_p[:, None] * unit
        d = outward - along_d[:, None] * unit
        dd = np.einsum("ni,ni->n", d, d) + 1e-6
        md, mm = np.einsum("ni,ni->n", m, d), np.einsum("ni,ni->n", m, m)
        at = np.clip(along_p / long, 0, 1)
        root, inside = -md, mm
        for _ in range(2):
            radius = radii[0] + (radii[1] - radii[0]) * at
            inside = md * md - dd * (mm - radius * radius)
            root = (np.sqrt(np.maximum(inside, 0)) - md) / dd
            at = np.clip((along_p + root * along_d) / long, 0, 1)
        place = (along_p + root * along_d) / long
        hit = (inside > 0) & (place > -0.05) & (place < 1.05) & (dd > 0.05)
        ray = np.maximum(ray, np.where(hit, root, -1))
    return ray


def settler(shape: SkirtShape, surface: BodySurface, rows_from: int = 4):
    """What leaves a skirt outside the legs, taut between them: a `Settle`."""
    first = rows_from * COLUMNS

    def settle(points: Points, body: PosedBody) -> Points:
        outward = _turned(shape, body)[first:]
        cones = leg_cones(surface, body.points, _CLEARANCE)
        push = exit_distance(points[first:], outward, cones).reshape(-1, COLUMNS)
        need = np.clip(push, 0, 0.6)
        need = need - _sunk(push, np.maximum(outward[:, 2], 0).reshape(push.shape))
        lift = need
        for _ in range(5):  # cloth is drawn taut over what pushes it
            lift = np.maximum(need, _spread(lift))
        out = points.copy()
        out[first:] += outward * lift.reshape(-1, 1)
        return out

    return settle


def _sunk(push: Grid, upward: Grid) -> Grid:
    """How far cloth that faces upwards sinks onto the legs below it, metres."""
    if upward.max() < 0.2:
        return np.zeros_like(push)
    weight = ramp(upward, 0.15, 0.6)
    known = ((push > -1) & (push < 0)) * weight
    slack = known * np.clip(-push, 0, 0.3)
    for _ in range(9):
        slack, known = _spread(slack), _spread(known)
    sunk = weight * slack / np.maximum(known, 1e-4)
    return np.where(push > 0, 0, np.minimum(sunk, np.where(push > -1, -push, 0.3)))


def _spread(values: Grid) -> Grid:
    """The mean of each cell's four neighbours; half the value above the first row."""
    padded = np.concatenate([values[:1] * 0.5, values, values[-1:]])
    around = np.roll(values, 1, 1) + np.roll(values, -1, 1)
    return (around + padded[:-2] + padded[2:]) / 4


def _turned(shape: SkirtShape, body: PosedBody) -> Points:
    """Outward directions after skinning."""
    matrices = body.transforms.reshape(-1, 12)
    turns = (shape.weights.matrix @ matrices).reshape(-1, 3, 4)[..., :3]
    turned = np.einsum("vij,vj->vi", turns, shape.outward)
    return turned / (np.linalg.norm(turned, axis=1, keepdims=True) + 1e-9)
