"""What is behind a person: a colour, a picture fitted to the frame, a photo without its person."""

from __future__ import annotations

from collections.abc import Collection

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from motion_transfer.drawing.person import disc, occupancy
from motion_transfer.drawing.source import Source, untouched_texels
from motion_transfer.drawing.unfolding import texel_index, texture_coordinates
from motion_transfer.option import parse_colour

PERSON_GROWTH = 0.05  # of the person's height: hair and clothes reach beyond the IUV by about that
ALPHA_GROWTH = 0.02  # likewise, where alpha shows them: single hairs and their shadow
FAINT_ALPHA = 32  # of 255; less is noise of whoever made the alpha
GROWN_PX = 512  # the longer side at which that is done
FILL_PX = 512  # the fill is smooth: at that longer side nothing is lost, and much time saved
SATURATION = 16  # parts of a coarse pixel, one of which has to be seen; the source's 4 by 4
SMOOTHINGS = 8  # at each size: as the outline goes, so does the fill; more are not seen

Frame = UInt8[np.ndarray, "H W 3"]


def make_background(
    background: str,
    size: tuple[int, int],
    source: Source,
    *,
    in_place: bool,
    redressed: Collection[int] = (),
) -> Frame:
    """Make a background of (height, width): one colour, or the source's photo.

    The photo covers the frame, centred, and loses its person, whose place is filled from around;
    with `in_place` (the driver is the source's own IUV) it stays as it is, but for the clothes of
    the parts that are `redressed`: wider than the new ones, they would stand out behind them.
    """
    colour = parse_colour(background)
    if colour is not None:
        return np.full((*size, 3), colour, np.uint8)
    photo = source.photo.rgb
    if not in_place or redressed:
        # nothing is filled with a person's colours, whose other parts may stay
        emptied = fill_from_around(photo, person_area(source.iuv, source.alpha))
        if in_place:
            worn = _is_nearest_to(source.iuv, ~untouched_texels(frozenset(redressed)))
            emptied = np.where(worn[..., None], emptied, photo)
        photo = emptied
    return fit_picture(photo, size, "cover")


def fit_picture(picture: Frame, size: tuple[int, int], fit: str) -> Frame:
    """Bring a picture to (height, width).

    Args:
        fit: `cover` scales it until it fills the frame and cuts off what is too much, `contain`
            until all of it is in, with black beside it, both centred; `stretch` changes its shape.
    """
    height, width = size
    if picture.shape[:2] == size:
        return picture
    scales = height / picture.shape[0], width / picture.shape[1]
    if fit == "stretch":
        return _scale(picture, size)
    scale = max(scales) if fit == "cover" else min(scales)
    scaled = round(picture.shape[0] * scale), round(picture.shape[1] * scale)
    if fit == "cover":
        scaled = max(height, scaled[0]), max(width, scaled[1])
        picture = _scale(picture, scaled)
        top, left = (scaled[0] - height) // 2, (scaled[1] - width) // 2
        return np.ascontiguousarray(picture[top : top + height, left : left + width])
    scaled = min(height, max(1, scaled[0])), min(width, max(1, scaled[1]))
    top, left = (height - scaled[0]) // 2, (width - scaled[1]) // 2
    frame = np.zeros((height, width, 3), np.uint8)
    frame[top : top + scaled[0], left : left + scaled[1]] = _scale(picture, scaled)
    return frame


def blur_picture(picture: Frame, percent: float) -> Frame:
    """Blur a picture; the Gaussian's deviation is a percentage of its height."""
    deviation = picture.shape[0] * percent / 100
    return cv2.GaussianBlur(picture, (0, 0), deviation) if deviation > 0 else picture


def person_area(
    iuv: UInt8[np.ndarray, "H W 3"], alpha: UInt8[np.ndarray, "H W"] | None = None
) -> UInt8[np.ndarray, "H W"]:
    """Mark with 1 where a person is, hair and clothes included as far as they are known."""
    mask = occupancy(iuv)
    growth = PERSON_GROWTH
    if alpha is not None:
        mask, growth = mask | (alpha >= FAINT_ALPHA).astype(np.uint8), ALPHA_GROWTH
    _, _, _, height = cv2.boundingRect(mask)
    if not height:
        return mask
    # a large disc takes long, and its outline need not be exact
    scale = min(1, GROWN_PX / max(mask.shape))
    size = max(1, round(mask.shape[1] * scale)), max(1, round(mask.shape[0] * scale))
    small = cv2.resize(mask * np.uint8(255), size, interpolation=cv2.INTER_AREA)
    grown = cv2.dilate(small, disc(max(2, height * growth) * scale))
    whole = cv2.resize(grown, mask.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return mask | (whole > 0).astype(np.uint8)


def _is_nearest_to(
    iuv: UInt8[np.ndarray, "H W 3"], texels: Bool[np.ndarray, "T T"]
) -> Bool[np.ndarray, "H W"]:
    """Tell of every pixel whether the nearest one of the body shows a marked texel."""
    body = iuv[..., 0] > 0
    _, labels = cv2.distanceTransformWithLabels(
        (~body).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = labels.astype(np.int64)
    marked = np.zeros(int(nearest.max()) + 1, bool)
    marked[nearest[body]] = texels.ravel()[
        texel_index(texture_coordinates(iuv[body]), texels.shape[0])
    ]
    return marked[nearest]


def fill_from_around(picture: Frame, hole: UInt8[np.ndarray, "H W"]) -> Frame:
    """Fill where `hole` is not 0 from what is around it, smoothly, as far as the hole reaches.

    Source: the pull-push algorithm, Gortler et al., "The Lumigraph" (SIGGRAPH 1996), section 3.3.
    """
    scale = min(1, FILL_PX / max(picture.shape[:2]))
    size = tuple(max(1, round(side * scale)) for side in picture.shape[1::-1])
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    # whoever is in a part of a small pixel has coloured it
    known = cv2.resize((hole == 0).astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.999
    filled = cv2.resize(_pull_push(small, known), picture.shape[1::-1])
    return np.where(hole[..., None] > 0, filled, picture)


def _pull_push(picture: Frame, known: np.ndarray) -> Frame:
    weight: Float32[np.ndarray, "H W"] = known.astype(np.float32)
    level = picture * weight[..., None]
    levels = []
    while max(level.shape[:2]) > 1:
        levels.append((level, weight))
        level, seen = cv2.pyrDown(level), cv2.pyrDown(weight)
        # what is seen in a small part of a coarse pixel is all that is known of it, and counts as
        # if it were the whole: else far colours bleed in along the outline, as a seam
        weight = np.minimum(1, seen * SATURATION)
        level = level * (weight / np.maximum(seen, 1e-6))[..., None]
    filled = level.reshape(1, 1, 3) / np.maximum(weight.reshape(1, 1, 1), 1e-6)
    for level, weight in reversed(levels):
        filled = cv2.pyrUp(filled, dstsize=level.shape[1::-1])
        open_share = 1 - weight[..., None]
        for _ in range(SMOOTHINGS):
            filled = level + cv2.blur(filled, (3, 3)) * open_share
    return filled.round().clip(0, 255).astype(np.uint8)


def _scale(picture: Frame, size: tuple[int, int]) -> Frame:
    if picture.shape[:2] == size:
        return picture
    shrinks = size[0] * size[1] < picture.shape[0] * picture.shape[1]
    kind = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    return cv2.resize(picture, size[::-1], interpolation=kind)
