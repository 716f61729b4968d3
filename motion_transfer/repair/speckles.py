"""Speckles: regions of one part too small to be true."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from motion_transfer.media.nearest import take_nearest

Frame = UInt8[np.ndarray, "H W 3"]


def remove_speckles(iuv: Frame, smallest_px: int) -> Frame:
    """The frame without connected regions of one part, or holes, of fewer pixels than that.

    Each of their pixels takes (I, U, V) of the nearest pixel outside them, so that no part appears
    that was not next to it. Regions connect over corners.
    """
    speckles = _find_speckles(np.ascontiguousarray(iuv[..., 0]), smallest_px)
    return take_nearest(iuv, speckles) if speckles.any() else iuv


def _find_speckles(part: UInt8[np.ndarray, "H W"], smallest_px: int) -> Bool[np.ndarray, "H W"]:
    speckles = np.zeros(part.shape, bool)
    for index in np.unique(part):
        mask = cv2.inRange(part, int(index), int(index))
        x, y, width, height = cv2.boundingRect(mask)
        box = np.s_[y : y + height, x : x + width]
        _, labels, stats, _ = cv2.connectedComponentsWithStats(mask[box], connectivity=8)
        small = stats[:, cv2.CC_STAT_AREA] < smallest_px
        small[0] = False  # what is not of this part
        speckles[box] |= small[np.asarray(labels, np.int32)]
    return speckles
