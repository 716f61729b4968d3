"""Which pixels of a photo are just what its IUV says: neither background nor what lies beside."""

from __future__ import annotations

import math

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from motion_transfer.drawing.outline import grab_cut
from motion_transfer.drawing.person import bounding_box, disc, occupancy
from motion_transfer.drawing.strands import trim_strands
from motion_transfer.drawing.unfolding import find_positions
from motion_transfer.drawing.views import HEAD
from motion_transfer.media.nearest import take_nearest
from nhrr_core import PART_GROUPS
from nhrr_core.parts import FOREARMS

ARMS = [(hand, *forearm) for hand, forearm in FOREARMS.items()]
BAND_SHARE = 0.025  # of the person's height: IUV outlines stray over the background by up to that
CLEAR_SHARE = 0.05  # likewise: hair and loose clothes leave the outline by up to that
TRIM_SHARE = 0.004  # likewise: the width over which a photo mixes person and background
HEAD_RIM, HEAD_LEVELS = 0.08, 90  # of a head's size, the root of its area; of 255: by eye
ARM_RIM, ARM_LEVELS = 0.1, 45  # likewise, of a hand's and its forearm's
FINGER = 0.03  # half as wide, likewise
STRAY_LEVELS = 20  # likewise, of what has a hand's colour beside it
TOUCHING = 1 / 3  # of the rim around an arm: there shadows that it casts go as well
MOUTH_METRES = 0.38  # see `UVTables.position`: higher up hair grows on heads
SOLID_ALPHA = 192  # of 255; less is mixed with the background
GRABCUT_HEIGHT = 320  # px; the cut is made at that size, or it would take seconds


def trim(
    rgb: UInt8[np.ndarray, "H W 3"],
    iuv: UInt8[np.ndarray, "H W 3"],
    alpha: UInt8[np.ndarray, "H W"] | None,
) -> UInt8[np.ndarray, "H W 3"]:
    """Leave the IUV where a photo shows just that, neither background nor what lies beside.

    Args:
        alpha: How much of each pixel is the person; None: its colours have to tell.
    """
    trimmed = trim_outline(rgb, iuv) if alpha is None else trim_to_alpha(iuv, alpha)
    trimmed = trim_arms(rgb, trim_around_arms(rgb, trim_head(rgb, trimmed)))
    return trim_strands(rgb, trimmed)


def trim_head(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Take hair that hangs beside a jaw or a neck out of the IUV: it would be drawn on their sides.

    Only what lies lower than the mouth is doubted.
    """
    doubted = find_strange_rim(rgb, np.isin(iuv[..., 0], HEAD), HEAD_RIM, HEAD_LEVELS)
    doubted[doubted] = find_positions(iuv[doubted])[:, 1] < MOUTH_METRES
    return iuv * ~doubted[..., None]


def trim_arms(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Take what hands hang before out of their IUV: trousers would be streaks on arms that rise."""
    for parts in ARMS:
        arm = np.isin(iuv[..., 0], parts)
        iuv = iuv * ~find_strange_rim(rgb, arm, ARM_RIM, ARM_LEVELS)[..., None]
    return iuv


def trim_around_arms(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Take fingers that reach beyond a hand's IUV out of that of the clothes behind them.

    So go clothes between fingers where nothing but slivers is left of them. Upper arms stay: below
    a short sleeve an elbow has the forearm's colour by right.
    """
    whole_arms = [*ARMS[0], *ARMS[1], *PART_GROUPS["upper-arms"]]
    behind = (iuv[..., 0] > 0) & ~np.isin(iuv[..., 0], whole_arms)
    for parts in ARMS:
        arm = np.isin(iuv[..., 0], parts)
        iuv = iuv * ~find_strays(rgb, arm, behind)[..., None]
        iuv = iuv * ~find_slivers(arm, behind & (iuv[..., 0] > 0))[..., None]
    return iuv


def find_strays(
    rgb: UInt8[np.ndarray, "H W 3"], arm: Bool[np.ndarray, "H W"], behind: Bool[np.ndarray, "H W"]
) -> Bool[np.ndarray, "H W"]:
    """Mark pixels around an arm, of what is behind it, that have its colour, or lie in its shadow.

    The colours that are compared with are the nearest ones of the arm, and those farther away.
    """
    strays = np.zeros(arm.shape, bool)
    if not arm.any():
        return strays
    reach = ARM_RIM * np.count_nonzero(arm) ** 0.5
    around = _cut_around(arm, math.ceil(2 * reach))
    arm, behind, rgb = arm[around], behind[around], rgb[around]
    away = cv2.distanceTransform((~arm).astype(np.uint8), cv2.DIST_L2, 3)
    doubted, sure = behind & (away <= reach), behind & (away > reach)
    if doubted.any() and sure.any():
        from_arm, from_sure = (
            cv2.absdiff(rgb, take_nearest(rgb, ~known)).mean(2) for known in (arm, sure)
        )
        alike = (from_arm < from_sure) & (from_sure > STRAY_LEVELS)
        shaded = (away <= reach * TOUCHING) & (from_sure > ARM_LEVELS)
        strays[around] = doubted & (alike | shaded)
    return strays


def find_slivers(
    arm: Bool[np.ndarray, "H W"], behind: Bool[np.ndarray, "H W"]
) -> Bool[np.ndarray, "H W"]:
    """Mark pixels around an arm where what is behind it is thinner than its fingers."""
    slivers = np.zeros(arm.shape, bool)
    if not arm.any():
        return slivers
    size = np.count_nonzero(arm) ** 0.5
    around = _cut_around(arm, math.ceil(2 * ARM_RIM * size))
    arm, behind = arm[around], behind[around]
    near = cv2.dilate(arm.astype(np.uint8), disc(ARM_RIM * size)) > 0
    thick = cv2.morphologyEx(behind.astype(np.uint8), cv2.MORPH_OPEN, disc(FINGER * size)) > 0
    slivers[around] = near & behind & ~thick
    return slivers


def find_strange_rim(
    rgb: UInt8[np.ndarray, "H W 3"], part: Bool[np.ndarray, "H W"], width: float, levels: float
) -> Bool[np.ndarray, "H W"]:
    """Mark the pixels of a part's rim whose colour is far from the one farther in.

    Args:
        width: Of the rim, as a share of the part's size, the root of its area.
        levels: How far colours are apart then, the mean of their channels, of 255.
    """
    strange = np.zeros(part.shape, bool)
    around = _cut_around(part, 1)
    part, rgb = part[around], rgb[around]
    depth = cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 3)
    inner = part & (depth > width * np.count_nonzero(part) ** 0.5)
    if inner.any():
        apart = cv2.absdiff(rgb, take_nearest(rgb, ~inner)).mean(2)
        strange[around] = part & ~inner & (apart > levels)
    return strange


def _cut_around(mask: Bool[np.ndarray, "H W"], margin: int) -> tuple[slice, slice]:
    """Find the rows and columns that hold a mask and so many pixels around it."""
    left, top, wide, tall = cv2.boundingRect(mask.astype(np.uint8))
    ends = (top, tall), (left, wide)
    down, across = (slice(max(0, at - margin), at + long + margin) for at, long in ends)
    return down, across


def trim_to_alpha(
    iuv: UInt8[np.ndarray, "H W 3"], alpha: UInt8[np.ndarray, "H W"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Keep the IUV where alpha is solid, but for the outermost pixels, where colours mix."""
    solid = (alpha >= SOLID_ALPHA).astype(np.uint8)
    # what the photo's edge cuts off does not mix with a background
    reach = disc(bounding_box(iuv).height * TRIM_SHARE)
    return iuv * cv2.erode(solid, reach, borderValue=1)[..., None]


def trim_outline(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Take the background that strays into an outline out of its IUV.

    Only a band along the outline is doubted. In it, GrabCut (Rother et al., SIGGRAPH 2004) decides
    by colour, and the outermost pixels, where photo and outline mix, always go. What lies just
    outside may be hair: the background's colours are those farther away.
    """
    mask = occupancy(iuv)
    height = bounding_box(iuv).height
    if not height:
        return iuv
    scale = min(1, GRABCUT_HEIGHT / height)
    small = max(1, round(mask.shape[1] * scale)), max(1, round(mask.shape[0] * scale))
    labels = _cut_out(
        cv2.resize(rgb, small, interpolation=cv2.INTER_AREA),
        cv2.resize(mask, small, interpolation=cv2.INTER_NEAREST),
        height * scale,
    )
    person = mask & cv2.resize(labels, mask.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return iuv * cv2.erode(person, disc(height * TRIM_SHARE))[..., None]


def _cut_out(
    rgb: UInt8[np.ndarray, "H W 3"], mask: UInt8[np.ndarray, "H W"], height: float
) -> UInt8[np.ndarray, "H W"]:
    """Mark with 1 where a person of that height, px, is, by colour along a rough mask's outline."""
    band = height * BAND_SHARE
    depth = cv2.distanceTransform(mask, cv2.DIST_L2, 3)
    thickness = cv2.dilate(depth, disc(band))
    inner = depth >= np.minimum(band, thickness / 2)  # a limb thinner than the band keeps its core
    near = cv2.dilate(mask, disc(height * CLEAR_SHARE)) > 0
    if near.all():
        return mask
    labels = np.where(mask, cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    labels[inner & (mask > 0)] = cv2.GC_FGD
    surroundings = np.where(mask[..., None], rgb, take_nearest(rgb, near))
    return grab_cut(surroundings, labels)
