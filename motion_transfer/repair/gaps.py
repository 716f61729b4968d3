"""Frames in which nobody was found, filled from the frames around them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from motion_transfer.media.nearest import take_nearest

FillGaps = Literal["hold", "interpolate"]

MATCHED_PIXELS = 400  # of one part: plenty for the six numbers of its movement
MATCH_LEVELS = 6.0  # of 255 in U and V: further apart is another place of the part
FEWEST_MATCHES = 24
LARGEST_STRETCH = 2.0  # in a gap; a part that grows more was matched wrongly
JOIN_SHARE = 0.03  # of the frame's height: regions this close are one person
CRACK_PX = 5

Frame = UInt8[np.ndarray, "H W C"]
Mask = Bool[np.ndarray, "H W"]
Movement = Float[np.ndarray, "2 3"]
"""An affine map of (x, y) px: from a place to where it is in the other frame."""


def fill_gaps(frames: Iterable[Frame], how: FillGaps) -> Iterator[Frame]:
    """The frames, those without anybody filled; at most two are kept at a time.

    At the ends, and with `hold`, the nearest frame before (at the start: after) is repeated. With
    `interpolate`, see `blend`. A sequence of nobody stays as it is.
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
    for _ in range(waiting):
        if last is not None:
            yield last
        elif frame is not None:
            yield frame


def blend(before: Frame, after: Frame, time: float) -> Frame:
    """What lies between two frames, `time` in 0..1.

    The nearer frame is taken, and each part of each person in it is moved along the way to the same
    places, by (I, U, V), in the other one: an affine map for each part. People are connected
    regions; one without a partner stays where it is. Pixels are moved whole, never mixed.
    """
    near, far, way = (before, after, time) if time < 0.5 else (after, before, 1 - time)
    filled = np.zeros_like(near)
    for mine, other in _pair_people(near, far):
        person = near * mine[..., None]
        if other is None:
            np.copyto(filled, person, where=mine[..., None])
            continue
        _move_person(filled, person, far * other[..., None], way)
    body = (filled[..., 0] > 0).astype(np.uint8)
    closed = cv2.morphologyEx(body, cv2.MORPH_CLOSE, np.ones((CRACK_PX, CRACK_PX), np.uint8))
    cracks = (closed > 0) & (body == 0)
    # the nearest pixel of the body, not of the background
    mended = take_nearest(filled, filled[..., 0] == 0)
    filled[cracks] = mended[cracks]
    return filled


def _move_person(filled: Frame, person: Frame, partner: Frame, way: float) -> None:
    """Draw a person on its way to its partner into a frame, large parts first."""
    parts, counts = np.unique(person[..., 0], return_counts=True)
    by_size = [int(part) for part in parts[np.argsort(-counts)] if part]
    whole = _shift(person[..., 0] > 0, partner[..., 0] > 0)
    size = filled.shape[1::-1]
    for part in by_size:
        movement = _find_movement(person, partner, part)
        movement = whole if movement is None else movement
        step = (1 - way) * np.eye(2, 3) + way * movement
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
    distance, match = cKDTree(partner[other][:, 1:]).query(
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
    return np.hstack([np.eye(2), np.median(goal - start[:, :2], axis=0)[:, None]])


def _shift(mine: Mask, other: Mask) -> Movement:
    centres = [np.argwhere(mask).mean(0)[::-1] for mask in (mine, other)]
    return np.hstack([np.eye(2), (centres[1] - centres[0])[:, None]])


def _pair_people(near: Frame, far: Frame) -> list[tuple[Mask, Mask | None]]:
    """Each person of one frame with the nearest of similar size in the other, largest first."""
    mine, others = _find_regions(near), _find_regions(far)
    pairs: list[tuple[Mask, Mask | None]] = []
    for region in mine:
        similar = [o for o in others if 0.25 < o.sum() / region.sum() < 4]
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
