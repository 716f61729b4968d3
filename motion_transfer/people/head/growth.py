"""Where on the head hair grows: the scalp's hairline, bald crowns and beards.

Places are the template body's, in metres.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Float32

from motion_transfer.people.head.brushes import Grid, ramp
from motion_transfer.people.head.faces import Hairline
from motion_transfer.people.head.skin_atlas import SkinAtlas

MOUTH_Z = 1.6492  # the line between the lips
_GROWTH = {
    "stubble": ("moustache", "chin", "jaw"),
    "moustache": ("moustache",),
    "goatee": ("moustache", "chin"),
    "full": ("moustache", "chin", "jaw"),
}
_COVERS: WeakKeyDictionary[SkinAtlas, dict[str, Grid]] = WeakKeyDictionary()


def hairline_height(angle: Float32[np.ndarray, " N"], line: Hairline) -> Float32[np.ndarray, " N"]:
    """Height (template, metres) at which the scalp's hair begins, by angle from the front."""
    degrees = np.abs(np.degrees(angle))
    raised, back = line.raised / 1000, line.temples / 1000
    front = 1.790 + raised - line.peak / 1000 * np.exp(-((degrees / 8) ** 2))
    knots = (
        (0, 0.0),
        (15, 0.001),
        (34, 0.004 + back),
        (48, -0.006 + 0.8 * back),
        (58, -0.030 + 0.3 * back),
        (65, -0.060),
        (69, -0.082),
        (74, -0.088),
        (78, -0.062),
        (90, -0.054),
        (103, -0.064),
        (112, -0.100),
        (130, -0.140),
        (155, -0.158),
        (180, -0.158),
    )
    at, drop = np.array(knots).T
    # below the temples the line keeps its place however high the front is
    keep = 1 - ramp(degrees, 40, 62)
    return (1.790 + np.interp(degrees, at, drop) + keep * (front - 1.790)).astype(np.float32)


def bald_crown(place: Float32[np.ndarray, "*places 3"]) -> Float32[np.ndarray, " *places"]:
    """How much a place (template) belongs to the part of the scalp that goes bald, 0 .. 1."""
    aside = np.hypot(place[..., 0] / 0.064, (place[..., 1] + 0.070) / 0.105)
    return (1 - ramp(aside, 0.75, 1.1)) * (place[..., 2] > 1.76)


def beard_cover(beard: str, atlas: SkinAtlas) -> Grid:
    """Where a beard of a kind grows on the unrolled head, 0 .. 1."""
    covers = _COVERS.get(atlas)
    if covers is None:
        covers = _COVERS[atlas] = {
            kind: beard_field(kind, atlas.place, atlas.angle[None]) for kind in _GROWTH
        }
    return covers[beard]


def beard_field(
    beard: str, place: Float32[np.ndarray, "*places 3"], angle: Float32[np.ndarray, " *places"]
) -> Float32[np.ndarray, " *places"]:
    """How densely a beard grows at places on the template, 0 .. 1."""
    x, z = np.abs(place[..., 0]), place[..., 2]
    degrees = np.abs(np.degrees(angle))
    mouth = np.hypot(x / 0.027, (z - MOUTH_Z + 0.0005) / 0.0125)
    around = ramp(mouth, 0.95, 1.15)
    parts = []
    if "moustache" in _GROWTH[beard]:
        top = 1.6735 - 0.35 * np.maximum(x - 0.014, 0)
        parts.append(ramp(top - z, 0, 0.005) * ramp(z, 1.643, 1.650) * ramp(0.034 - x, 0, 0.006))
    if "chin" in _GROWTH[beard]:
        parts.append(ramp(1.645 - z, 0, 0.004) * ramp(0.034 - x, 0, 0.008) * ramp(z, 1.585, 1.60))
    if "jaw" in _GROWTH[beard]:
        line = np.interp(
            degrees, (0, 20, 40, 60, 70, 76, 90), (1.64, 1.645, 1.652, 1.672, 1.70, 1.72, 1.72)
        )
        neck = np.interp(degrees, (0, 60, 80), (1.592, 1.600, 1.640))
        side = ramp(line - z, 0, 0.010) * ramp(z - neck, -0.006, 0.008)
        parts.append(side)
    cover = np.max(parts, 0) * around * (1 - ramp(degrees, 80, 84))
    return cover.astype(np.float32)
