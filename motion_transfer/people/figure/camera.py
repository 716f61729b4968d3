"""A pinhole camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float32, Float64


@dataclass(frozen=True)
class Camera:
    """Where the camera stands and what it sees.

    Convention: the world as in `body.py` (metres, z up). Pixel centres lie at +0.5, x to the right,
    y down. The camera looks at `target` from `distance` metres away; at azimuth 0 it stands at -y,
    in front of a person who faces -y, and positive azimuth moves it towards that person's left hand
    (+x); positive elevation moves it up.

    Attributes:
        width, height: of the picture, pixels.
        focal_px: focal length in pixels.
        roll: turns the picture clockwise. All angles are radians.
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
        """Where it stands."""
        return np.asarray(self.target) - self.distance * self.axes[2]

    def project(self, points: Float32[np.ndarray, "V 3"]) -> Float32[np.ndarray, "V 3"]:
        """Pixel x and y, and depth along the view in metres."""
        axes = self.axes
        seen = (points @ axes.T.astype(np.float32)) - (axes @ self.position).astype(np.float32)
        scale = self.focal_px / seen[:, 2]
        seen[:, 0] = seen[:, 0] * scale + self.width / 2
        seen[:, 1] = seen[:, 1] * scale + self.height / 2
        return seen

    def scaled(self, factor: int) -> Camera:
        """The same view with `factor` times as many pixels along each side."""
        return replace(
            self,
            width=self.width * factor,
            height=self.height * factor,
            focal_px=self.focal_px * factor,
        )
