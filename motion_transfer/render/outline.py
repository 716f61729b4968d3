"""How far a person in a photo reaches beyond the body that IUV shows."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int64, UInt8
from torch import Tensor

from motion_transfer.render.person import occupancy
from nhrr_core import load_uv_layout, unfold_clearance
from nhrr_core.clearance import CLEARANCE_SIZE
from nhrr_core.config import CLEARANCE_CHANNELS
from nhrr_core.iuv import PART_COUNT

ALL_PARTS = tuple(range(1, PART_COUNT + 1))
ROOM_SHARE = 0.25  # of the body's longer side: nobody's clothes reach further
SOLID_ALPHA = 128  # of 255
SMOOTHING_PX = 1.5  # along the outline, whose pixels see the person's end each for itself


def clearance_of(
    iuv: UInt8[np.ndarray, "H W 3"],
    alpha: UInt8[np.ndarray, "H W"] | None,
    parts: tuple[int, ...] = ALL_PARTS,
) -> Float[Tensor, "1 2 128 128"]:
    """The clearance of some parts of a person, as the network takes it.

    Args:
        alpha: None: nothing is known of it.
    """
    if alpha is None or not iuv[..., 0].any():
        return torch.zeros(1, CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE)
    x, y, width, height = cv2.boundingRect(occupancy(iuv))
    room = round(max(width, height) * ROOM_SHARE)
    near = np.s_[max(0, y - room) : y + height + room, max(0, x - room) : x + width + room]
    own = np.ascontiguousarray(iuv[near])
    clearance, measured = measure_clearance(own, alpha[near])
    return unfold_clearance(
        torch.from_numpy(clearance)[None, None],
        torch.from_numpy(measured & np.isin(own[..., 0], parts))[None, None],
        torch.from_numpy(own.transpose(2, 0, 1).copy())[None],
        load_uv_layout().charts,
    )


def measure_clearance(
    iuv: UInt8[np.ndarray, "H W 3"], alpha: UInt8[np.ndarray, "H W"]
) -> tuple[Float32[np.ndarray, "H W"], Bool[np.ndarray, "H W"]]:
    """Pixels from the body's outline to where the person ends, and where that was measured.

    A pixel of the outline answers for everything outside that is nearest to it; one that alpha does
    not cover has a negative clearance, the distance to where the person begins.
    """
    body, person = occupancy(iuv), (alpha >= SOLID_ALPHA).astype(np.uint8)
    inner = cv2.erode(body, np.ones((3, 3), np.uint8), borderValue=1)
    outline = (body > 0) & (inner == 0)
    if not outline.any() or not person.any():
        return np.zeros(body.shape, np.float32), np.zeros(body.shape, bool)
    away, nearest = _nearest(body)
    clearance = np.zeros(body.size, np.float32)
    outside = (body == 0) & (person > 0)
    np.maximum.at(clearance, nearest[outside], away[outside])
    short = (body > 0) & (person == 0)
    clearance = np.where(short, -_nearest(person)[0], clearance.reshape(body.shape))
    kernel = (0, 0)
    weight = cv2.GaussianBlur(outline.astype(np.float32), kernel, SMOOTHING_PX)
    total = cv2.GaussianBlur(np.where(outline, clearance, 0), kernel, SMOOTHING_PX)
    return np.where(outline, total / np.maximum(weight, 1e-6), 0).astype(np.float32), outline


def _nearest(
    mask: UInt8[np.ndarray, "H W"],
) -> tuple[Float32[np.ndarray, "H W"], Int64[np.ndarray, "H W"]]:
    """For each pixel the distance to the mask, and the flat index of the mask's nearest pixel."""
    away, label = cv2.distanceTransformWithLabels(
        1 - mask, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    own = np.flatnonzero(mask)
    index = np.zeros(int(label.max()) + 1, np.int64)
    index[np.asarray(label, np.int64).ravel()[own]] = own
    return np.asarray(away, np.float32), index[np.asarray(label, np.int64)]
