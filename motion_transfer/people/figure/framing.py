"""Pointing a camera so that the wanted part of a person fills the picture."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float32, Float64

from motion_transfer.people.figure.body import Skeleton
from motion_transfer.people.figure.camera import Camera

Framing = Literal["full", "three-quarters", "upper"]
FRAMINGS: tuple[str, ...] = get_args(Framing)
"""The whole body; down to the knees; down to the hips."""

LOWEST: dict[str, tuple[str, ...]] = {
    "full": (),
    "three-quarters": ("lowerleg01.L", "lowerleg01.R"),
    "upper": ("upperleg01.L", "upperleg01.R"),
}
"""Joints at whose height the picture ends below."""


def lowest_in(
    joints: Float64[np.ndarray, "bones 3"], skeleton: Skeleton, framing: Framing
) -> float:
    """The height at which a framing cuts a body with those joints off; -inf for the whole body."""
    heights = [joints[skeleton.index[name], 2] for name in LOWEST[framing]]
    return float(max(heights, default=-np.inf))


def frame_points(
    points: Float32[np.ndarray, "V 3"],
    size: tuple[int, int],
    *,
    distance: float,
    azimuth: float = 0.0,
    elevation: float = 0.0,
    roll: float = 0.0,
    margin: float = 0.06,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Camera:
    """A camera whose picture the points fill, but for a margin.

    Args:
        points: what has to be seen, world, metres.
        size: (width, height) of the picture in px.
        distance: from the middle of the points, metres.
        margin: share of the picture left free on each side, at least.
        shift: of the picture's centre within the free space, each in [-1, 1]; 0 is centred.
    """
    middle = (points.min(0) + points.max(0)) / 2
    camera = Camera(*size, 1.0, distance, _place(middle), azimuth, elevation, roll)
    for _ in range(2):  # aiming changes the perspective a little
        seen = camera.project(points)[:, :2] - np.array(size) / 2
        low, high = seen.min(0), seen.max(0)
        aim = np.asarray(camera.target) + ((low + high) / 2 * distance) @ camera.axes[:2]
        camera = replace(camera, target=_place(aim))
    seen = camera.project(points)[:, :2] - np.array(size) / 2
    half = np.abs(seen).max(0)
    room = np.array(size) * (0.5 - margin)
    focal = float((room / half).min())
    free = (np.array(size) * 0.5 - half * focal).clip(0) * np.array(shift) * distance / focal
    aim = np.asarray(camera.target) - free @ camera.axes[:2]
    return replace(camera, focal_px=focal, target=_place(aim))


def _place(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
