"""What is nearest: the pixel of an image that counts, points in space."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Int32, Int64, UInt8

SINGLE_TREE: dict[str, bool | int | float | str] = {"algorithm": 4}
"""FLANN's only exact tree; OpenCV has no names for them in Python."""


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


def nearest_points(
    points: Float[np.ndarray, "N 3"], places: Float[np.ndarray, "M 3"], count: int = 1
) -> tuple[Float32[np.ndarray, "M K"], Int32[np.ndarray, "M K"]]:
    """Find the nearest points of each place, exactly.

    By OpenCV, which every run imports anyway; SciPy takes half a second.

    Args:
        points: At least one.
        count: How many; fewer where there are fewer points.
    Returns: The distances, in the unit of the points, and the indices of the points; nearest first.
    """
    known, asked = (np.ascontiguousarray(each, np.float32) for each in (points, places))
    count = min(count, len(known))
    if not len(asked):  # of which OpenCV makes nothing at all
        return np.empty((0, count), np.float32), np.empty((0, count), np.int32)
    found, squares = cv2.flann.Index(known, SINGLE_TREE).knnSearch(asked, count)
    return np.sqrt(np.asarray(squares, np.float32)), np.asarray(found, np.int32)
