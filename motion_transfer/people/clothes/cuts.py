"""Where garments end: how far inside its edges a place on the body lies.

Everything takes places (vertices or texels alike) and returns metres on the template, positive
inside the garment. Bare numbers are metres, or slopes of an edge, drawn by eye.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from motion_transfer.people.clothes.wardrobe import Skirt, Top, Trousers

_FAR = np.float32(1.0)  # inside of an edge that is not there
_SHOULDER = 0.165  # half the breadth between the armholes on the template


class Places(NamedTuple):
    """Places on the body; float32 arrays of one shape.

    Attributes:
        x, y, z: On the template, metres.
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

    def part(self, at: Any) -> Places:
        """Take some of the places; `at` indexes arrays."""
        return Places(*(field[at] for field in self))


@dataclass(frozen=True)
class Levels:
    """Heights and lengths on the template, metres: see `BodySurface`."""

    crotch: float
    waist: float
    armpit: float
    arm: float
    leg: float


def ramp(values: np.ndarray, start: float, end: float) -> np.ndarray:
    """Rise smoothly from 0 at `start` to 1 at `end` (either may be the larger)."""
    t = np.clip((values - np.float32(start)) * np.float32(1 / (end - start)), 0, 1)
    return t * t * (3 - 2 * t)


def neckline(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """Measure how far below the neckline places lie."""
    front = ramp(at.y, 0.01, -0.05)  # 0 on the back of the trunk, blended over the shoulders
    if top.neck == "turtle":
        return at.below_neck + np.float32(top.neck_depth)
    if top.neck in ("off_shoulder", "straps"):
        edge = levels.armpit + 0.05 - top.neck_depth
        across = np.float32(edge) - at.z + 0.25 * np.abs(at.x) * front
        if top.neck == "off_shoulder":
            return across
        strap = np.float32(0.012) - np.abs(np.abs(at.x) - np.float32(top.neck_width))
        return np.maximum(across, np.where(at.on_arm > 0.5, -_FAR, strap))
    q = np.minimum(np.abs(at.x) * np.float32(1 / top.neck_width), 1)  # 1 at the neckline's sides
    if top.neck == "boat":
        return at.below_neck - np.float32(0.035) * (1 - q**4)
    shape = {
        "v": 1 - q,
        "scoop": np.sqrt(1 - q * q),
        "square": np.minimum((1 - q) * 4, 1),
        "crew": 1 - q * q,
    }[top.neck]
    back = min(top.neck_depth, 0.02)  # however deep it is in front
    return at.below_neck - shape * (back + (top.neck_depth - back) * front)


def opening(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """Measure the distance from the edge of an open front; far where there is none."""
    if top.gap <= 0:
        return np.full(at.x.shape, _FAR)
    # cloth swings apart lower down
    wider = np.clip(1 + 1.5 * (levels.armpit - at.z), 0.5, 2)
    return np.where(at.y < -0.03, np.abs(at.x) - np.float32(top.gap) * wider, _FAR)


def _sleeve_end(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """Measure the distance from the end of the sleeve, or inside the armhole of a top without."""
    arm = at.on_arm > 0.5
    if top.sleeve > 0:
        return np.where(arm, np.float32(top.sleeve * levels.arm) - at.arm, _FAR)
    inwards = ramp(at.z, levels.armpit - 0.035, levels.armpit + 0.07)
    # from outside of the chest below the armpit in to the shoulder
    limit = 0.215 + (_SHOULDER - top.armhole - 0.215) * inwards
    depth = limit - np.abs(at.x)
    return np.where(arm, np.minimum(depth, np.float32(-0.006)), depth)


def top_depth(top: Top, at: Places, levels: Levels) -> np.ndarray:
    """Measure how far inside a top places lie, all its edges considered."""
    neck = neckline(top, at, levels)
    depth = np.minimum(neck, at.z - np.float32(levels.crotch + top.hem))
    depth = np.where(at.on_arm > 0.5, neck, depth)  # a lowered arm is not cut by the hem
    depth = np.minimum(depth, _sleeve_end(top, at, levels))
    return np.minimum(depth, opening(top, at, levels))


def waistline(trousers: Trousers, at: Places, levels: Levels) -> np.ndarray:
    """Measure how far below the upper edge of trousers places lie; it dips a little in front."""
    return np.float32(levels.waist + trousers.rise) + np.float32(0.1) * at.y - at.z


def trousers_depth(trousers: Trousers, at: Places, levels: Levels) -> np.ndarray:
    """Measure how far inside trousers places lie, between the waist and the ends of the legs."""
    end = np.float32(trousers.length * levels.leg) - at.leg
    return np.minimum(waistline(trousers, at, levels), end)


def skirt_depth(skirt: Skirt, at: Places, levels: Levels) -> np.ndarray:
    """Measure how far inside a skirt the skin lies; the last 6 cm above the hem count as seen."""
    # lengths along a limb are -1 away from it
    below = np.where(at.arm > -0.5, -_FAR, np.float32(levels.waist + skirt.top) - at.z)
    above = np.float32(skirt.length * levels.leg - 0.06) - at.leg
    on_leg = np.minimum(below, np.maximum(above, at.z - levels.crotch))
    return np.where(at.leg > -0.5, on_leg, below)
