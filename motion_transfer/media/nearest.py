"""The nearest pixel that counts, for every pixel of an image."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int64, UInt8


def nearest_pixels(
    counts: Bool[np.ndarray, "H W"],
) -> tuple[Float32[np.ndarray, "H W"], Int64[np.ndarray, "H W"]]:
    """Find the nearest pixel that counts for each pixel; one that counts is its own.

    Args:
        counts: Which pixels do; at least one.
    Returns: The distances, px, and the flat indices of the nearest pixels.
    """
    away, label = cv2.distanceTransformWithLabels(
        (~counts).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    label = np.asarray(label, np.int64)
    # OpenCV's labels count through the pixels that count, in an order of its own
    own = np.flatnonzero(counts)
    index = np.zeros(int(label.max()) + 1, np.int64)
    index[label.ravel()[own]] = own
    return np.asarray(away, np.float32), index[label]


def take_nearest(
    image: UInt8[np.ndarray, "H W 3"], wrong: Bool[np.ndarray, "H W"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Replace every wrong pixel by the nearest right one; where all are wrong, change nothing."""
    if wrong.all():
        return image
    mended = image.copy()
    mended[wrong] = image.reshape(-1, 3)[nearest_pixels(~wrong)[1][wrong]]
    return mended
