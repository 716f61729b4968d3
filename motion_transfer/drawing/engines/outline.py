"""The body's outline in target IUV, for graphs that are given it.

The distance transform is OpenCV's, exact, a tenth of the time that it takes as nodes of a graph.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.drawing.person import occupancy
from nhrr_core.config import OUTLINE_PIXELS


def signed_distance(iuv: UInt8[np.ndarray, "H W 3"]) -> Float32[np.ndarray, "H W"]:
    """Measure the distance to the outline, px, see `nhrr_core.sampling.signed_distance`."""
    body = occupancy(iuv)
    exact = cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    within = cv2.distanceTransform(body, *exact)
    beyond = cv2.distanceTransform(1 - body, *exact)
    distance = np.where(body, 0.5 - within, beyond - 0.5)
    return distance.clip(-OUTLINE_PIXELS, OUTLINE_PIXELS)
