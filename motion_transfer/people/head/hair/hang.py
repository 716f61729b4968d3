"""Hair that hangs: from a parting over the head, then down under its own weight.

A grid's first rows hug the head and move with it; those below are a curtain that is settled anew in
every pose. Lengths are metres, places on the head radians from straight up (see `head_map`); shares
and distances that name no other source were chosen by eye.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float32
from scipy.interpolate import make_interp_spline

from motion_transfer.people.figure.body import Points
from motion_transfer.people.figure.mesh import Piece, PosedBody
from motion_transfer.people.head.brushes import ramp
from motion_transfer.people.head.hair.cap import hair_material
from motion_transfer.people.head.hair.drape import Fall, Obstacle, drape, obstacle
from motion_transfer.people.head.hair.grid import (
    Columns,
    Grid,
    Head,
    Parting,
    grid_faces,
    ray_roots,
    rays,
    until,
)
from motion_transfer.people.head.hair.styles import Hair
from motion_transfer.people.head.head_map import rigid
from motion_transfer.people.head.skin_atlas import unit

_COLUMNS, _HUG, _HANG = 72, 14, 28  # columns; rows on the head; rows below
_FROM_OPENING = np.minimum(np.arange(_COLUMNS), np.arange(_COLUMNS)[::-1])  # before the face
_GUIDES, _STEPS = 36, 10  # what is marched; the rest lies between
_RELEASE = 1.60  # radians: hair leaves the head a little below its widest place
_BROW = 1.02, 0.30  # radians at which the shortest fringe ends, and how much longer the longest is
_FRINGE_METRES = 0.012  # that a fringe still hangs once it has left the head
_PARTED_METRES = 0.05  # neighbouring guides further apart went to different sides of a shoulder
_TORN_METRES = 0.04  # a triangle between two locks that is longer would span the gap between them
_LOCK_REACH = 3  # neighbours to either side that a strand keeps together with
_CHEST_METRES = (0.045, 0.125)  # from the middle, where hair in front of the shoulders lies
_FRINGE_CLEAR_METRES = 0.006  # a fringe lies flat; all other hair keeps clear by its volume as well


@cache
def _refine() -> Float32[np.ndarray, "rows steps"]:
    """Make the matrix from a strand's root and marched points to hanging rows: a cubic spline."""
    curve = make_interp_spline(np.arange(_STEPS + 1), np.eye(_STEPS + 1), k=3)
    return curve(np.arange(1, _HANG + 1) * (_STEPS / _HANG)).astype(np.float32)


@dataclass(frozen=True)
class Curtain:
    """Settles hanging rows below rows that move with the head.

    Attributes:
        fall: How the guides hang.
        guides: Columns that are marched.
        between: For each column the guides on either side, and its share of the second.
        swing: HANG x COLUMNS x 2 metres by which waves move each point sideways and outward.
        breaks: Columns at which a new lock begins.
        skin: What the hair keeps clear of.
    """

    fall: Fall
    guides: np.ndarray
    between: tuple[np.ndarray, np.ndarray, Columns]
    swing: Float32[np.ndarray, "rows columns 2"]
    breaks: tuple[int, ...]
    skin: Obstacle

    def __call__(self, points: Points, posed: PosedBody) -> Points:
        out = points.reshape(_HUG + _HANG, _COLUMNS, 3).copy()
        last = out[_HUG - 1]
        way = unit(last - out[_HUG - 2])
        roots = last[self.guides]
        strands = drape(roots, way[self.guides], self.fall, self.skin, posed)
        strands = np.concatenate([roots[None], strands])
        first, second, share = self.between
        gap = strands[:, second] - strands[:, first]
        # guides that part around a shoulder take the columns between them to either side
        parted = (gap**2).sum(-1) > _PARTED_METRES**2
        strands = strands[:, first] + np.where(parted, share.round(), share)[..., None] * gap
        # the columns' own roots are kept: only what lies below them comes from the guides
        strands[0] = last
        rows = (_refine() @ strands.reshape(_STEPS + 1, -1)).reshape(_HANG, _COLUMNS, 3)
        along = unit(np.gradient(last, axis=0))
        outward = unit(np.cross(way, along))
        out[_HUG:] = rows + self.swing[..., :1] * along + self.swing[..., 1:] * outward
        return out.reshape(-1, 3)


def hang_piece(hair: Hair, head: Head, rest: PosedBody, limit: float | None = None) -> Piece:
    """Make a bob or long hair.

    Args:
        rest: The body in its rest pose.
        limit: Metres that it may stand off the head at most (under a hat).
    """
    rng = np.random.default_rng(hair.seed)
    part, angles, spread = _layout(hair, rng)
    roots, ways = ray_roots(part, angles, spread)
    release = until(roots, ways, _RELEASE)
    fringe = np.zeros(_COLUMNS, np.float32)  # how much each column ends over the forehead, 0 .. 1
    if hair.fringe > 0:  # 36 to 49 degrees from the front: the ends of the brows
        fringe = 1 - ramp(np.minimum(angles, 2 * np.pi - angles), 0.62, 0.85)
    brow = until(roots, ways, _BROW[0] + _BROW[1] * hair.fringe)
    # a fringe's strands end about 2 mm apart
    brow = brow + 0.022 * rng.standard_normal(_COLUMNS).clip(-2, 2)
    release = release + fringe * (np.minimum(brow, release) - release)
    rows = np.linspace(0, 1, _HUG, dtype=np.float32)[:, None]
    lengths = (rows * release).astype(np.float32)
    points, normals, _ = head.map.at(rays(part, angles, lengths, spread))
    off = _standing(hair, lengths, fringe, rng)
    hug = points + np.minimum(off, limit or 1.0)[..., None] * normals
    left, back = (roots + ways * release[:, None]).T.astype(np.float64)
    azimuth = np.degrees(np.abs(np.arctan2(left, -back)))
    front = np.zeros(_COLUMNS, bool)  # which columns fall in front of the shoulders
    if hair.front > 0:  # with a fringe, from before the ears or from behind them
        many = 6 + 8 * hair.front
        front = azimuth < 85 + 20 * hair.front if hair.fringe > 0 else many > _FROM_OPENING
    curtain, length = _curtain(hair, head, fringe, front, rng)
    surface = np.concatenate([hug, np.repeat(hug[-1:], _HANG, 0)]).reshape(-1, 3)
    surface = curtain(np.ascontiguousarray(surface, np.float32), rest)
    faces, uv = grid_faces(_HUG + _HANG, _COLUMNS, closed=hair.fringe > 0)
    faces, uv = _cut_locks(faces, uv, curtain.breaks, surface)
    return Piece(
        name="hair",
        points=surface,
        faces=faces,
        weights=rigid(head.model, len(surface)),
        corner_uv=uv,
        material=hair_material(hair, (0.6, 0.15 + hair.length)),
        keep=_hem(rng, length),
        two_sided=True,
        settle=curtain,
    )


def _layout(hair: Hair, rng: np.random.Generator) -> tuple[Parting, Columns, tuple[float, float]]:
    """Lay out the parting, the columns' angles, and where along the parting columns begin.

    Returns: the last as the angles between which the columns' roots go from its front to its back.
    """
    if hair.fringe > 0:
        # a closed grid, whose seam is behind
        angles = np.linspace(np.pi, 3 * np.pi, _COLUMNS, endpoint=False) % (2 * np.pi)
        return ((0.0, -0.25), (0.0, 0.25)), angles.astype(np.float32), (0.7, 2.4)
    side = 0.38 * hair.part
    opening = np.radians(rng.uniform(98, 114))  # from the front: the ears are near 90
    tuck = 0.25 if hair.tuck else 0.0  # radians further back
    left, right = opening + tuck - 0.25 * hair.part, opening + tuck + 0.25 * hair.part
    angles = np.linspace(left, 2 * np.pi - right, _COLUMNS).astype(np.float32)
    front_end = (side, -0.97 - hair.hairline.raised / 100)  # at the hairline
    return (front_end, (0.4 * side, 0.35)), angles, (1.9, 2.9)


def _standing(hair: Hair, lengths: Grid, fringe: Columns, rng: np.random.Generator) -> Grid:
    """Measure metres that hair stands off the head: little at the parting and at its edges."""
    off = hair.volume * (0.30 + 0.70 * ramp(lengths, 0.0, 0.5))
    if hair.fringe == 0:
        off = off * (0.30 + 0.70 * ramp(_FROM_OPENING, 0, 7))
    off = off * (1 - 0.35 * fringe * ramp(lengths, 0.5, 1.2))
    grain = rng.standard_normal(_COLUMNS) * 0.06  # columns are told apart
    return (off * (1 + grain) + 0.003).astype(np.float32)  # 3 mm clear of the layer below


def _curtain(
    hair: Hair, head: Head, fringe: Columns, front: np.ndarray, rng: np.random.Generator
) -> tuple[Curtain, Columns]:
    """Make the curtain, and tell how long each of its columns is."""
    length = hair.length * (1 - fringe) + _FRINGE_METRES * fringe
    guides = np.unique(np.linspace(0, _COLUMNS - 1, _GUIDES).round().astype(int))
    side = np.where(front, 1, -1).astype(np.float32)
    breaks = np.flatnonzero(np.diff(side)) + 1
    clear = _FRINGE_CLEAR_METRES + np.where(fringe > 0.5, 0, 0.45 * hair.volume)
    fall = Fall(
        step=(length[guides] / _STEPS).astype(np.float32),
        steps=_STEPS,
        clear=clear[guides].astype(np.float32),
        front=side[guides],
        cohesion=_cohesion(side[guides], 1 - fringe[guides]),
        aside=_aside(side, fringe)[guides],
        stiffness=0.4,
        inward=1.2 * float(rng.uniform(-0.2, 1)) if hair.style == "bob" else 0.0,
    )
    down = np.linspace(0, 1, _HANG + 1)[1:, None] * length
    # neighbours swing nearly alike, columns far apart do not
    phase = np.cumsum(rng.normal(0, 0.7, _COLUMNS))
    wave = hair.wave * ramp(down, 0.0, 0.10)
    turn = 2 * np.pi * down / (0.13 - 0.05 * hair.curl) + phase  # a wave is 8 to 13 cm long
    swing = np.stack([0.7 * wave * np.sin(turn), 0.7 * wave * (1 + np.cos(turn))], -1)
    return Curtain(
        fall=fall,
        guides=guides,
        between=_between(guides, breaks),
        swing=swing.astype(np.float32),
        breaks=tuple(int(k) for k in breaks),
        skin=obstacle(head.body, head.model),
    ), length


def _aside(side: Columns, fringe: Columns) -> Columns:
    """Place columns in front of the shoulders, spread over either side of the chest."""
    out = np.zeros(_COLUMNS, np.float32)
    loose = (side > 0) & (fringe < 0.5)
    # a fringe's columns begin behind: the left side comes after the middle
    left = (np.arange(_COLUMNS) < _COLUMNS // 2) != fringe.any()
    for own, sign in ((loose & left, 1), (loose & ~left, -1)):  # the outermost last
        out[own] = sign * np.linspace(*_CHEST_METRES, int(own.sum()))[::sign]
    return out


def _cohesion(side: np.ndarray, loose: np.ndarray) -> Float32[np.ndarray, "strands strands"]:
    """Weigh as many neighbours on the left as on the right, all of the strand's own lock.

    A lock's outermost strands and a fringe's are left alone, so that locks keep their width.
    """
    count = len(side)
    out = np.zeros((count, count), np.float32)
    # the number of each strand's lock; 1000 sets the fringe apart
    lock = np.cumsum(np.concatenate([[0], np.diff(side) != 0])) + 1000 * (loose < 0.5)
    for k in range(count):
        reach = 0
        while reach < min(_LOCK_REACH, k, count - 1 - k) and (
            lock[k - reach - 1] == lock[k] == lock[k + reach + 1]
        ):
            reach += 1
        out[k, k - reach : k + reach + 1] = 1 / (2 * reach + 1)
    return out


def _between(guides: np.ndarray, breaks: np.ndarray) -> tuple[np.ndarray, np.ndarray, Columns]:
    """Find the guides beside each column, in its own lock, and its share of the second one."""
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
    across = np.isin(column.max(1), breaks) & (np.ptp(column, axis=1) == 1)
    kept = ~across
    kept[across] = np.ptp(points[faces[across]], axis=1).max(1) <= _TORN_METRES
    return np.ascontiguousarray(faces[kept]), np.ascontiguousarray(uv[kept])


def _hem(rng: np.random.Generator, length: Columns) -> Float32[np.ndarray, " V"]:
    """Make ends ragged: strands stop short of the last row by up to a few centimetres."""
    down = np.linspace(0, 1, _HANG + 1)[1:, None] * length
    down = np.concatenate([np.full((_HUG, _COLUMNS), -0.01), down])
    short = rng.gamma(1.3, 0.005 + 0.014 * length) + 0.001
    return (length - np.minimum(short, 0.7 * length) - down).astype(np.float32).ravel()
