"""Frames in which nobody was found, filled from the frames around them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal

import cv2
import numpy as np
import scipy  # whose parts are imported when they are used
from jaxtyping import Bool, Float, UInt8

from motion_transfer.media.nearest import take_nearest

FillGaps = Literal["hold", "interpolate"]

# all chosen by eye
MATCHED_PIXELS = 400  # of one part: plenty for the six numbers of its movement
MATCH_LEVELS = 6.0  # of 255 in U and V: further apart is another place of the part
FEWEST_MATCHES = 24  # four times the numbers to be found; with fewer, outliers decide
LARGEST_STRETCH = 2.0  # in a gap; a part that grows more was matched wrongly
SIMILAR_SIZE = 4.0  # people of more than so many times the pixels, or less, are not the same
JOIN_SHARE = 0.03  # of the frame's height: regions this close are one person
CRACK_PX = 5  # side of what closes the seams between parts that were moved apart

Frame = UInt8[np.ndarray, "H W C"]
Mask = Bool[np.ndarray, "H W"]
Movement = Float[np.ndarray, "2 3"]
"""An affine map of (x, y) px: from a place to where it is in the other frame."""


def fill_gaps(frames: Iterable[Frame], how: FillGaps) -> Iterator[Frame]:
    """Fill the frames that show nobody; at most two are kept at a time.

    At the ends, and with `hold`, the nearest frame before (at the start: after) is repeated; with
    `interpolate`, those around are blended. A sequence of nobody stays as it is.
    """
    last: Frame | None = None
    waiting = 0
    frame = None
    for frame in frames:
        if not frame[..., 0].any():
            waiting += 1
            continue
        for step in range(1, waiting + 1):
            if last is None:
                yield frame
            else:
                yield last if how == "hold" else blend(last, frame, step / (waiting + 1))
        yield frame
        last, waiting = frame, 0
    if waiting and frame is not None:
        yield from [frame if last is None else last] * waiting


def blend(before: Frame, after: Frame, time: float) -> Frame:
    """Make what lies between two frames, `time` in 0..1.

    The nearer frame is taken, and each part of each person in it is moved along the way to the same
    places, by (I, U, V), in the other one: an affine map for each part. People are connected
    regions; one without a partner stays where it is. Pixels are moved whole, never mixed.
    """
    near, far, way = (before, after, time) if time < 0.5 else (after, before, 1 - time)
    filled = np.zeros_like(near)
    for mine, other in _pair_people(near, far):
        if other is None:
            np.copyto(filled, near, where=mine[..., None])
        else:
            _move_person(filled, near * mine[..., None], far * other[..., None], way)
    body = (filled[..., 0] > 0).astype(np.uint8)
    closed = cv2.morphologyEx(body, cv2.MORPH_CLOSE, np.ones((CRACK_PX, CRACK_PX), np.uint8))
    cracks = (closed > 0) & (body == 0)
    # with the nearest pixel of the body: around a crack there is background, too
    filled[cracks] = take_nearest(filled, filled[..., 0] == 0)[cracks]
    return filled


def _move_person(filled: Frame, person: Frame, partner: Frame, way: float) -> None:
    """Draw a person on its way to its partner into a frame."""
    parts, counts = np.unique(person[..., 0], return_counts=True)
    # large parts first, as hands before the body are not to be painted over by it
    by_size = [int(part) for part in parts[np.argsort(-counts)] if part]
    whole = _shift(person[..., 0] > 0, partner[..., 0] > 0)
    size = filled.shape[1::-1]
    for part in by_size:
        movement = _find_movement(person, partner, part)
        step = (1 - way) * np.eye(2, 3) + way * (whole if movement is None else movement)
        piece = person * (person[..., :1] == part)
        moved = cv2.warpAffine(piece, step, size, flags=cv2.INTER_NEAREST)
        np.copyto(filled, moved, where=moved[..., :1] > 0)


def _find_movement(person: Frame, partner: Frame, part: int) -> Movement | None:
    """Where a part goes, from pixels with the same U and V; None if there are too few."""
    mine, other = person[..., 0] == part, partner[..., 0] == part
    if mine.sum() < FEWEST_MATCHES or other.sum() < FEWEST_MATCHES:
        return None
    (rows, columns), (other_rows, other_columns) = np.nonzero(mine), np.nonzero(other)
    chosen = np.linspace(0, len(rows) - 1, min(len(rows), MATCHED_PIXELS)).astype(int)
    rows, columns = rows[chosen], columns[chosen]
    distance, match = scipy.spatial.KDTree(partner[other][:, 1:]).query(
        person[rows, columns][:, 1:], distance_upper_bound=MATCH_LEVELS
    )
    found = np.isfinite(distance)
    if found.sum() < FEWEST_MATCHES:
        return None
    start = np.stack([columns[found], rows[found], np.ones(found.sum())], 1)
    goal = np.stack([other_columns[match[found]], other_rows[match[found]]], 1)
    solution, _, rank, _ = np.linalg.lstsq(start, goal, rcond=None)
    movement = solution.T
    stretches = np.linalg.svd(movement[:, :2], compute_uv=False)
    sane = stretches[0] < LARGEST_STRETCH and stretches[1] > 1 / LARGEST_STRETCH
    if rank == 3 and sane:
        return movement
    # pixels in a line, or matched wrongly in part: the median shift is true at least
    return np.hstack([np.eye(2), np.median(goal - start[:, :2], axis=0)[:, None]])


def _shift(mine: Mask, other: Mask) -> Movement:
    """The movement from one region's centre of gravity to another's."""
    centres = [np.argwhere(mask).mean(0)[::-1] for mask in (mine, other)]
    return np.hstack([np.eye(2), (centres[1] - centres[0])[:, None]])


def _pair_people(near: Frame, far: Frame) -> list[tuple[Mask, Mask | None]]:
    """Each person of one frame with the nearest of similar size in the other, largest first."""
    others = _find_regions(far)
    pairs: list[tuple[Mask, Mask | None]] = []
    for region in _find_regions(near):
        size = region.sum()
        similar = [o for o in others if 1 / SIMILAR_SIZE < o.sum() / size < SIMILAR_SIZE]
        centre = np.argwhere(region).mean(0)
        best = min(
            similar,
            key=lambda o: float(np.abs(np.argwhere(o).mean(0) - centre).sum()),
            default=None,
        )
        others = [o for o in others if o is not best]
        pairs.append((region, best))
    return pairs


def _find_regions(iuv: Frame) -> list[Mask]:
    """Connected regions, those close to each other joined, largest first."""
    body = (iuv[..., 0] > 0).astype(np.uint8)
    reach = 2 * max(1, round(body.shape[0] * JOIN_SHARE / 2)) + 1
    count, labels = cv2.connectedComponents(cv2.dilate(body, np.ones((reach, reach), np.uint8)))
    regions = [(labels == label) & (body > 0) for label in range(1, count)]
    return sorted(regions, key=lambda region: -int(region.sum()))
