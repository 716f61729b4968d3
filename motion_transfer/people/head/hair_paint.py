"""Textures of hair: strands that run down the texture, and curls."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.head.brushes import ramp, to_linear
from motion_transfer.people.head.faces import GREY, Colour

COLUMNS, ROWS = 256, 96


@cache
def _strands() -> Float32[np.ndarray, "192 2048"]:
    """Streaks of several widths along v, deviation about 1; wraps around in u."""
    rng = np.random.default_rng(31)
    total = np.zeros((192, 2048), np.float32)
    for across, along, amount in ((0.7, 40, 0.55), (2.0, 60, 0.75), (6.0, 90, 0.55)):
        grain = rng.standard_normal((192, 2048)).astype(np.float32)
        wide = np.tile(grain, (3, 3))[:, 1024:5120]
        soft = cv2.GaussianBlur(wide, (0, 0), sigmaX=across, sigmaY=along)[192:384, 1024:3072]
        total += amount * soft / soft.std()
    return total / total.std()


@cache
def _single_hairs() -> Float32[np.ndarray, "192 2048"]:
    """Only the thinnest streaks, deviation 1."""
    grain = np.random.default_rng(33).standard_normal((1, 2048)).astype(np.float32)
    return np.repeat(grain, 192, 0)


@cache
def _curls() -> Float32[np.ndarray, "192 2048"]:
    """Small tufts, deviation about 1."""
    rng = np.random.default_rng(32)
    total = np.zeros((192, 2048), np.float32)
    for size, amount in ((1.2, 0.6), (3.0, 0.9), (6.0, 0.4)):
        grain = np.tile(rng.standard_normal((192, 2048)).astype(np.float32), (2, 2))
        soft = cv2.GaussianBlur(grain, (0, 0), size)[96:288, 1024:3072]
        total += amount * soft / soft.std()
    return total / total.std()


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
    """Hair of a colour (sRGB): columns are strands, rows go from the roots to the tips.

    Args:
        roots: colour at the roots, where it differs.
        tips: how much lighter the tips are.
        grey: share of grey strands.
        curl: 0 smooth strands .. 1 tufts.
        contrast: of light and dark strands.
        relief: metres.
    """
    x, y = (seed * 7919) % (2048 - COLUMNS), (seed * 31) % (192 - ROWS)
    window = (slice(y, y + ROWS), slice(x, x + COLUMNS))
    streaks = (1 - curl) * _strands()[window] + curl * _curls()[window]
    v = ((np.arange(ROWS) + 0.5) / ROWS).astype(np.float32)[:, None]
    base = np.broadcast_to(to_linear(colour), (ROWS, COLUMNS, 3)).astype(np.float32)
    if roots is not None:
        base = base + (1 - ramp(v, 0.02, 0.16))[..., None] * (to_linear(roots) - base)
    if grey > 0:
        base = base + 0.15 * ramp(_single_hairs()[window], 1.2 - 3 * grey, 2.4 - 3 * grey)[
            ..., None
        ] * (to_linear(GREY) - base)
    shade = np.exp(contrast * streaks) * (0.72 + 0.28 * ramp(v, 0.0, 0.22)) * (1 + tips * v)
    texture = np.empty((ROWS, COLUMNS, 4), np.float32)
    texture[..., :3] = np.clip(base * shade[..., None], 0, 0.9)
    texture[..., 3] = relief * streaks
    return texture
