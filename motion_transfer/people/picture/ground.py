"""The shadow that a person throws on the floor."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.body import Points
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.picture.light import Light

CELL_METRES = 0.03
REACH_METRES = 1.3
CONTACT_METRES = 0.1
"""Below this height a body keeps ambient light off the floor as well."""


def floor_shadow(points: Points, camera: Camera, light: Light) -> Float32[np.ndarray, "H W"]:
    """Share of the floor's light that a body standing on z = 0 takes away, seen by a camera.

    The body's vertices are dropped along the key lamp's rays (and, near the floor, straight down)
    into a grid on the floor, and blurred; a homography takes the grid to the picture.
    """
    lamp = light.lamps[0]
    x, y, z = lamp.toward
    fallen = points[:, :2] - points[:, 2:] * (np.array([x, y], np.float32) / max(z, 0.25))
    middle = points[:, :2].mean(0)
    cells = round(2 * REACH_METRES / CELL_METRES)
    low = points[:, 2] < CONTACT_METRES
    cast = _grid(fallen - middle, cells, 0.03 + 2 * light.softness_metres)
    contact = _grid(points[low, :2] - middle, cells, 0.03)
    share = sum(lamp.colour) / (sum(lamp.colour) + sum(light.sky))
    ring = np.linspace(-1, 1, cells, dtype=np.float32)
    fade = np.clip(1.5 * (1 - np.hypot(ring, ring[:, None])), 0, 1)  # no edge where the grid ends
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
    """How densely places (metres from the middle) cover the cells of the grid, 0..1."""
    index = ((places + REACH_METRES) / CELL_METRES).astype(np.int32)
    inside = ((index >= 0) & (index < cells)).all(1)
    flat = index[inside, 1] * cells + index[inside, 0]
    count = np.bincount(flat, minlength=cells * cells).reshape(cells, cells).astype(np.float32)
    filled = cv2.dilate(np.minimum(count, 1), np.ones((3, 3), np.uint8))
    return np.clip(cv2.GaussianBlur(filled, (0, 0), blur_metres / CELL_METRES), 0, 1)
