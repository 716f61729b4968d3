"""What all painters of surfaces share: linear light, and noise that varies slowly."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32
from numpy.typing import ArrayLike

FINER = 3
"""Noise is drawn smoothly at a third of its size, then enlarged: nobody sees it in slow waves."""


def to_linear(srgb: ArrayLike) -> Float32[np.ndarray, "*axes"]:
    """Turn sRGB values in [0, 1] into linear light (IEC 61966-2-1)."""
    srgb = np.asarray(srgb, np.float32)
    light = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


def smooth_noise(
    shape: tuple[int, ...], wave_px: float, rng: np.random.Generator
) -> Float32[np.ndarray, "H W"]:
    """Draw noise of mean 0 and deviation about 1, alike over distances below `wave_px`.

    Args:
        shape: Height and width, at least 1 each; what follows does not count.
    """
    height, width = shape[:2]
    rows, columns = (max(2, round(side / wave_px) + 1) for side in (height, width))
    noise = rng.standard_normal((rows, columns), np.float32)
    noise *= 1.25  # cubic interpolation takes a fifth of the spread away
    if wave_px >= 4 * FINER:  # the last step need not be cubic then
        steps = (max(columns, width // FINER), max(rows, height // FINER))
        noise = cv2.resize(noise, steps, interpolation=cv2.INTER_CUBIC)
        return cv2.resize(noise, (width, height), interpolation=cv2.INTER_LINEAR)
    return cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
