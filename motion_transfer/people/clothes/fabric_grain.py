"""What makes a plain area look like cloth: uneven threads, fibres, fading."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.picture.smooth_noise import smooth_noise

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

_SWATCH_CELLS = 1024  # 2 m: larger than a panel of a garment


@cache
def _swatch(weave: str) -> Float32[np.ndarray, "R C"]:
    """A large piece of a weave's grain, one value a cell, that every panel is cut from.

    It is the same in every run. Cutting takes a tenth of the time of making it.
    """
    rng = np.random.default_rng(WEAVES.index(weave))
    cells = rng.standard_normal((_SWATCH_CELLS, _SWATCH_CELLS), dtype=np.float32)
    swatch = 0.4 * smooth_noise(cells.shape, 0.07 / _CELL_METRES, rng)
    for wide, high, weight in _STREAKS[weave]:
        streaks = cv2.boxFilter(cells, cv2.CV_32F, (wide, high))
        swatch += weight * np.sqrt(wide * high) * streaks
    return swatch - swatch.mean()


def grain(
    weave: str, rng: np.random.Generator, shape: tuple[int, int], texels_per_metre: float
) -> Float32[np.ndarray, "H W"]:
    """Light and dark of the threads: mean about 0, deviation about 1 before minification.

    Args:
        weave: one of WEAVES.
        shape: the panel's height and width in texels.
    """
    height, width = shape
    per_texel = 1.0 / (_CELL_METRES * texels_per_metre)
    rows, columns = (max(2, int(np.ceil(size * per_texel))) for size in shape)
    swatch = _swatch(weave)[:: int(rng.choice((-1, 1))), :: int(rng.choice((-1, 1)))]
    top = int(rng.integers(max(1, _SWATCH_CELLS - rows)))
    left = int(rng.integers(max(1, _SWATCH_CELLS - columns)))
    cut = np.ascontiguousarray(swatch[top : top + rows, left : left + columns])
    if cut.shape != (rows, columns):
        missing = (rows - cut.shape[0], columns - cut.shape[1])
        cut = cv2.copyMakeBorder(cut, 0, missing[0], 0, missing[1], cv2.BORDER_WRAP)
    method = cv2.INTER_AREA if per_texel > 1.5 else cv2.INTER_LINEAR
    return cv2.resize(cut, (width, height), interpolation=method)
