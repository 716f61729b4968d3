"""The nearest pixel that counts, for every pixel of an image."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int64, UInt8


def nearest_pixels(
    counts: Bool[np.ndarray, "H W"],
) -> tuple[Float32[np.ndarray, "H W"], Int64[np.ndarray, "H W"]]:
    """Distances, px, to the nearest pixels that count (at least one does), and their flat indices.

    A pixel that counts is its own.
    """
    away, label = cv2.distanceTransformWithLabels(
        (~counts).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    label = np.asarray(label, np.int64)
    own = np.flatnonzero(counts)
    index = np.zeros(int(label.max()) + 1, np.int64)
    index[label.ravel()[own]] = own
    return np.asarray(away, np.float32), index[label]


def take_nearest(
    image: UInt8[np.ndarray, "H W 3"], wrong: Bool[np.ndarray, "H W"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Every wrong pixel replaced by the nearest right one, as a whole; all wrong: unchanged."""
    if wrong.all():
        return image
    mended = image.copy()
    mended[wrong] = image.reshape(-1, 3)[nearest_pixels(~wrong)[1][wrong]]
    return mended
