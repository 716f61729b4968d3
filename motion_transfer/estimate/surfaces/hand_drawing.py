"""Hands laid over the IUV that a coarser network painted."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.interface import LANDMARK, Landmarks
from motion_transfer.estimate.surfaces.hand_surface import HandSurface, load_hand
from motion_transfer.estimate.surfaces.head_surface import HeadSurface
from motion_transfer.estimate.surfaces.raster import draw_charts

PART = {"right": 3, "left": 4}
AROUND = 0.5  # of the drawn hand's size: so far around it, what was painted of it is its own
RIM = 0.15  # of the hand's size: so far its surface reaches beyond its points
FINEST = 512  # px; where there is more around a hand it is drawn at this size, and enlarged


def lay_hand(
    iuv: UInt8[np.ndarray, "h w 3"],
    box: Box,
    side: str,
    seen: Float32[np.ndarray, "21 3"],
    landmarks: Landmarks,
) -> None:
    """Draw a hand in place of what was painted of it, in `iuv` itself.

    Between the fingers stays what surrounds the hand there: nothing, or the body.

    Args:
        box: Of the frame; where `iuv` lies.
        side, seen: The hand, and its 21 points; frame pixels, depth included.
        landmarks: The body's: its elbow tells where the forearm comes from.
    """
    surface = load_hand(side)
    elbow, wrist = (landmarks.image[LANDMARK[f"{side}-{name}"]] for name in ("elbow", "wrist"))
    points = surface.pose(seen, wrist - elbow)
    place = within(box_of(points, AROUND), box)
    if place is None:
        return
    drawn = draw(surface, points, place)
    here = iuv[
        place.top - box.top : place.bottom - box.top, place.left - box.left : place.right - box.left
    ]
    part = PART[side]
    is_hand, was_hand = drawn[..., 0] == part, here[..., 0] == part
    clear(here, was_hand)
    # the forearm's end only where it closes a gap: the network knows the rest of it
    shown = is_hand | ((drawn[..., 0] > 0) & was_hand)
    np.copyto(here, drawn, where=shown[..., None])


def hand_room(points: Float32[np.ndarray, "21 3"], box: Box, height: int, width: int) -> Box:
    """Enlarge a person's box, within the frame, to where a hand may be drawn."""
    low, high = points[:, :2].min(0), points[:, :2].max(0)
    rim = RIM * (high - low).max()
    left, top = np.floor(low - rim).clip(0).astype(int)
    right, bottom = np.ceil(high + rim).clip(max=(width, height)).astype(int)
    return Box(
        *(min(box.left, int(left)), min(box.top, int(top))),
        *(max(box.right, int(right)), max(box.bottom, int(bottom))),
    )


def clear(iuv: UInt8[np.ndarray, "h w 3"], where: Bool[np.ndarray, "h w"]) -> None:
    """Give pixels what the nearest of the others show; nothing if there are none."""
    if where.all():
        iuv[:] = 0
        return
    x, y, width, height = cv2.boundingRect(where.view(np.uint8))
    near = np.s_[max(0, y - 1) : y + height + 1, max(0, x - 1) : x + width + 1]
    iuv, where = iuv[near], where[near]
    _, labels = cv2.distanceTransformWithLabels(
        where.view(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.asarray(labels, np.int32)
    value = np.zeros((int(nearest.max()) + 1, 3), np.uint8)
    value[nearest[~where]] = iuv[~where]
    iuv[where] = value[nearest[where]]


def draw(
    surface: HandSurface | HeadSurface, points: Float32[np.ndarray, "V 3"], place: Box
) -> UInt8[np.ndarray, "h w 3"]:
    """Draw a posed surface on a place of the frame; 0 where it is not."""
    shrunk = max(place.width, place.height) / FINEST
    if shrunk <= 1:
        return draw_charts(points, surface.faces, surface.part, surface.uv, place)
    size = [max(1, round(side / shrunk)) for side in (place.width, place.height)]
    scale = np.array([size[0] / place.width, size[1] / place.height, 1], np.float32)
    small = (points - np.array([place.left, place.top, 0], np.float32)) * scale
    drawn = draw_charts(small, surface.faces, surface.part, surface.uv, Box(0, 0, *size))
    return cv2.resize(drawn, (place.width, place.height), interpolation=cv2.INTER_NEAREST)


def box_of(points: Float32[np.ndarray, "V 3"], around: float) -> Box:
    """Lay a box around posed points, wider on each side by a share of the longer one."""
    low, high = np.floor(points[:, :2].min(0)), np.ceil(points[:, :2].max(0))
    margin = round(around * float((high - low).max()))
    (left, top), (right, bottom) = low - margin, high + margin
    return Box(int(left), int(top), int(right), int(bottom))


def within(one: Box, other: Box) -> Box | None:
    """Find what two boxes share; None if that is nothing."""
    left, top = max(one.left, other.left), max(one.top, other.top)
    right, bottom = min(one.right, other.right), min(one.bottom, other.bottom)
    return Box(left, top, right, bottom) if left < right and top < bottom else None
