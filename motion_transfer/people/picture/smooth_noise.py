"""Random fields that vary slowly."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

STEP = 3


def smooth_noise(
    shape: tuple[int, ...], wave_px: float, rng: np.random.Generator
) -> Float32[np.ndarray, "H W"]:
    """Noise of mean 0 and standard deviation about 1, alike over distances below `wave_px`.

    Args:
        shape: height and width, at least 1 each.
    """
    height, width = shape[:2]
    rows, columns = (max(2, round(side / wave_px) + 1) for side in (height, width))
    noise = rng.standard_normal((rows, columns), np.float32)
    noise *= 1.25  # cubic interpolation takes a fifth of the spread away
    if wave_px >= 4 * STEP:  # the last step need not be cubic then
        steps = (max(columns, width // STEP), max(rows, height // STEP))
        noise = cv2.resize(noise, steps, interpolation=cv2.INTER_CUBIC)
        return cv2.resize(noise, (width, height), interpolation=cv2.INTER_LINEAR)
    return cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
