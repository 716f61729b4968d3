"""Lamps around a person, and the shadow that they throw on the floor.

Kinds of light, their shares and strengths were chosen by eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.body import Points
from motion_transfer.people.figure.camera import Camera

Colour = tuple[float, float, float]

CELL_METRES = 0.03
REACH_METRES = 1.3
"""The floor's shadow is worked out on cells of such a size, so far from the person to each side."""
CONTACT_METRES = 0.1
"""Below this height a body keeps ambient light off the floor as well."""
LOWEST_LAMP = 0.25
"""Sine of an elevation; lamps below it cast its shadow, as theirs would run out of the grid."""


@dataclass(frozen=True)
class Lamp:
    """A distant light.

    Attributes:
        azimuth: Radians; 0 shines from where a camera at azimuth 0 stands (-y), positive from
            the left hand (+x) of a person who faces that camera.
        elevation: Height above the horizon, radians.
        colour: Linear RGB that a white surface facing it returns.
    """

    azimuth: float
    elevation: float
    colour: Colour

    @property
    def toward(self) -> Colour:
        """Point toward the lamp, a unit vector."""
        level = np.cos(self.elevation)
        return (
            float(np.sin(self.azimuth) * level),
            float(-np.cos(self.azimuth) * level),
            float(np.sin(self.elevation)),
        )


@dataclass(frozen=True)
class Light:
    """All light that reaches a person.

    Attributes:
        lamps: 1 to 3; the first is the key, and the only one that casts a shadow.
        sky, ground: Ambient light from above and from below.
        softness_metres: How far the edge of the key's shadow is smeared.
        occlusion: How dark folds and gaps become, 0..1.
    """

    lamps: tuple[Lamp, ...]
    sky: Colour
    ground: Colour
    softness_metres: float = 0.04
    occlusion: float = 0.8


def sample_light(rng: np.random.Generator) -> Light:
    """Draw studio light, window light, sun or an overcast sky, their white near neutral."""
    kind = rng.choice(["studio", "window", "sun", "overcast"], p=[0.5, 0.2, 0.15, 0.15])
    warmth = rng.normal(0, 0.035)
    # harsher light has more of its strength in one lamp
    key_share = {"studio": 0.5, "window": 0.65, "sun": 0.85, "overcast": 0.3}[kind]
    key_share += rng.uniform(-0.1, 0.1)
    total = rng.uniform(0.98, 1.22)  # of key and sky together
    side = rng.choice([-1.0, 1.0])
    azimuth = side * rng.uniform(0.15, 0.9 if kind == "studio" else 1.25)
    lamps = [Lamp(azimuth, rng.uniform(0.45, 1.05), _tinted(total * key_share, warmth))]
    if kind in ("studio", "window"):
        fill = total * rng.uniform(0.08, 0.3)
        lamps.append(Lamp(-side * rng.uniform(0.5, 1.2), rng.uniform(0, 0.6), _tinted(fill, 0)))
    if kind == "studio" and rng.random() < 0.4:
        rim = total * rng.uniform(0.15, 0.5)
        lamps.append(Lamp(side * rng.uniform(2.2, 2.9), rng.uniform(0.3, 0.8), _tinted(rim, 0)))
    ambient = total * (1.02 - key_share)
    ground = rng.uniform(0.45, 0.85)
    softness = {"studio": 0.07, "window": 0.05, "sun": 0.015, "overcast": 0.15}[kind]
    return Light(
        lamps=tuple(lamps),
        sky=_tinted(ambient, -0.5 * warmth),
        ground=_tinted(ambient * ground, warmth),
        softness_metres=softness * rng.uniform(0.7, 1.4),
        occlusion=rng.uniform(0.6, 0.95),
    )


def _tinted(amount: float, warmth: float) -> Colour:
    """Make a colour of an intensity; warmth > 0 is towards red."""
    return (amount * (1 + warmth), amount, amount * (1 - warmth))


def floor_shadow(points: Points, camera: Camera, light: Light) -> Float32[np.ndarray, "H W"]:
    """Find the share of the floor's light that a body on z = 0 takes away, seen by a camera.

    The body's vertices are dropped along the key lamp's rays (and, near the floor, straight down)
    into a grid on the floor, and blurred; a homography takes the grid to the picture.
    """
    lamp = light.lamps[0]
    x, y, z = lamp.toward
    fallen = points[:, :2] - points[:, 2:] * (np.array([x, y], np.float32) / max(z, LOWEST_LAMP))
    middle = points[:, :2].mean(0)
    cells = round(2 * REACH_METRES / CELL_METRES)
    low = points[:, 2] < CONTACT_METRES
    cast = _grid(fallen - middle, cells, 0.03 + 2 * light.softness_metres)
    contact = _grid(points[low, :2] - middle, cells, 0.03)
    share = sum(lamp.colour) / (sum(lamp.colour) + sum(light.sky))
    ring = np.linspace(-1, 1, cells, dtype=np.float32)
    fade = np.clip(1.5 * (1 - np.hypot(ring, ring[:, None])), 0, 1)  # no edge where the grid ends
    # neither takes all: some light comes back from the room
    taken = 1 - (1 - 0.9 * share * cast * fade) * (1 - 0.75 * contact)

    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32) * REACH_METRES
    corners[:, :2] += middle
    seen = camera.project(corners)[:, :2]
    square = np.array([[0, 0], [cells, 0], [cells, cells], [0, cells]], np.float32)
    to_picture = cv2.getPerspectiveTransform(square, seen.astype(np.float32))
    return cv2.warpPerspective(
        taken.astype(np.float32), to_picture, (camera.width, camera.height), flags=cv2.INTER_LINEAR
    )


def _grid(
    places: Float32[np.ndarray, "N 2"], cells: int, blur_metres: float
) -> Float32[np.ndarray, "cells cells"]:
    """Measure how densely places (metres from the middle) cover the grid's cells, 0..1."""
    index = ((places + REACH_METRES) / CELL_METRES).astype(np.int32)
    inside = ((index >= 0) & (index < cells)).all(1)
    flat = index[inside, 1] * cells + index[inside, 0]
    count = np.bincount(flat, minlength=cells * cells).reshape(cells, cells).astype(np.float32)
    # vertices lie further apart than cells in places
    filled = cv2.dilate(np.minimum(count, 1), np.ones((3, 3), np.uint8))
    return np.clip(cv2.GaussianBlur(filled, (0, 0), blur_metres / CELL_METRES), 0, 1)
