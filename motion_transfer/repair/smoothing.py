"""Steady part borders and steady U, V, from the frame before and the frame after.

Both are first moved onto the frame between them, by optical flow of the IUV images themselves. A
pixel whose flow there and back does not return is left as it is.
Source: the flow is DIS (Kroeger et al., ECCV 2016), as OpenCV has it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, pairwise

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from motion_transfer.drawing.person import bounding_box
from nhrr_core.parts import PART_COUNT

# all chosen by eye
BORDER_PX = 2  # how far a border may be put back; more could wear thin limbs away
RETURN_PX = 1.5  # how far from its start the flow there and back may end
STEADY_LEVELS = 32  # of 255: U or V further apart is another place, not noise
CUT_SHARE = 0.05  # of the pixels with somebody: fewer with the same part, and the shot is another
SMALLEST_FLOW_PX = 32  # side of a picture in which DIS finds anything
MARGIN_PX = 16  # around the people: flow wants some surroundings
GREYS = np.array([0, *(40 + 37 * part % 200 for part in range(1, PART_COUNT + 1))], np.uint8)
"""A grey for each part, 40..239; the step of 37 sets parts of neighbouring numbers far apart."""

Frame = UInt8[np.ndarray, "H W 3"]
Flow = Float[np.ndarray, "H W 2"]
Moved = tuple[Frame, Bool[np.ndarray, "H W"]]
"""A neighbour brought onto a frame, pixel by pixel, and where that is sure."""


def smooth(frames: Iterable[Frame]) -> Iterator[Frame]:
    """Steady each frame by its neighbours; three are kept at a time.

    A pixel takes another part only where the frame before and the frame after agree on it, and only
    within two pixels of where the frame itself has that part. U and V are averaged, 1 : 2 : 1, over
    pixels of the same part only. Equal frames stay as they are, to the bit.
    """
    before: Frame | None = None
    for current, after in pairwise(chain(frames, [None])):
        assert current is not None
        yield _steady(current, before, after)
        before = current


def _steady(current: Frame, before: Frame | None, after: Frame | None) -> Frame:
    """One frame between its neighbours, None where there is none."""
    others = [other for other in (before, after) if other is not None and _follows(current, other)]
    if not others or all(np.array_equal(current, other) for other in others):
        return current
    # not the whole frame: flow is what takes time, and people fill a part of it
    people = bounding_box(np.bitwise_or.reduce([current, *others]))
    top, left = max(0, people.top - MARGIN_PX), max(0, people.left - MARGIN_PX)
    box = np.s_[top : people.bottom + MARGIN_PX, left : people.right + MARGIN_PX]
    here = np.ascontiguousarray(current[box])
    moved = [_move(np.ascontiguousarray(other[box]), here) for other in others]
    steady = _put_borders_back(here, moved) if len(moved) == 2 else here
    result = current.copy()
    result[box] = _average_uv(steady, moved)
    return result


def _put_borders_back(here: Frame, moved: list[Moved]) -> Frame:
    """Pixels whose two neighbours in time agree on another part that is close by take it."""
    (first, first_sure), (second, second_sure) = moved
    agreed = first[..., 0] == second[..., 0]
    wrong = agreed & first_sure & second_sure & (first[..., 0] != here[..., 0])
    if not wrong.any():
        return here
    steady = here.copy()
    reach = np.ones((2 * BORDER_PX + 1, 2 * BORDER_PX + 1), np.uint8)
    for part in np.unique(first[..., 0][wrong]):
        close = cv2.dilate((here[..., 0] == part).astype(np.uint8), reach) > 0
        taken = wrong & close & (first[..., 0] == part)
        # U and V as one of them has it, not their mean: they may be places apart
        steady[taken] = first[taken] if part else 0
    return steady


def _average_uv(here: Frame, moved: list[Moved]) -> Frame:
    """U and V averaged with those neighbours that show the same part and nearly the same place."""
    total = 2 * here[..., 1:].astype(np.uint16)
    weight = np.full(here.shape[:2], 2, np.uint16)
    for other, sure in moved:
        difference = np.abs(other[..., 1:].astype(np.int16) - here[..., 1:]).max(-1)
        same = (other[..., 0] == here[..., 0]) & (here[..., 0] > 0) & sure
        same &= difference <= STEADY_LEVELS
        total += other[..., 1:] * same[..., None]
        weight += same
    averaged = here.copy()
    averaged[..., 1:] = (total + weight[..., None] // 2) // weight[..., None]  # to the nearest
    return averaged


def _move(other: Frame, here: Frame) -> Moved:
    """Bring a neighbour onto this frame."""
    if np.array_equal(other, here) or min(here.shape[:2]) < SMALLEST_FLOW_PX:
        return other, np.ones(here.shape[:2], bool)
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    grey_here, grey_other = _as_grey(here), _as_grey(other)
    there, back = dis.calc(grey_here, grey_other, None), dis.calc(grey_other, grey_here, None)  # type: ignore[call-overload]
    height, width = here.shape[:2]
    rows = np.rint(np.arange(height)[:, None] + there[..., 1]).astype(np.int64)
    columns = np.rint(np.arange(width) + there[..., 0]).astype(np.int64)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    goal = rows.clip(0, height - 1), columns.clip(0, width - 1)
    returns = np.abs(there + back[goal]).max(-1) <= RETURN_PX
    return _sample(other, there, other[goal]), inside & returns


def _sample(other: Frame, flow: Flow, nearest: Frame) -> Frame:
    """The part of the nearest pixel, with U and V between the pixels around that have this part."""
    height, width = flow.shape[:2]
    y, x = np.arange(height)[:, None] + flow[..., 1], np.arange(width) + flow[..., 0]
    top, left = np.floor(y).astype(np.int64), np.floor(x).astype(np.int64)
    total, weights = np.zeros((height, width, 2), np.float32), np.zeros((height, width), np.float32)
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        corner = other[(top + down).clip(0, height - 1), (left + right).clip(0, width - 1)]
        share = np.abs(1 - down - (y - top)) * np.abs(1 - right - (x - left))
        share = np.where(corner[..., 0] == nearest[..., 0], share, 0).astype(np.float32)
        total += corner[..., 1:] * share[..., None]
        weights += share
    known = weights > 0
    sampled = nearest.copy()
    sampled[known, 1:] = np.rint(total[known] / weights[known][:, None])
    return sampled


def _as_grey(iuv: Frame) -> UInt8[np.ndarray, "H W"]:
    """A picture in which parts, and places on them, can be followed."""
    shade = iuv[..., 1].astype(np.uint16) + iuv[..., 2]
    grey = (GREYS[iuv[..., 0]].astype(np.uint16) * 3 + shade // 2) // 4
    return np.where(iuv[..., 0] > 0, grey, 0).astype(np.uint8)


def _follows(current: Frame, other: Frame) -> bool:
    """Whether two frames belong to one shot."""
    occupied = (current[..., 0] | other[..., 0]) > 0
    same = (current[..., 0] == other[..., 0]) & occupied
    return bool(same.sum() >= CUT_SHARE * max(1, occupied.sum()))
