"""The one-euro filter: steady when slow, without lag when fast.

Source: Casiez, Roussel and Vogel, 1 euro filter (CHI 2012). Speeds are measured in sizes of the
object a second, so that near and far people are smoothed alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np


@dataclass(frozen=True)
class Smoothness:
    """Settings of a filter.

    Attributes:
        least_cutoff: at rest, hertz; lower is steadier.
        speed_gain: how much the cut-off rises with speed, hertz for a size a second.
        speed_cutoff: of the speed itself, hertz.
    """

    least_cutoff: float
    speed_gain: float
    speed_cutoff: float = 1.0


IMAGE_SMOOTHNESS = Smoothness(0.05, 80.0)
WORLD_SMOOTHNESS = Smoothness(0.1, 40.0)
"""Both from MediaPipe's graph `pose_landmark_filtering` (0.10.14)."""


class OneEuroFilter:
    """Smooths an array that is measured again and again."""

    def __init__(self, settings: Smoothness) -> None:
        self._settings = settings
        self._value: np.ndarray | None = None
        self._speed: np.ndarray | float = 0.0
        self._raw: np.ndarray | None = None

    def __call__(self, value: np.ndarray, seconds: float, size: float = 1.0) -> np.ndarray:
        """The smoothed value.

        Args:
            seconds: since the last call, > 0.
            size: of the object, in the value's unit.
        """
        if self._value is None or self._raw is None:
            self._value = self._raw = value
            return value
        settings = self._settings
        speed = (value - self._raw) / (size * seconds)
        share = _share(settings.speed_cutoff, seconds)
        self._speed = share * speed + (1 - share) * self._speed
        cutoff = settings.least_cutoff + settings.speed_gain * np.abs(self._speed)
        share = _share(cutoff, seconds)
        self._value = (share * value + (1 - share) * self._value).astype(value.dtype)
        self._raw = value
        return self._value


def _share(cutoff: np.ndarray | float, seconds: float) -> np.ndarray | float:
    """How much of a new value a low pass lets through."""
    return 1 / (1 + 1 / (2 * pi * cutoff * seconds))
