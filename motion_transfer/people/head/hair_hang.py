"""Hair that hangs: from a parting over the head, then down under its own weight."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float32
from scipy.interpolate import make_interp_spline

from motion_transfer.people.figure.body import Points
from motion_transfer.people.figure.mesh import Piece, PosedBody
from motion_transfer.people.head.brushes import ramp
from motion_transfer.people.head.hair_cap import hair_material
from motion_transfer.people.head.hair_drape import Fall, Obstacle, drape, obstacle, rest_normals
from motion_transfer.people.head.hair_grid import Head, grid_faces, ray_roots, rays, until
from motion_transfer.people.head.hair_styles import Hair

_COLUMNS, _HUG, _HANG = 72, 14, 28
_GUIDES, _STEPS = 36, 10  # what is marched; the rest lies between
Parting = tuple[tuple[float, float], tuple[float, float]]
_PARTED = 0.05  # metres between neighbouring guides
_RELEASE = 1.60  # radians from straight up at which hair leaves the head


@cache
def _refine() -> Float32[np.ndarray, "rows steps"]:
    """Hanging rows from a strand's root and its marched points, by a smooth curve."""
    curve = make_interp_spline(np.arange(_STEPS + 1), np.eye(_STEPS + 1), k=3)
    return curve(np.arange(1, _HANG + 1) * (_STEPS / _HANG)).astype(np.float32)


@dataclass(frozen=True)
class Curtain:
    """Settles hanging rows below rows that move with the head.

    Attributes:
        fall: how the guides hang.
        guides: columns that are marched.
        between: for each column the guides on either side, and its share of the second.
        swing: HANG x COLUMNS x 2 metres by which waves move each point sideways and outward.
        breaks: columns at which a new lock begins.
        skin, normals: what the hair keeps clear of.
    """

    fall: Fall
    guides: np.ndarray
    between: tuple[np.ndarray, np.ndarray, Float32[np.ndarray, " columns"]]
    swing: Float32[np.ndarray, "rows columns 2"]
    breaks: tuple[int, ...]
    skin: Obstacle
    normals: Points

    def __call__(self, points: Points, posed: PosedBody) -> Points:
        out = points.reshape(_HUG + _HANG, _COLUMNS, 3).copy()
        last = out[_HUG - 1]
        way = _unit(last - out[_HUG - 2])
        roots = last[self.guides]
        strands = drape(roots, way[self.guides], self.fall, self.skin, self.normals, posed)
        strands = np.concatenate([roots[None], strands])
        first, second, share = self.between
        gap = strands[:, second] - strands[:, first]
        # guides that part around a shoulder take the columns between them to either side
        parted = (gap**2).sum(-1) > _PARTED**2
        strands = strands[:, first] + np.where(parted, share.round(), share)[..., None] * gap
        # the columns' own roots are kept: only what lies below them comes from the guides
        strands[0] = last
        rows = (_refine() @ strands.reshape(_STEPS + 1, -1)).reshape(_HANG, _COLUMNS, 3)
        along = _unit(np.gradient(last, axis=0))
        outward = _unit(np.cross(way, along))
        out[_HUG:] = rows + self.swing[..., :1] * along + self.swing[..., 1:] * outward
        return out.reshape(-1, 3)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-6)


def hang_piece(hair: Hair, head: Head, rest: PosedBody, limit: float | None = None) -> Piece:
    """Bobs and long hair.

    Args:
        rest: the body in its rest pose.
        limit: metres that it may stand off the head at most (under a hat).
    """
    rng = np.random.default_rng(hair.seed)
    part, angles, spread = _layout(hair, rng)
    roots, ways = ray_roots(part, angles, spread)
    release = until(roots, ways, _RELEASE)
    fringe = _fringe(hair, angles)
    brow = until(roots, ways, 1.02 + 0.30 * hair.fringe)
    brow = brow + 0.022 * rng.standard_normal(_COLUMNS).clip(-2, 2)
    release = release + fringe * (np.minimum(brow, release) - release)
    rows = np.linspace(0, 1, _HUG, dtype=np.float32)[:, None]
    lengths = (rows * release).astype(np.float32)
    points, normals, _ = head.map.at(rays(part, angles, lengths, spread))
    off = _standing(hair, lengths, fringe, rng)
    hug = points + np.minimum(off, limit or 1.0)[..., None] * normals
    azimuth = np.abs(np.arctan2(*(roots + ways * release[:, None]).T * np.array([[1], [-1]])))
    front = _in_front(hair, azimuth)
    curtain, length = _curtain(hair, head, fringe, front, rng)
    surface = np.concatenate([hug, np.repeat(hug[-1:], _HANG, 0)]).reshape(-1, 3)
    surface = curtain(np.ascontiguousarray(surface, np.float32), rest)
    faces, uv = grid_faces(_HUG + _HANG, _COLUMNS, closed=hair.fringe > 0)
    faces, uv = _cut_locks(faces, uv, curtain.breaks, surface)
    return Piece(
        name="hair",
        points=surface,
        faces=faces,
        weights=head.rigid(len(surface)),
        corner_uv=uv,
        material=hair_material(hair, (0.6, 0.15 + hair.length)),
        keep=_hem(rng, length),
        two_sided=True,
        settle=curtain,
    )


def _in_front(hair: Hair, azimuth: Float32[np.ndarray, " columns"]) -> np.ndarray:
    """Which columns fall in front of the shoulders."""
    if hair.front == 0:
        return np.zeros(_COLUMNS, bool)
    if hair.fringe > 0:
        return np.degrees(azimuth) < 85 + 20 * hair.front
    edge = np.minimum(np.arange(_COLUMNS), np.arange(_COLUMNS)[::-1])
    return edge < 6 + 8 * hair.front


def _layout(
    hair: Hair, rng: np.random.Generator
) -> tuple[Parting, Float32[np.ndarray, " columns"], tuple[float, float]]:
    """The parting, the columns' angles, and over which angles columns spread along the parting."""
    if hair.fringe > 0:
        # a closed grid, whose seam is behind
        angles = np.linspace(np.pi, 3 * np.pi, _COLUMNS, endpoint=False) % (2 * np.pi)
        return ((0.0, -0.25), (0.0, 0.25)), angles.astype(np.float32), (0.7, 2.4)
    side = 0.38 * hair.part
    opening = np.radians(rng.uniform(98, 114))
    tuck = 0.25 if hair.tuck else 0.0
    left, right = opening + tuck - 0.25 * hair.part, opening + tuck + 0.25 * hair.part
    angles = np.linspace(left, 2 * np.pi - right, _COLUMNS).astype(np.float32)
    return ((side, -0.97 - hair.hairline.raised / 100), (0.4 * side, 0.35)), angles, (1.9, 2.9)


def _fringe(hair: Hair, angles: Float32[np.ndarray, " columns"]) -> Float32[np.ndarray, " columns"]:
    """Which columns end over the forehead, 0 .. 1."""
    if hair.fringe == 0:
        return np.zeros(len(angles), np.float32)
    turn = np.minimum(angles, 2 * np.pi - angles)
    return 1 - ramp(turn, 0.62, 0.85)


def _standing(
    hair: Hair,
    lengths: Float32[np.ndarray, "rows columns"],
    fringe: Float32[np.ndarray, " columns"],
    rng: np.random.Generator,
) -> Float32[np.ndarray, "rows columns"]:
    off = hair.volume * (0.30 + 0.70 * ramp(lengths, 0.0, 0.5))
    if hair.fringe == 0:
        edge = np.minimum(np.arange(_COLUMNS), np.arange(_COLUMNS)[::-1])
        off = off * (0.30 + 0.70 * ramp(edge, 0, 7))
    off = off * (1 - 0.35 * fringe * ramp(lengths, 0.5, 1.2))
    grain = rng.standard_normal(_COLUMNS) * 0.06
    return (off * (1 + grain) + 0.003).astype(np.float32)


def _curtain(
    hair: Hair,
    head: Head,
    fringe: Float32[np.ndarray, " columns"],
    front: np.ndarray,
    rng: np.random.Generator,
) -> tuple[Curtain, Float32[np.ndarray, " columns"]]:
    length = hair.length * (1 - fringe) + 0.012 * fringe
    guides = np.unique(np.linspace(0, _COLUMNS - 1, _GUIDES).round().astype(int))
    side = np.where(front, 1, -1).astype(np.float32)
    breaks = np.flatnonzero(np.diff(side)) + 1
    fall = Fall(
        step=(length[guides] / _STEPS).astype(np.float32),
        steps=_STEPS,
        clear=np.where(fringe > 0.5, 0.006, 0.45 * hair.volume + 0.006)[guides].astype(np.float32),
        front=side[guides],
        cohesion=_cohesion(side[guides], 1 - fringe[guides]),
        aside=_aside(side, fringe)[guides],
        stiffness=0.4,
        inward=1.2 * float(rng.uniform(-0.2, 1)) if hair.style == "bob" else 0.0,
    )
    down = np.linspace(0, 1, _HANG + 1)[1:, None] * length
    phase = np.cumsum(rng.normal(0, 0.7, _COLUMNS))
    wave = hair.wave * ramp(down, 0.0, 0.10)
    turn = 2 * np.pi * down / (0.13 - 0.05 * hair.curl) + phase
    swing = np.stack([0.7 * wave * np.sin(turn), 0.7 * wave * (1 + np.cos(turn))], -1)
    skin = obstacle(head.model)
    return Curtain(
        fall=fall,
        guides=guides,
        between=_between(guides, breaks),
        swing=swing.astype(np.float32),
        breaks=tuple(int(k) for k in breaks),
        skin=skin,
        normals=rest_normals(head.body, skin),
    ), length


def _aside(
    side: Float32[np.ndarray, " columns"], fringe: Float32[np.ndarray, " columns"]
) -> Float32[np.ndarray, " columns"]:
    """Where columns in front of the shoulders come to lie: spread over either side of the chest."""
    out = np.zeros(_COLUMNS, np.float32)
    loose = (side > 0) & (fringe < 0.5)
    left = np.arange(_COLUMNS) < _COLUMNS // 2
    if fringe.any():  # a fringe's columns begin behind: the left side comes after the middle
        left = ~left
    for own, sign in ((loose & left, 1), (loose & ~left, -1)):
        rank = np.linspace(0.045, 0.125, int(own.sum()))
        outermost_last = rank if (sign > 0) else rank[::-1]
        out[own] = sign * outermost_last
    return out


def _cohesion(
    side: Float32[np.ndarray, " strands"], loose: Float32[np.ndarray, " strands"]
) -> Float32[np.ndarray, "strands strands"]:
    """The middle of as many neighbours on the left as on the right, all of the strand's own lock.

    A lock's outermost strands and a fringe's are left alone, so that locks keep their width.
    """
    count = len(side)
    out = np.eye(count, dtype=np.float32)
    lock = np.cumsum(np.concatenate([[0], np.diff(side) != 0])) + 1000 * (loose < 0.5)
    for k in range(count):
        reach = 0
        while (
            reach < 3
            and k - reach - 1 >= 0
            and k + reach + 1 < count
            and lock[k - reach - 1] == lock[k] == lock[k + reach + 1]
        ):
            reach += 1
        out[k] = 0
        out[k, k - reach : k + reach + 1] = 1 / (2 * reach + 1)
    return out


def _between(
    guides: np.ndarray, breaks: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Float32[np.ndarray, " columns"]]:
    """The guides on either side of each column, in its own lock, and its share of the second."""
    columns = np.arange(_COLUMNS)
    lock = np.searchsorted(breaks, columns, side="right")
    first, second = np.zeros(_COLUMNS, int), np.zeros(_COLUMNS, int)
    for k in np.unique(lock):
        own = np.flatnonzero(lock[guides] == k)
        mine = lock == k
        after = np.searchsorted(guides[own], columns[mine])
        second[mine] = own[np.clip(after, 0, len(own) - 1)]
        first[mine] = own[np.clip(after - 1, 0, len(own) - 1)]
    gap = np.maximum(guides[second] - guides[first], 1)
    share = np.clip((columns - guides[first]) / gap, 0, 1)
    return first, second, share.astype(np.float32)


def _cut_locks(
    faces: np.ndarray, uv: np.ndarray, breaks: tuple[int, ...], points: Points
) -> tuple[np.ndarray, np.ndarray]:
    """Leave out what would span the gap between hair before and behind the shoulder."""
    column = faces % _COLUMNS
    across = np.zeros(len(faces), bool)
    for first in breaks:
        across |= (column.min(1) == first - 1) & (column.max(1) == first)
    suspects = np.flatnonzero(across)
    corners = points[faces[suspects]]
    kept = np.ones(len(faces), bool)
    kept[suspects[np.ptp(corners, axis=1).max(1) > 0.04]] = False
    return np.ascontiguousarray(faces[kept]), np.ascontiguousarray(uv[kept])


def _hem(
    rng: np.random.Generator, length: Float32[np.ndarray, " columns"]
) -> Float32[np.ndarray, " V"]:
    """Ragged ends: strands stop short of the last row by up to a few centimetres."""
    down = np.linspace(0, 1, _HANG + 1)[1:, None] * length
    down = np.concatenate([np.full((_HUG, _COLUMNS), -0.01), down])
    short = rng.gamma(1.3, 0.005 + 0.014 * length) + 0.001
    return (length - np.minimum(short, 0.7 * length) - down).astype(np.float32).ravel()
