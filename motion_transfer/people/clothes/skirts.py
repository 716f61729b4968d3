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
from motion_transfer.people.figure.mesh import PosedBody, Settle

COLUMNS = 48
ROWS = 26
EVERYWHERE = 9.0  # metres; above everybody's head
_CLEARANCE = 0.012  # metres between legs and cloth
_RINGS = (0, 3, 6, 9, 12, 15)  # rows of a leg's table that bound the cones standing for the leg
_HELD_ROWS = 4  # the uppermost, which no leg can push outwards
Grid = Float32[np.ndarray, "rows columns"]

_TURN = np.arange(COLUMNS) * 2 * np.pi / COLUMNS
_COSINE = np.cos(_TURN[:, None] - _TURN)
_LIMIT = 0.17  # of 80 degrees: beyond it a column says nothing about another one
_SECANTS = np.where(_COSINE > _LIMIT, 1 / np.maximum(_COSINE, _LIMIT), 1e3).astype(np.float32)
"""1 / cos of the angle between columns."""


@dataclass(frozen=True)
class SkirtShape:
    """A skirt at rest.

    Attributes:
        points: ROWS * COLUMNS x 3, row by row from the top.
        outward: Unit vectors away from the axis, in the same order.
        weights: How the bones move the points.
        down: ROWS, metres along the cloth from the upper edge.
        around: The mean circumference, metres.
    """

    points: Points
    outward: Points
    weights: SkinWeights
    down: Float32[np.ndarray, " rows"]
    around: float


@cache
def tube_grid(rows: int, columns: int) -> tuple[Faces, Float32[np.ndarray, "F 3 2"]]:
    """Make the triangles of a tube seen from outside, and their corners' texture coordinates.

    Column 0 closes on the last one; u runs once around, v from top to bottom.
    """
    r, c = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a, b = r * columns + c, r * columns + (c + 1) % columns
    below_a, below_b = a + columns, b + columns
    upper, lower = np.stack([a, below_b, b], -1), np.stack([a, below_a, below_b], -1)
    faces = np.stack([upper, lower], 2).reshape(-1, 3).astype(np.int32)
    u0, u1 = c / columns, (c + 1) / columns
    v0, v1 = r / (rows - 1), (r + 1) / (rows - 1)
    corners = ((u0, v0), (u1, v1), (u1, v0), (u0, v0), (u0, v1), (u1, v1))
    uv = np.stack([np.stack(corner, -1) for corner in corners], 2)
    return faces, uv.reshape(-1, 3, 2).astype(np.float32)


def shape_skirt(
    skirt: Skirt, fitting: Fitting, ease: float = 0.0, flare_below: float = EVERYWHERE
) -> SkirtShape:
    """Cut a skirt to a body's measure.

    Args:
        ease: Of what is worn below it at the upper edge, metres.
        flare_below: Height on the template below which it may stand off, metres.
    """
    body, scale, axis = fitting.body, fitting.scale, fitting.trunk[1]
    bones = ("upperleg01.L", "spine04", "foot.L")
    hip_joint, waist, ankle = (float(body.joint(bone)[2]) for bone in bones)
    hip, top = hip_joint - 0.07 * scale, waist + skirt.top * scale  # hips are widest 7 cm lower
    hem = hip_joint - skirt.length * (hip_joint - ankle)
    angles = np.arange(COLUMNS, dtype=np.float32) * np.float32(2 * np.pi / COLUMNS)
    z = np.linspace(top, hem, ROWS, dtype=np.float32)
    surface = fitting.surface
    tubes = surface.torso_tube, surface.limb_tubes["leg.L"], surface.limb_tubes["leg.R"]
    reach = np.max([_reach(tube.gather(body.points), z, angles, axis) for tube in tubes], 0)
    # cloth spans hollows, as between the legs: the convex outline that reaches so far
    snug = (reach[:, None, :] * _SECANTS).min(2) + np.float32(skirt.ease + ease)
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
        weights=skirt_weights(fitting, z, x, radius, hip),
        down=np.concatenate([[0], np.cumsum(steps)]).astype(np.float32),
        around=float(2 * np.pi * radius[ROWS // 3 :].mean()),
    )


def _reach(cells: np.ndarray, z: np.ndarray, angles: np.ndarray, axis: float) -> Grid:
    """Measure how far a tube's rings reach from the skirt's axis; 0 off its ends.

    Args:
        cells: Of a trunk's or leg's table, levels x angles x 3.
        z, angles: The skirt's rows and columns.
    """
    across = cells[..., :1] * np.sin(angles) - (cells[..., 1:2] - axis) * np.cos(angles)
    across = across.max(1)
    heights = cells[..., 2].mean(1)
    at = np.interp(-z, -heights, np.arange(len(heights)))
    low = np.minimum(at.astype(int), len(heights) - 2)
    share = (at - low)[:, None]
    out = across[low] * (1 - share) + across[low + 1] * share
    beyond = (z > heights[0] + 0.02) | (z < heights[-1] - 0.05)
    return np.where(beyond[:, None], 0, np.maximum(out, 0)).astype(np.float32)


def _flared(
    skirt: Skirt, snug: Grid, z: np.ndarray, hip: float, angles: np.ndarray, highest: float
) -> Grid:
    """Widen snug radii: below the hips they fall outwards, with waves towards the hem."""
    below = np.maximum(min(hip, highest) - z, 0)
    start = min(float(z[0]), highest)
    radius = snug
    at_hip = int(np.argmin(np.abs(z - hip)))
    if z[-1] < hip:
        oval = radius[at_hip]
        # bodies are oval; cloth that hangs free grows rounder, to 70 % within 60 cm
        rounder = oval + (oval.mean() - oval) * np.minimum(below * 1.2, 0.7)[:, None]
        flare = rounder + np.float32(skirt.flare) * below[:, None]
        radius = np.where(below[:, None] > 0, np.maximum(radius, flare), radius)
    if skirt.kind in ("circle", "a_line", "maxi", "tiered") and skirt.flare > 0.15:
        # wide skirts stand off from the waist on, less than below the hips
        early = radius[0] + np.float32(0.6 * skirt.flare) * (start - z)[:, None]
        radius = np.where((z < start)[:, None], np.maximum(radius, early), radius)
    if skirt.waves:
        rng = np.random.default_rng(skirt.seed)
        phase = skirt.waves * angles + 0.5 * np.sin(2 * angles + rng.uniform(0, 6.28))
        wave = np.sin(phase + rng.uniform(0, 6.28))
        grown = ramp(start - z, 0.06, max(start - float(z[-1]), 0.2))
        radius = radius + np.float32(skirt.wave_height) * grown[:, None] * (wave + 0.6)
    return radius.astype(np.float32)


def skirt_weights(
    fitting: Fitting, z: np.ndarray, x: Grid, radius: Grid, hip: float
) -> SkinWeights:
    """Share the rows out: the pelvis's above the hips, then the thighs', then the shins'.

    Args:
        z: Height of each row.
        x, radius: To the left, and from the axis, of each point.
        hip: The height at which hips are widest.
    """
    names = fitting.body.skeleton.index
    knee, waist = (float(fitting.body.joint(bone)[2]) for bone in ("lowerleg01.L", "spine04"))
    # never wholly the legs': cloth lags behind a stride
    thighs = 0.88 * ramp(z, hip + 0.13, hip - 0.12)
    shins = 0.85 * ramp(z, knee + 0.03, knee - 0.2)
    above = ramp(z, waist - 0.02, waist + 0.12)  # of a dress's waist: the spine's
    side = ramp(x / radius.max(1, keepdims=True), -0.75, 0.75)
    matrix = np.zeros((ROWS, COLUMNS, len(names)), np.float32)
    matrix[..., names["root"]] = ((1 - thighs) * (1 - above))[:, None]
    matrix[..., names["spine04"]] = ((1 - thighs) * above)[:, None]
    for name, share in (("L", side), ("R", 1 - side)):
        matrix[..., names[f"upperleg01.{name}"]] = (thighs * (1 - shins))[:, None] * share
        matrix[..., names[f"lowerleg01.{name}"]] = (thighs * shins)[:, None] * share
    return SkinWeights(csr_array(matrix.reshape(ROWS * COLUMNS, -1)))


@dataclass(frozen=True)
class Cones:
    """Legs as cones.

    Attributes:
        start, end: Of the axes, N x 3.
        radius: At start and end, N x 2, metres.
    """

    start: np.ndarray
    end: np.ndarray
    radius: np.ndarray


def leg_cones(surface: BodySurface, points: Points, clearance: float = 0.0) -> Cones:
    """Enclose the legs of a posed skin in chains of cones."""
    starts, ends, radii = [], [], []
    for name in ("leg.L", "leg.R"):
        rings = surface.limb_tubes[name].gather(points)[list(_RINGS)]
        centre = rings.mean(1)
        away = np.sort(np.linalg.norm(rings - centre[:, None], axis=2), axis=1)
        radius = away[:, -2] + clearance  # the largest but one: thighs are not round
        starts.append(centre[:-1])
        ends.append(centre[1:])
        radii.append(np.stack([radius[:-1], radius[1:]], 1))
    return Cones(np.concatenate(starts), np.concatenate(ends), np.concatenate(radii))


def exit_distance(points: Points, outward: Points, cones: Cones) -> np.ndarray:
    """Measure how far points have to go outwards until all cones lie behind them.

    Returns: N, metres; negative where they do already, -1 where the line meets none.
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
        for _ in range(2):  # as for a cylinder, with the cone's radius at the last place found
            radius = radii[0] + (radii[1] - radii[0]) * at
            inside = md * md - dd * (mm - radius * radius)
            root = (np.sqrt(np.maximum(inside, 0)) - md) / dd
            at = np.clip((along_p + root * along_d) / long, 0, 1)
        place = (along_p + root * along_d) / long
        # a little beyond the ends, so that no gap opens between cones; not along the axis
        hit = (inside > 0) & (place > -0.05) & (place < 1.05) & (dd > 0.05)
        ray = np.maximum(ray, np.where(hit, root, -1))
    return ray


def settler(shape: SkirtShape, surface: BodySurface) -> Settle:
    """Make what leaves a skirt outside the legs, taut between them."""
    first = _HELD_ROWS * COLUMNS

    def settle(points: Points, body: PosedBody) -> Points:
        turns = shape.weights.matrix @ body.transforms.reshape(-1, 12)
        outward = np.einsum("vij,vj->vi", turns.reshape(-1, 3, 4)[..., :3], shape.outward)[first:]
        outward = outward / (np.linalg.norm(outward, axis=1, keepdims=True) + 1e-9)
        cones = leg_cones(surface, body.points, _CLEARANCE)
        push = exit_distance(points[first:], outward, cones).reshape(-1, COLUMNS)
        need = np.clip(push, 0, 0.6)  # metres; further out is no leg that pushes
        need = need - _sunk(push, np.maximum(outward[:, 2], 0).reshape(push.shape))
        lift = need
        for _ in range(5):  # cloth is drawn taut over what pushes it
            lift = np.maximum(need, _spread(lift))
        out = points.copy()
        out[first:] += outward * lift.reshape(-1, 1)
        return out

    return settle


def _sunk(push: Grid, upward: Grid) -> Grid:
    """Measure how far cloth that faces upwards sinks onto the legs below it, metres.

    Args:
        push: As `exit_distance` returns it.
        upward: How much cloth faces upwards, 0..1: on thighs of somebody who sits.
    """
    if upward.max() < 0.2:
        return np.zeros_like(push)
    weight = ramp(upward, 0.15, 0.6)
    known = ((push > -1) & (push < 0)) * weight
    slack = known * np.clip(-push, 0, 0.3)
    for _ in range(9):  # between the legs, where nothing is below, the cloth next to it decides
        slack, known = _spread(slack), _spread(known)
    sunk = weight * slack / np.maximum(known, 1e-4)
    return np.where(push > 0, 0, np.minimum(sunk, np.where(push > -1, -push, 0.3)))


def _spread(values: Grid) -> Grid:
    """Take the mean of each cell's four neighbours; half the value above the first row."""
    padded = np.concatenate([values[:1] * 0.5, values, values[-1:]])
    around = np.roll(values, 1, 1) + np.roll(values, -1, 1)
    return (around + padded[:-2] + padded[2:]) / 4
