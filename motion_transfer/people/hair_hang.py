"""Hair that hangs: from a parting over the head, then down under its own weight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from motion_transfer.people.body import Points
from motion_transfer.people.face_paint import ramp
from motion_transfer.people.hair_cap import hair_material
from motion_transfer.people.hair_drape import Fall, Obstacle, drape, obstacle, rest_normals
from motion_transfer.people.hair_grid import Head, grid_faces, ray_roots, rays, until
from motion_transfer.people.hair_styles import Hair
from motion_transfer.people.mesh import Piece, PosedBody

_COLUMNS, _HUG, _HANG = 72, 14, 20
_RELEASE = 1.60  # radians from straight up at which hair leaves the head


@dataclass(frozen=True)
class Curtain:
    """Settles hanging rows below rows that move with the head.

    Attributes:
        fall: how they hang.
        swing: HANG x COLUMNS metres by which waves move each point sideways and outward.
        groups: columns at which a new lock begins; smoothing stops there.
    """

    fall: Fall
    swing: Float32[np.ndarray, "steps columns 2"]
    groups: tuple[int, ...]
    skin: Obstacle
    normals: Points

    def __call__(self, points: Points, posed: PosedBody) -> Points:
        out = points.reshape(_HUG + _HANG, _COLUMNS, 3).copy()
        last = out[_HUG - 1]
        way = last - out[_HUG - 2]
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
        strands = drape(last, way, self.fall, self.skin, self.normals, posed)
        for first, stop in zip(self.groups[:-1], self.groups[1:], strict=True):
            lock = strands[:, first:stop]
            lock[:, 1:-1] = 0.5 * lock[:, 1:-1] + 0.25 * (lock[:, 2:] + lock[:, :-2])
        along = np.gradient(last, axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-6)
        outward = np.cross(way, along)
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-6)
        out[_HUG:] = strands + self.swing[..., :1] * along + self.swing[..., 1:] * outward
        return out.reshape(-1, 3)


def hang_piece(hair: Hair, head: Head, rest: PosedBody, limit: float | None = None) -> Piece:
    """Bobs and long hair.

    Args:
        rest: the body in its rest pose.
        limit: metres that it may stand off the head at most (under a hat).
    """
    rng = np.random.default_rng(hair.seed)
    part, angles = _layout(hair, rng)
    roots, ways = ray_roots(part, angles)
    release = until(roots, ways, _RELEASE)
    fringe = _fringe(hair, angles)
    brow = until(roots, ways, 1.02 + 0.36 * hair.fringe)
    release = release + fringe * (np.minimum(brow, release) - release)
    rows = np.linspace(0, 1, _HUG, dtype=np.float32)[:, None]
    lengths = (rows * release).astype(np.float32)
    points, normals, _ = head.map.at(rays(part, angles, lengths))
    off = _standing(hair, lengths, fringe, rng)
    hug = points + np.minimum(off, limit or 1.0)[..., None] * normals
    azimuth = np.abs(np.arctan2(*(roots + ways * release[:, None]).T * np.array([[1], [-1]])))
    front = np.degrees(azimuth) < (55 + 55 * hair.front if hair.front > 0 else 0)
    curtain = _curtain(hair, head, fringe, front, rng)
    surface = np.concatenate([hug, np.repeat(hug[-1:], _HANG, 0)]).reshape(-1, 3)
    surface = curtain(np.ascontiguousarray(surface, np.float32), rest)
    faces, uv = grid_faces(_HUG + _HANG, _COLUMNS, closed=False)
    faces, uv = _cut_locks(faces, uv, curtain)
    return Piece(
        name="hair",
        points=surface,
        faces=faces,
        weights=head.rigid(len(surface)),
        corner_uv=uv,
        material=hair_material(hair, (0.6, 0.15 + hair.length)),
        keep=_hem(rng, curtain.fall),
        two_sided=True,
        settle=curtain,
    )


def _layout(
    hair: Hair, rng: np.random.Generator
) -> tuple[tuple[tuple[float, float], tuple[float, float]], Float32[np.ndarray, " columns"]]:
    """The parting, and the columns' angles from the left edge of the face to its right."""
    if hair.fringe > 0:
        angles = np.linspace(0.02, 2 * np.pi - 0.02, _COLUMNS)
        # the seam is behind, where the hair is deepest
        return ((0.0, -0.25), (0.0, 0.25)), (angles + np.pi).astype(np.float32) % (2 * np.pi)
    side = 0.38 * hair.part
    opening = np.radians(rng.uniform(98, 114))
    tuck = 0.25 if hair.tuck else 0.0
    left, right = opening + tuck - 0.25 * hair.part, opening + tuck + 0.25 * hair.part
    angles = np.linspace(left, 2 * np.pi - right, _COLUMNS).astype(np.float32)
    return ((side, -0.97 - hair.hairline.raised / 100), (0.4 * side, 0.35)), angles


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
) -> Curtain:
    layered = 1 - 0.10 * rng.random(_COLUMNS)
    length = hair.length * layered * (1 - fringe) + 0.012 * fringe
    fall = Fall(
        step=(length / _HANG).astype(np.float32),
        steps=_HANG,
        clear=np.where(fringe > 0.5, 0.006, 0.45 * hair.volume + 0.006).astype(np.float32),
        front=np.where(front, 1, -1).astype(np.float32),
        stiffness=0.45,
        inward=1.2 * float(rng.uniform(-0.2, 1)) if hair.style == "bob" else 0.0,
    )
    down = np.arange(1, _HANG + 1)[:, None] * fall.step
    phase = np.cumsum(rng.normal(0, 0.5, _COLUMNS))
    wave = hair.wave * ramp(down, 0.0, 0.10)
    turn = 2 * np.pi * down / (0.11 - 0.04 * hair.curl) + phase
    swing = np.stack([0.8 * wave * np.sin(turn), wave * (1 + np.cos(turn))], -1)
    changes = np.flatnonzero(np.diff(fall.front)) + 1
    groups = (0, *(int(k) for k in changes), _COLUMNS)
    skin = obstacle(head.model)
    return Curtain(fall, swing.astype(np.float32), groups, skin, rest_normals(head.body, skin))


def _cut_locks(faces: np.ndarray, uv: np.ndarray, curtain: Curtain) -> tuple[np.ndarray, np.ndarray]:
    """Leave out what would span the gap between hair before and behind the shoulder."""
    row, column = faces // _COLUMNS, faces % _COLUMNS
    low = row.max(1) > _HUG + 0.09 / max(float(curtain.fall.step.max()), 1e-6)
    across = np.zeros(len(faces), bool)
    for first in curtain.groups[1:-1]:
        across |= (column.min(1) < first) & (column.max(1) >= first)
    kept = ~(low & across)
    return np.ascontiguousarray(faces[kept]), np.ascontiguousarray(uv[kept])


def _hem(rng: np.random.Generator, fall: Fall) -> Float32[np.ndarray, " V"]:
    """Ragged ends: strands stop short of the last row by up to two centimetres."""
    down = np.arange(1 - _HUG, _HANG + 1)[:, None] * fall.step
    total = fall.step * _HANG
    short = np.minimum(rng.gamma(1.5, 0.006, _COLUMNS) + 0.001, 0.6 * total)
    return (total - short - np.maximum(down, 0)).astype(np.float32).ravel()


Settler = Callable[[Points, PosedBody], Points]
