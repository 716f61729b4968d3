"""How far a person in a photo reaches beyond the body that IUV shows."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from motion_transfer.drawing.person import COVERS, bounding_box, disc, occupancy
from motion_transfer.drawing.unfolding import unfold_clearance
from motion_transfer.media.nearest import nearest_pixels
from motion_transfer.media.pictures.photo import Photo
from nhrr_core.config import CLEARANCE_CHANNELS, CLEARANCE_SIZE

ROOM_SHARE = 0.25  # of the body's longer side: nobody's clothes reach further
WORKING_SIDE = 256  # px of the body's longer side: more would not show on CLEARANCE_SIZE texels
SMOOTHING_PX = 1.5  # along the outline, whose pixels see the person's end each for itself

WEAR_SHARE = 0.12  # of the body's longer side: what lies farther away shows the backdrop
CORE_SHARE = 0.012  # likewise: farther inside the body's outline is surely the person
PLAIN_SHARE = 0.95  # of what lies beyond has the backdrop's colour, or it is no plain one
ABOUT = 20  # of 255, in the channel that differs most
LIGHT = (0.6, 1.15)  # of the backdrop's: from a shadow on it to a glow
FEWEST_BACKDROP_PIXELS = 200  # fewer do not tell a colour from its changes
GRABCUT_ROUNDS = 3  # chosen by eye


def clearance_of(
    photo: Photo,
    iuv: UInt8[np.ndarray, "H W 3"],
    parts: tuple[int, ...],
    *,
    alpha: UInt8[np.ndarray, "H W"] | None = None,
) -> Float32[np.ndarray, "2 128 128"]:
    """Measure the clearance of some parts of a person; 0 where it is not known.

    How it lies in UV space says `nhrr_core.unfold_clearance`.

    Args:
        alpha: Says where the person ends; None: the photo's own cutout, or else a plain backdrop.
    """
    alpha = photo.cutout if alpha is None else alpha
    unknown = np.zeros((CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE), np.float32)
    box = bounding_box(iuv)
    if not box.area:
        return unknown
    side = max(box.width, box.height)
    near = box.grown(round(side * ROOM_SHARE)).slices
    shrink = min(1, WORKING_SIDE / side)
    own = shrink_image(iuv[near], shrink, cv2.INTER_NEAREST_EXACT)
    if alpha is None:
        rgb = shrink_image(photo.rgb[near], shrink, cv2.INTER_AREA)
        alpha = stand_out(rgb, occupancy(own), side * shrink)
    else:
        alpha = shrink_image(alpha[near], shrink, cv2.INTER_AREA)
    if alpha is None:
        return unknown
    clearance, measured = measure_clearance(own, alpha)
    return unfold_clearance(clearance, measured & np.isin(own[..., 0], parts), own)


def stand_out(
    rgb: UInt8[np.ndarray, "H W 3"], body: UInt8[np.ndarray, "H W"], longer_side: float
) -> UInt8[np.ndarray, "H W"] | None:
    """Cut a person out of a plain backdrop by GrabCut (Rother et al., SIGGRAPH 2004).

    Other backdrops are left alone: what looks like the person would become wide clothes. On 81
    synthetic photos of 148 the backdrop is plain; there, the intersection over union with the true
    alpha is 0.97 (the body's is 0.81) and lower than the body's once, by 0.02.

    Args:
        body: 1 where IUV shows it.
        longer_side: The body's, px.
    Returns: Alpha, 0 or 255; None if there is no backdrop to be seen, or not a plain one.
    """
    beyond = cv2.dilate(body, disc(longer_side * WEAR_SHARE)) == 0
    if np.count_nonzero(beyond) < FEWEST_BACKDROP_PIXELS or not _is_plain(rgb, beyond):
        return None
    core = cv2.erode(body, disc(longer_side * CORE_SHARE))
    labels = np.where(body, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[beyond] = cv2.GC_BGD
    labels[core > 0] = cv2.GC_FGD
    if not core.any():
        return None
    _, region = cv2.connectedComponents(np.maximum(grab_cut(rgb, labels), body))
    return np.isin(region, np.unique(region[body > 0])).astype(np.uint8) * 255


def grab_cut(
    rgb: UInt8[np.ndarray, "H W 3"], labels: UInt8[np.ndarray, "H W"]
) -> UInt8[np.ndarray, "H W"]:
    """Mark with 1 where the person is, by colour, from GrabCut's labels; the same at every call."""
    cv2.setRNGSeed(0)  # it starts from k-means
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(rgb, labels, (0, 0, 1, 1), *models, GRABCUT_ROUNDS, cv2.GC_INIT_WITH_MASK)
    return labels & 1  # the odd labels, GC_FGD and GC_PR_FGD, are the person


def _is_plain(rgb: UInt8[np.ndarray, "H W 3"], beyond: Bool[np.ndarray, "H W"]) -> bool:
    """Tell whether it has one colour there, which may change as slowly as a studio's light does."""
    row, column = (axis / max(beyond.shape) - 0.5 for axis in np.indices(beyond.shape, np.float32))
    powers = np.stack([row**0, row, column, row**2, row * column, column**2], axis=-1)[beyond]
    seen = rgb[beyond].astype(np.float32)
    backdrop = powers @ np.linalg.lstsq(powers, seen)[0]
    light = (seen * backdrop).sum(1) / np.maximum((backdrop**2).sum(1), 1)
    lit = backdrop * light.clip(*LIGHT)[:, None]
    return bool((np.abs(seen - lit).max(1) <= ABOUT).mean() >= PLAIN_SHARE)


def measure_clearance(
    iuv: UInt8[np.ndarray, "H W 3"], alpha: UInt8[np.ndarray, "H W"]
) -> tuple[Float32[np.ndarray, "H W"], Bool[np.ndarray, "H W"]]:
    """Measure the pixels from the body's outline to where the person ends, and tell where.

    A pixel of the outline answers for everything outside that is nearest to it; one that alpha does
    not cover has a negative clearance, the distance to where the person begins.
    """
    body, person = occupancy(iuv), (alpha >= COVERS).astype(np.uint8)
    inner = cv2.erode(body, np.ones((3, 3), np.uint8), borderValue=1)
    outline = (body > 0) & (inner == 0)
    if not outline.any() or not person.any():
        return np.zeros(body.shape, np.float32), np.zeros(body.shape, bool)
    away, nearest = nearest_pixels(body > 0)
    clearance = np.zeros(body.size, np.float32)
    outside = (body == 0) & (person > 0)
    np.maximum.at(clearance, nearest[outside], away[outside])
    short = (body > 0) & (person == 0)
    clearance = np.where(short, -nearest_pixels(person > 0)[0], clearance.reshape(body.shape))
    kernel = (0, 0)
    weight = cv2.GaussianBlur(outline.astype(np.float32), kernel, SMOOTHING_PX)
    total = cv2.GaussianBlur(np.where(outline, clearance, 0), kernel, SMOOTHING_PX)
    return np.where(outline, total / np.maximum(weight, 1e-6), 0).astype(np.float32), outline


def shrink_image(
    image: UInt8[np.ndarray, "*shape"], factor: float, interpolation: int
) -> UInt8[np.ndarray, "*shape"]:
    """Make an image smaller, at least 1 x 1; contiguous in any case."""
    if factor == 1:
        return np.ascontiguousarray(image)
    size = max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor))
    return cv2.resize(image, size, interpolation=interpolation)
