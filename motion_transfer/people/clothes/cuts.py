"""Where garments end: how far inside its edges a place on the body lies.

Everything takes places (vertices or texels alike) and returns metres on the template, positive
inside the garment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motion_transfer.people.clothes.wardrobe import Skirt, Top, Trousers

_FAR = np.float32(1.0)
_SHOULDER = 0.165  # half the breadth between the armholes on the template


@dataclass(frozen=True)
class Places:
    """Places on the body; arrays of one shape.

    Attributes:
        x, y, z: on the template, metres.
        arm, leg, below_neck: `arm_along`, `leg_along` and `below_neck` of `BodySurface`.
        on_arm: 1 on arms, 0 elsewhere.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    arm: np.ndarray
    leg: np.ndarray
    below_neck: np.ndarray
    on_arm: np.ndarray


@dataclass(frozen=True)
class Levels:
    """Heights and lengths on the template, metres: see `BodySurface`."""

    crotch: float
    waist: float
    armpit: float
    arm: float
    leg: float


def ramp(values: np.ndarray, start: float, end: float) -> np.ndarray:
    """0 at `start`, 1 at `end`, smooth between (either may be the larger)."""
    t = np.clip((values - np.float32(start)) * np.float32(1 / (end - start)), 0, 1)
    return t * t * (3 - 2 * t)


def in_front(at: Places) -> np.ndarray:
    """1 on the front of the trunk, 0 on its back, blended over the shoulders."""
    return ramp(at.y, 0.01, -0.05)


def neckline(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """Distance below the neckline."""
    if top.neck == "turtle":
        return at.below_neck + np.float32(top.neck_depth)
    if top.neck in ("off_shoulder", "straps"):
        edge = levels.armpit + 0.05 - top.neck_depth
        across = np.float32(edge) - at.z + 0.25 * np.abs(at.x) * in_front(at)
        if top.neck == "off_shoulder":
            return across
        strap = np.float32(0.012) - np.abs(np.abs(at.x) - np.float32(top.neck_width))
        return np.maximum(across, np.where(at.on_arm > 0.5, -_FAR, strap))
    q = np.minimum(np.abs(at.x) * np.float32(1 / top.neck_width), 1)
    front = in_front(at)
    if top.neck == "boat":
        return at.below_neck - np.float32(0.035) * (1 - q**4)
    shape = {
        "v": 1 - q,
        "scoop": np.sqrt(1 - q * q),
        "square": np.minimum((1 - q) * 4, 1),
        "crew": 1 - q * q,
    }[top.neck]
    back = min(top.neck_depth, 0.02)
    return at.below_neck - shape * (back + (top.neck_depth - back) * front)


def opening(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """Distance from the edge of an open front; far where there is none."""
    if top.gap <= 0:
        return np.full(at.x.shape, _FAR)
    # cloth swings apart lower down
    wider = np.clip(1 + 1.5 * (levels.armpit - at.z), 0.5, 2)
    return np.where(at.y < -0.03, np.abs(at.x) - np.float32(top.gap) * wider, _FAR)


def sleeve_end(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """Distance from the end of the sleeve, or inside the armhole where there is no sleeve."""
    arm = at.on_arm > 0.5
    if top.sleeve > 0:
        return np.where(arm, np.float32(top.sleeve * levels.arm) - at.arm, _FAR)
    inwards = ramp(at.z, levels.armpit - 0.035, levels.armpit + 0.07)
    limit = 0.215 + (_SHOULDER - top.armhole - 0.215) * inwards
    depth = limit - np.abs(at.x)
    return np.where(arm, np.minimum(depth, np.float32(-0.006)), depth)


def top_depth(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """How far inside a top, all its edges considered."""
    depth = np.minimum(neckline(top, at, levels), at.z - np.float32(levels.crotch + top.hem))
    depth = np.where(at.on_arm > 0.5, neckline(top, at, levels), depth)
    depth = np.minimum(depth, sleeve_end(top, at, levels))
    return np.minimum(depth, opening(top, at, levels))


def waistline(trousers: Trousers, at: Places, levels: Levels) -> np.ndarray:
    """Distance below the upper edge of trousers, which dips a little in front."""
    return np.float32(levels.waist + trousers.rise) + np.float32(0.1) * at.y - at.z


def trousers_depth(trousers: Trousers, at: Places, levels: Levels) -> np.ndarray:
    """How far inside trousers, the waist and the ends of the legs considered."""
    end = np.float32(trousers.length * levels.leg) - at.leg
    return np.minimum(waistline(trousers, at, levels), end)


def skirt_depth(skirt: Skirt, at: Places, levels: Levels) -> np.ndarray:
    """How far inside a skirt the skin lies; the last 6 cm above the hem count as seen."""
    below = np.where(at.arm > -0.5, -_FAR, np.float32(levels.waist + skirt.top) - at.z)
    above = np.float32(skirt.length * levels.leg - 0.06) - at.leg
    return np.where(
        at.leg > -0.5, np.minimum(below, np.maximum(above, at.z - levels.crotch)), below
    )
