"""What makes a plain area look like cloth: uneven threads, fibres, fading."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

WEAVES = ("woven", "jersey", "twill", "melange", "satin")

# Yarns are 0.3-1 mm thick. Noise at twice a coarse yarn's pitch is what a camera that resolves
# 1-4 mm keeps of them.
_CELL_METRES = 0.002

# Per weave: boxes (wide, high) in cells over which neighbouring cells look alike, each with its
# weight. Long thin boxes are single threads that run thick and thin.
_STREAKS: dict[str, tuple[tuple[int, int, float], ...]] = {
    "woven": ((13, 1, 0.7), (1, 13, 0.7)),
    "jersey": ((1, 5, 0.8), (3, 3, 0.6)),
    "twill": ((1, 31, 0.8), (2, 2, 0.6)),
    "melange": ((4, 1, 0.9), (9, 2, 0.5)),
    "satin": ((25, 1, 0.5), (5, 5, 0.8)),
}

_BYTE_DEVIATION = 73.9  # of whole numbers 0..255, all as likely


def smooth_noise(
    rng: np.random.Generator, pitch_metres: float, shape: tuple[int, int], texels_per_metre: float
) -> Float32[np.ndarray, "H W"]:
    """Noise with humps `pitch_metres` apart, mean 0, about -2..2."""
    step = 1.0 / (pitch_metres * texels_per_metre)
    height, width = shape
    grid = rng.standard_normal(
        (int(height * step) + 4, int(width * step) + 4), dtype=np.float32
    )
    matrix = np.array([[step, 0, 1 + step / 2], [0, step, 1 + step / 2]])
    return cv2.warpAffine(
        grid, matrix, (width, height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    )


def grain(
    weave: str, rng: np.random.Generator, shape: tuple[int, int], texels_per_metre: float
) -> Float32[np.ndarray, "H W"]:
    """Light and dark of the threads: mean 0, standard deviation about 1 before minification.

    Args:
        weave: one of WEAVES.
        shape: the panel's height and width in texels.
    """
    height, width = shape
    per_texel = 1.0 / (_CELL_METRES * texels_per_metre)
    rows, columns = (max(2, int(np.ceil(size * per_texel))) for size in shape)
    cells = np.frombuffer(rng.bytes(rows * columns), np.uint8).reshape(rows, columns)
    total = np.zeros((rows, columns), np.float32)
    for wide, high, weight in _STREAKS[weave]:
        streaks = cv2.boxFilter(cells, cv2.CV_32F, (wide, high))
        gain = weight * np.sqrt(wide * high) / _BYTE_DEVIATION
        cv2.scaleAdd(streaks, gain, total, total)
    total -= cv2.mean(total)[0]
    minified = rows > height
    method = cv2.INTER_AREA if minified and per_texel > 1.5 else cv2.INTER_LINEAR
    total = cv2.resize(total, (width, height), interpolation=method)
    return cv2.scaleAdd(smooth_noise(rng, 0.07, shape, texels_per_metre), 0.5, total)
