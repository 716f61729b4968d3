"""Hair that lies on the head, and what hair looks like.

Short cuts, afros, and what is tied back are one closed surface over the scalp. Its texture, as that
of all other hair, shows strands that run down it, or curls. Sizes are metres, chosen by eye.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.head.brushes import ramp
from motion_transfer.people.head.faces import GREY, Colour
from motion_transfer.people.head.hair.grid import (
    Grid,
    Grid3,
    Head,
    Parting,
    grid_piece,
    inside_hairline,
    lumps,
    rays,
)
from motion_transfer.people.head.hair.styles import Hair
from motion_transfer.people.head.skin_atlas import head_angle, unit
from motion_transfer.people.picture.paint import to_linear

_COLUMNS, _ROWS = 72, 28  # of the cap
_TIED = ("ponytail", "bun", "braid")
# how far hair on the sides stands off compared with the top's
_SIDES = {"buzz": 0.9, "short": 0.42, "side_part": 0.40, "quiff": 0.30, "pixie": 0.6}

_TEXTURE = (96, 256)  # rows, columns
_TILE = (192, 2048)  # what textures are windows of
# layers of a tile: how far its grain is smeared across and along strands, texels, and its strength
_STRANDS = ((0.7, 40, 0.55), (2.0, 60, 0.75), (6.0, 90, 0.55))
_CURLS = ((1.2, 1.2, 0.6), (3.0, 3.0, 0.9), (6.0, 6.0, 0.4))


def cap_piece(hair: Hair, head: Head, limit: float | None = None) -> Piece:
    """Make a closed surface over the scalp.

    Args:
        limit: Metres that it may stand off at most (under a hat).
    """
    rng = np.random.default_rng(hair.seed)
    angles = np.linspace(0, 2 * np.pi, _COLUMNS, endpoint=False).astype(np.float32)
    turn = np.minimum(angles, 2 * np.pi - angles)
    # columns run past the hairline all around; `keep` cuts them there
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
    # a hairline is ragged by a millimetre or two, less so where hair is drawn back
    ragged = 0.0016 * rng.standard_normal((_ROWS, _COLUMNS))
    ragged = ragged + 0.0024 * lumps(rng, _ROWS, _COLUMNS, 1.2)
    keep = inside + ragged * {"pixie": 1.5, **dict.fromkeys(_TIED, 0.6)}.get(hair.style, 1.0)
    piece = grid_piece("hair", head, surface, keep, hair_material(hair, (0.6, 0.2)))
    if hair.style in _TIED:
        uv = _uv_to_tie(plane.reshape(-1, 2)[piece.faces], tie_place(hair))
        piece = replace(piece, corner_uv=uv)
    return piece


def under_piece(hair: Hair, head: Head) -> Piece:
    """Make a thin layer that covers the scalp up to the hairline, under hair that is parted."""
    thin = replace(
        hair, style="side_part" if hair.part else "short", volume=0.004, curl=0.0, roots=hair.colour
    )
    return replace(cap_piece(thin, head), name="hair_under")


def tie_place(hair: Hair) -> tuple[float, float]:
    """Find where on the head's map a tail is tied, from the nape (2.0) up to the crown (0.5)."""
    return 0.0, 2.0 - 1.5 * hair.tie


def _part(hair: Hair) -> Parting:
    if hair.style == "side_part":
        side = 0.42 if hair.part >= 0 else -0.42
        return (side, -0.80), (0.5 * side, 0.35)
    return (0.0, 0.15), (0.0, 0.30)


def _standing(
    hair: Hair, place: Grid3, inside: Grid, along: Grid, rng: np.random.Generator
) -> Grid:
    """Measure metres that the surface stands off the skin."""
    top = ramp(place[..., 2], 1.735, 1.800)
    sides = _SIDES.get(hair.style, 1.0)
    off = hair.volume * (sides + (1 - sides) * top)
    width = 0.012 if hair.style == "buzz" else 0.030  # over which hair rises from the hairline
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
    """Find the way in which hair stands off: mostly the skin's normal."""
    if hair.style == "afro":
        return unit(0.4 * normals + 0.6 * unit(radial))
    if hair.style == "quiff":
        front = np.exp(-((head_angle(place) / 0.9) ** 2)) * (1 - ramp(inside, 0.0, 0.06))
        return unit(normals + front[..., None] * np.array([0, -0.1, 0.8], np.float32))
    return normals


def _uv_to_tie(plane: np.ndarray, tie: tuple[float, float]) -> np.ndarray:
    """Let strands run to the tie; mirrored left and right, the texture has no seam."""
    away = plane - np.array(tie, np.float32)
    u = np.abs(np.arctan2(away[..., 0], -away[..., 1])) / np.pi
    v = 1 - np.clip(np.linalg.norm(away, axis=-1) / 2.9, 0, 1)  # no hair is further away
    return np.stack([0.02 + 0.96 * u, v], -1).astype(np.float32)


def paint_hair(
    colour: Colour,
    *,
    roots: Colour | None = None,
    tips: float = 0.15,
    grey: float = 0.0,
    curl: float = 0.0,
    contrast: float = 0.28,
    relief: float = 0.0012,
    seed: int = 0,
) -> Float32[np.ndarray, "rows columns 4"]:
    """Paint hair of a colour (sRGB): columns are strands, rows go from the roots to the tips.

    Args:
        roots: Colour at the roots, where it differs.
        tips: How much lighter the tips are.
        grey: Share of grey strands.
        curl: 0 smooth strands .. 1 tufts.
        contrast: How far light and dark strands are apart.
        relief: Height of strands, metres.
    """
    rows, columns = _TEXTURE
    # a prime step keeps the windows of neighbouring seeds apart
    x, y = (seed * 7919) % (_TILE[1] - columns), (seed * 31) % (_TILE[0] - rows)
    window = (slice(y, y + rows), slice(x, x + columns))
    strands, curls = _tile(31, _STRANDS, 192, 2048)[window], _tile(32, _CURLS, 96, 1024)[window]
    streaks = (1 - curl) * strands + curl * curls
    v = ((np.arange(rows) + 0.5) / rows).astype(np.float32)[:, None]
    base = np.broadcast_to(to_linear(colour), (rows, columns, 3)).astype(np.float32)
    if roots is not None:
        base = base + (1 - ramp(v, 0.02, 0.16))[..., None] * (to_linear(roots) - base)
    if grey > 0:  # the larger its share, the more of the streaks are grey
        single = ramp(_single_hairs()[:, window[1]], 1.2 - 3 * grey, 2.4 - 3 * grey)
        base = base + 0.15 * single[..., None] * (to_linear(GREY) - base)
    # roots lie in the shade of what grows above them
    shade = np.exp(contrast * streaks) * (0.72 + 0.28 * ramp(v, 0.0, 0.22)) * (1 + tips * v)
    texture = np.empty((rows, columns, 4), np.float32)
    texture[..., :3] = np.clip(base * shade[..., None], 0, 0.9)
    texture[..., 3] = relief * streaks
    return texture


def hair_material(hair: Hair, size: tuple[float, float]) -> Material:
    """Make the material of this hair; tufts are dull, smooth strands shine, light ones most."""
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


@cache
def _tile(
    seed: int, layers: tuple[tuple[float, float, float], ...], top: int, left: int
) -> Float32[np.ndarray, "192 2048"]:
    """Draw smeared grain that repeats without a seam, deviation 1.

    Args:
        top, left: Where the tile begins in nine copies of the grain; well inside them, so that
            the smear runs on across its edges.
    """
    rng = np.random.default_rng(seed)
    total = np.zeros(_TILE, np.float32)
    for across, along, amount in layers:
        grain = np.tile(rng.standard_normal(_TILE).astype(np.float32), (3, 3))
        soft = cv2.GaussianBlur(grain, (0, 0), sigmaX=across, sigmaY=along)
        soft = soft[top : top + _TILE[0], left : left + _TILE[1]]
        total += amount * soft / soft.std()
    return total / total.std()


@cache
def _single_hairs() -> Float32[np.ndarray, "1 2048"]:
    """Draw only the thinnest streaks, deviation 1, the same all along."""
    return np.random.default_rng(33).standard_normal((1, _TILE[1])).astype(np.float32)
