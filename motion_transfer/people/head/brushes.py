"""Laying paint on textures: coverages, tints and noise.

Images are linear RGB, plane by plane (3 x rows x columns): numpy is twice as fast on those as on
interleaved ones.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.head.faces import Colour

Grid = Float32[np.ndarray, "rows columns"]
Image = Float32[np.ndarray, "3 rows columns"]

_NOISE = 1024


def to_linear(colour: Colour) -> Float32[np.ndarray, " 3"]:
    """sRGB to linear RGB."""
    rgb = np.asarray(colour, np.float32)
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


@cache
def _noises() -> dict[str, Float32[np.ndarray, "1024 1024"]]:
    """Tiles of noise with mean 0 and deviation 1: of single texels, and of blotches."""
    rng = np.random.default_rng(20)
    fine = rng.standard_normal((_NOISE, _NOISE)).astype(np.float32)
    out = {"fine": fine}
    for name, sigma in (("pores", 0.8), ("spots", 1.3), ("blotches", 9.0)):
        soft = cv2.GaussianBlur(np.tile(fine, (2, 2)), (0, 0), sigma)[512:1536, 512:1536]
        out[name] = soft / soft.std()
    return out


def noise(name: str, seed: int, rows: int, columns: int) -> Grid:
    """A window of a noise tile; which one, the seed says."""
    x, y = (seed * 7919) % (_NOISE - columns), (seed // 3 * 104729) % (_NOISE - rows)
    return _noises()[name][y : y + rows, x : x + columns]


def ramp(values: Grid, low: float, high: float) -> Grid:
    """0 at `low` and before, 1 at `high` and beyond, smooth between."""
    t = np.clip((values - np.float32(low)) * np.float32(1 / (high - low)), 0, 1)
    return t * t * (3 - 2 * t)


def lay(image: Image, paint: Float32[np.ndarray, " 3"], coverage: Grid) -> None:
    """Lay a paint over an image, in place."""
    for plane, value in zip(image, paint, strict=True):
        plane += coverage * (value - plane)


def tint(image: Image, factor: tuple[float, float, float], strength: Grid) -> None:
    """Multiply an image by a colour, in place: by the whole of it where the strength is 1."""
    for plane, value in zip(image, factor, strict=True):
        if value != 1:
            plane *= 1 + np.float32(value - 1) * strength
