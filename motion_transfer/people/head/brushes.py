"""Laying paint on a head: coverages, tints, noise, and where hair, beards and baldness lie.

Convention: images are linear RGB, plane by plane (3 x rows x columns), on which numpy is twice as
fast as on interleaved ones. Places are the template body's, in metres; heights and widths of
features were read off its face by eye.
"""

from __future__ import annotations

from functools import cache, lru_cache

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.head.faces import Hairline
from motion_transfer.people.head.skin_atlas import SkinAtlas

Grid = Float32[np.ndarray, "rows columns"]
Image = Float32[np.ndarray, "3 rows columns"]

_NOISE = 1024  # texels along each side of a tile of noise

MOUTH_Z = 1.6492
"""Height of the line between the lips."""

_FRONT_Z = 1.790  # of the hairline in the middle of an average forehead
# degrees from the front, and millimetres above that middle: over the forehead and the temples, down
# before the ear (74), over it (90), and down behind it to the nape
_LINE_DEGREES = (0, 15, 34, 48, 58, 65, 69, 74, 78, 90, 103, 112, 130, 155, 180)
_LINE_MM = (0, 1, 4, -6, -30, -60, -82, -88, -62, -54, -64, -100, -140, -158, -158)
_TEMPLES = slice(2, 5)
_RECEDE = np.array([1.0, 0.8, 0.3])  # share of receding temples at these places
_GROWTH = {
    "stubble": ("moustache", "chin", "jaw"),
    "moustache": ("moustache",),
    "goatee": ("moustache", "chin"),
    "full": ("moustache", "chin", "jaw"),
}


@cache
def _noises() -> dict[str, Float32[np.ndarray, "1024 1024"]]:
    """Draw tiles of mean 0 and deviation 1: of single texels, and of blots of several sizes."""
    rng = np.random.default_rng(20)
    fine = rng.standard_normal((_NOISE, _NOISE)).astype(np.float32)
    out = {"fine": fine}
    for name, sigma in (("pores", 0.8), ("spots", 1.3), ("blotches", 9.0)):
        # the middle of four tiles, so that a blur runs on across the edges
        soft = cv2.GaussianBlur(np.tile(fine, (2, 2)), (0, 0), sigma)[512:1536, 512:1536]
        out[name] = soft / soft.std()
    return out


def noise(name: str, seed: int, rows: int, columns: int) -> Grid:
    """Take a window out of the noise `fine`, `pores`, `spots` or `blotches`; the seed places it."""
    # two primes keep the windows of neighbouring seeds apart
    x, y = (seed * 7919) % (_NOISE - columns), (seed // 3 * 104729) % (_NOISE - rows)
    return _noises()[name][y : y + rows, x : x + columns]


def ramp(values: Grid, low: float, high: float) -> Grid:
    """Rise from 0 at `low` and before to 1 at `high` and beyond, smooth between."""
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


def hairline_height(angle: Float32[np.ndarray, " N"], line: Hairline) -> Float32[np.ndarray, " N"]:
    """Find the height at which the scalp's hair begins, by angle from the front in radians."""
    degrees = np.abs(np.degrees(angle))
    raised, back = line.raised / 1000, line.temples / 1000
    front = _FRONT_Z + raised - line.peak / 1000 * np.exp(-((degrees / 8) ** 2))
    rise = np.array(_LINE_MM) / 1000
    rise[_TEMPLES] += _RECEDE * back
    # below the temples the line keeps its place however high the front is
    keep = 1 - ramp(degrees, 40, 62)
    return (_FRONT_Z + np.interp(degrees, _LINE_DEGREES, rise) + keep * (front - _FRONT_Z)).astype(
        np.float32
    )


def bald_crown(place: Float32[np.ndarray, "*places 3"]) -> Float32[np.ndarray, " *places"]:
    """Tell how much a place belongs to the part of the scalp that goes bald, 0 .. 1."""
    aside = np.hypot(place[..., 0] / 0.064, (place[..., 1] + 0.070) / 0.105)
    return (1 - ramp(aside, 0.75, 1.1)) * (place[..., 2] > 1.76)


@lru_cache(maxsize=len(_GROWTH))  # the same for all faces, and dear
def beard_cover(beard: str, atlas: SkinAtlas) -> Grid:
    """Paint where a kind of beard grows on the unrolled head, 0 .. 1."""
    return beard_field(beard, atlas.place, atlas.angle[None])


def beard_field(
    beard: str, place: Float32[np.ndarray, "*places 3"], angle: Float32[np.ndarray, " *places"]
) -> Float32[np.ndarray, " *places"]:
    """Tell how densely a beard grows at places and their angles from the front, 0 .. 1."""
    x, z = np.abs(place[..., 0]), place[..., 2]
    degrees = np.abs(np.degrees(angle))
    mouth = np.hypot(x / 0.027, (z - MOUTH_Z + 0.0005) / 0.0125)
    around = ramp(mouth, 0.95, 1.15)  # lips stay free
    parts = []
    if "moustache" in _GROWTH[beard]:
        top = 1.6735 - 0.35 * np.maximum(x - 0.014, 0)
        parts.append(ramp(top - z, 0, 0.005) * ramp(z, 1.643, 1.650) * ramp(0.034 - x, 0, 0.006))
    if "chin" in _GROWTH[beard]:
        parts.append(ramp(1.645 - z, 0, 0.004) * ramp(0.034 - x, 0, 0.008) * ramp(z, 1.585, 1.60))
    if "jaw" in _GROWTH[beard]:
        # its upper edge runs from the corners of the mouth up to the ears
        line = np.interp(
            degrees, (0, 20, 40, 60, 70, 76, 90), (1.64, 1.645, 1.652, 1.672, 1.70, 1.72, 1.72)
        )
        neck = np.interp(degrees, (0, 60, 80), (1.592, 1.600, 1.640))
        parts.append(ramp(line - z, 0, 0.010) * ramp(z - neck, -0.006, 0.008))
    cover = np.max(parts, 0) * around * (1 - ramp(degrees, 80, 84))
    return cover.astype(np.float32)
