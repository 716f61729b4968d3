"""A pinhole camera, and how it is pointed so that the wanted part of a person fills the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float64

from motion_transfer.errors import InputError
from motion_transfer.people.figure.body import Points, Skeleton

Framing = Literal["full", "three-quarters", "upper"]
FRAMINGS: tuple[str, ...] = get_args(Framing)
"""The whole body; down to the knees; down to the hips."""

_LOWEST: dict[str, tuple[str, ...]] = {
    "full": (),
    "three-quarters": ("lowerleg01.L", "lowerleg01.R"),
    "upper": ("upperleg01.L", "upperleg01.R"),
}
"""Joints at whose height the picture ends below."""


@dataclass(frozen=True)
class Camera:
    """Where the camera stands and what it sees.

    Convention: the world is that of `body.py` (metres, z up). Pixel centres lie at +0.5, x to the
    right, y down. The camera looks at `target` from `distance` metres away; at azimuth 0 it stands
    at -y, in front of a person who faces -y, and positive azimuth moves it towards that person's
    left hand (+x); positive elevation moves it up. All angles are radians.

    Attributes:
        width, height: Of the picture, pixels.
        focal_px: The focal length in pixels.
        roll: Turns the picture clockwise.
    """

    width: int
    height: int
    focal_px: float
    distance: float
    target: tuple[float, float, float]
    azimuth: float = 0.0
    elevation: float = 0.0
    roll: float = 0.0

    @cached_property
    def axes(self) -> Float64[np.ndarray, "3 3"]:
        """Rows: to the right of the picture, down, and into it."""
        ca, sa = np.cos(self.azimuth), np.sin(self.azimuth)
        ce, se = np.cos(self.elevation), np.sin(self.elevation)
        into = np.array([-sa * ce, ca * ce, -se])
        right = np.array([ca, sa, 0.0])
        down = np.array([sa * se, -ca * se, -ce])  # into x right
        cr, sr = np.cos(self.roll), np.sin(self.roll)
        return np.stack([cr * right - sr * down, cr * down + sr * right, into])

    @property
    def position(self) -> Float64[np.ndarray, 3]:
        """The place where it stands."""
        return np.asarray(self.target) - self.distance * self.axes[2]

    def project(self, points: Points) -> Points:
        """Turn points of the world into pixel x and y, and depth along the view in metres."""
        axes = self.axes
        seen = (points @ axes.T.astype(np.float32)) - (axes @ self.position).astype(np.float32)
        scale = self.focal_px / seen[:, 2]
        seen[:, 0] = seen[:, 0] * scale + self.width / 2
        seen[:, 1] = seen[:, 1] * scale + self.height / 2
        return seen

    def scaled(self, factor: int) -> Camera:
        """Give the same view `factor` times as many pixels along each side."""
        return replace(
            self,
            width=self.width * factor,
            height=self.height * factor,
            focal_px=self.focal_px * factor,
        )


def check_size(size: tuple[int, int], least: int, most: int) -> None:
    """Raise InputError for a picture with a side out of its range, in px."""
    if not all(least <= side <= most for side in size):
        raise InputError(f"size {size[0]}x{size[1]}; each side must lie in {least}..{most} px")


def lowest_in(
    joints: Float64[np.ndarray, "bones 3"], skeleton: Skeleton, framing: Framing
) -> float:
    """Tell at which height a framing cuts a body with those joints off; -inf: it is seen whole."""
    heights = [joints[skeleton.index[name], 2] for name in _LOWEST[framing]]
    return float(max(heights, default=-np.inf))


def frame_points(
    points: Points,
    size: tuple[int, int],
    *,
    distance: float,
    azimuth: float = 0.0,
    elevation: float = 0.0,
    roll: float = 0.0,
    margin: float = 0.06,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Camera:
    """Point a camera so that points fill its picture, but for a margin.

    Args:
        points: What has to be seen, world, metres.
        size: (width, height) of the picture in px.
        distance: From the middle of the points, metres.
        margin: The share of the picture left free on each side, at least.
        shift: Of the picture's centre within the free space, each in [-1, 1]; 0 is centred.
    """
    centre, middle = np.array(size) / 2, (points.min(0) + points.max(0)) / 2
    # a focal length of 1 px: what is seen then are directions, to be aimed at and scaled
    camera = Camera(*size, 1.0, distance, _place(middle), azimuth, elevation, roll)
    for _ in range(2):  # aiming changes the perspective a little
        seen = camera.project(points)[:, :2] - centre
        low, high = seen.min(0), seen.max(0)
        aim = np.asarray(camera.target) + ((low + high) / 2 * distance) @ camera.axes[:2]
        camera = replace(camera, target=_place(aim))
    half = np.abs(camera.project(points)[:, :2] - centre).max(0)
    focal = float((np.array(size) * (0.5 - margin) / half).min())
    free = (np.array(size) * 0.5 - half * focal).clip(0) * np.array(shift) * distance / focal
    aim = np.asarray(camera.target) - free @ camera.axes[:2]
    return replace(camera, focal_px=focal, target=_place(aim))


def _place(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
