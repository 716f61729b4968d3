"""Hair that lies on the head: short cuts, afros, and what is tied back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.head.brushes import ramp, to_linear
from motion_transfer.people.head.hair_grid import (
    Grid,
    Grid3,
    Head,
    grid_faces,
    inside_hairline,
    lumps,
    rays,
)
from motion_transfer.people.head.hair_paint import paint_hair
from motion_transfer.people.head.hair_styles import Hair
from motion_transfer.people.head.skin_atlas import head_angle

_COLUMNS, _ROWS = 72, 28
_TIED = ("ponytail", "bun", "braid")
# how far hair on the sides stands off compared with the top's
_SIDES = {"buzz": 0.9, "short": 0.42, "side_part": 0.40, "quiff": 0.30, "pixie": 0.6}


def cap_piece(hair: Hair, head: Head, limit: float | None = None) -> Piece:
    """A closed surface over the scalp.

    Args:
        limit: metres that it may stand off at most (under a hat).
    """
    rng = np.random.default_rng(hair.seed)
    angles = np.linspace(0, 2 * np.pi, _COLUMNS, endpoint=False).astype(np.float32)
    turn = np.minimum(angles, 2 * np.pi - angles)
    reach = np.interp(turn, (0, 0.8, 1.6, 2.4, np.pi), (1.55, 1.75, 2.15, 2.45, 2.4))
    rows = np.linspace(0, 1, _ROWS, dtype=np.float32)[:, None]
    plane = rays(_part(hair), angles, (0.02 + rows * reach).astype(np.float32))
    points, normals, place = head.map.at(plane)
    inside = inside_hairline(place, hair.hairline)
    off = _standing(hair, place, inside, rows * reach, rng)
    if limit is not None:
        off = np.minimum(off, limit)
    normals = _combed(hair, normals, place, inside, points - head.map.middle)
    surface = points + off[..., None] * normals
    ragged = 0.0016 * rng.standard_normal((_ROWS, _COLUMNS))
    ragged = ragged + 0.0024 * lumps(rng, _ROWS, _COLUMNS, 1.2)
    keep = inside + ragged * {"pixie": 1.5, **dict.fromkeys(_TIED, 0.6)}.get(hair.style, 1.0)
    faces, uv = grid_faces(_ROWS, _COLUMNS, closed=True)
    if hair.style in _TIED:
        uv = _uv_to_tie(plane.reshape(-1, 2)[faces], tie_place(hair))
    return Piece(
        name="hair",
        points=np.ascontiguousarray(surface.reshape(-1, 3), np.float32),
        faces=faces,
        weights=head.rigid(_ROWS * _COLUMNS),
        corner_uv=uv,
        material=hair_material(hair, (0.6, 0.2)),
        keep=keep.ravel().astype(np.float32),
        two_sided=True,  # one looks under the edge of what stands off
    )


def under_piece(hair: Hair, head: Head) -> Piece:
    """A thin layer that covers the scalp up to the hairline, under hair that is parted."""
    thin = replace(
        hair, style="side_part" if hair.part else "short", volume=0.004, curl=0.0, roots=hair.colour
    )
    return replace(cap_piece(thin, head), name="hair_under")


def hair_material(hair: Hair, size: tuple[float, float]) -> Material:
    """What this hair looks like."""
    short = hair.style == "buzz"
    tufts = 1.0 if hair.style == "afro" else max(hair.curl * 0.8, 0.8 * short)
    light = float(to_linear(hair.colour).mean())
    return Material(
        paint_hair(
            hair.colour,
            roots=hair.roots,
            grey=hair.grey,
            curl=tufts,
            tips=0.05 if short else 0.2,
            contrast=0.22 + 0.10 * hair.curl,
            relief=0.0004 if short else 0.0012 + 0.0015 * tufts,
            seed=hair.seed,
        ),
        size,
        gloss=0.02 if tufts > 0.7 else (0.035 + 0.10 * light) * (1 - 0.6 * hair.curl),
        sharpness=36.0,
        translucency=0.15,
        sheen_along_v=tufts <= 0.7,
    )


def tie_place(hair: Hair) -> tuple[float, float]:
    """Where on the head's map a tail is tied."""
    return 0.0, 2.0 - 1.5 * hair.tie


def _part(hair: Hair) -> tuple[tuple[float, float], tuple[float, float]]:
    if hair.style == "side_part":
        side = 0.42 if hair.part >= 0 else -0.42
        return (side, -0.80), (0.5 * side, 0.35)
    return (0.0, 0.15), (0.0, 0.30)


def _standing(
    hair: Hair, place: Grid3, inside: Grid, along: Grid, rng: np.random.Generator
) -> Grid:
    """Metres that the surface stands off the skin."""
    top = ramp(place[..., 2], 1.735, 1.800)
    sides = _SIDES.get(hair.style, 1.0)
    off = hair.volume * (sides + (1 - sides) * top)
    width = 0.012 if hair.style == "buzz" else 0.030
    if hair.style == "afro":
        width = 0.5 * hair.volume + 0.010
    if hair.hairline.crown > 0.2:  # thin hair lies flat
        off = np.minimum(off, 0.009)
    off = off * np.sqrt(ramp(inside, -0.006, width))
    angle = head_angle(place)
    if hair.style == "side_part":
        off = off * (0.35 + 0.65 * ramp(along, 0.0, 0.30))
        heavy = place[..., 0] * (-1 if hair.part >= 0 else 1) > 0
        off = off * np.where(heavy, 1.15, 0.8)
    if hair.style == "quiff":
        front = np.exp(-((angle / 0.9) ** 2)) * np.exp(-(((inside - 0.02) / 0.035) ** 2))
        off = off + 0.9 * hair.volume * front
    rough = 0.04 if hair.style in _TIED else 0.10 + 0.16 * hair.curl
    grain = lumps(rng, _ROWS, _COLUMNS, 0.7 + 0.5 * hair.curl)
    grain = grain + 0.8 * lumps(rng, _ROWS, _COLUMNS, 2.2)
    off = off * np.clip(1 + rough * grain, 0.4, 1.8)
    return (off + 0.0012).astype(np.float32)


def _combed(hair: Hair, normals: Grid3, place: Grid3, inside: Grid, radial: Grid3) -> Grid3:
    """The way in which hair stands off: mostly the skin's normal."""
    if hair.style == "afro":
        radial = radial / np.linalg.norm(radial, axis=-1, keepdims=True)
        normals = 0.4 * normals + 0.6 * radial
    elif hair.style == "quiff":
        front = np.exp(-((head_angle(place) / 0.9) ** 2)) * (1 - ramp(inside, 0.0, 0.06))
        normals = normals + front[..., None] * np.array([0, -0.1, 0.8], np.float32)
    else:
        return normals
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def _uv_to_tie(plane: np.ndarray, tie: tuple[float, float]) -> np.ndarray:
    """Strands run to the tie; the texture is mirrored left and right, which leaves no seam."""
    away = plane - np.array(tie, np.float32)
    u = np.abs(np.arctan2(away[..., 0], -away[..., 1])) / np.pi
    v = 1 - np.clip(np.linalg.norm(away, axis=-1) / 2.9, 0, 1)
    return np.stack([0.02 + 0.96 * u, v], -1).astype(np.float32)
