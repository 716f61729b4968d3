"""Feet that stand: where the picture shows a heel or a ball of a foot keep its place, so does it.

A picture says little about depth, so feet that stand still in it slide to and fro in the world. How
fast they move in the picture, seen over a fifth of a second, tells when they stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from motion_transfer.estimate.interface import LANDMARK
from motion_transfer.tracking.puppet import Points, Slopes

FEET = [
    LANDMARK[f"{side}-{place}"] for side in ("left", "right") for place in ("heel", "foot-index")
]
SEEN_FROM = 0.2  # weight; a foot under a skirt has little, and what is guessed of it is steady
SLOW = 0.1  # heights of the body a second: what moves less, stands
AWAY = 0.02  # heights: what has gone so far from where it stood has taken a step
LEAST_SECONDS = 0.2  # of standing; shorter rests are those between two moves
ABOVE_FLOOR = 0.12  # metres above the lowest foot of the shot: higher up, nothing stands
FLOOR = 0.1  # share of the heights of feet that may lie below that

SIGMA = 0.01
"""Metres by which a foot that stands is off, at most times."""


@dataclass(frozen=True)
class Standing:
    """One landmark of a foot that keeps its place for some frames."""

    landmark: int
    frames: range


def find_standing(
    shown: Float64[np.ndarray, "N 33 2"],
    weight: Float64[np.ndarray, "N 33"],
    points: Points,
    height_px: float,
    frame_rate: float,
) -> list[Standing]:
    """Find where feet stand.

    Args:
        shown: Where the picture shows the landmarks, px.
        points: Where they are by a first fit, world.
        height_px: Of the body in the picture.
    """
    least = max(2, round(LEAST_SECONDS * frame_rate))
    if len(shown) < least:
        return []
    heights = points[:, FEET, 2]
    low = heights < np.quantile(heights, FLOOR) + ABOVE_FLOOR
    found = []
    for column, landmark in enumerate(FEET):
        place = _steadied(shown[:, landmark], least) / height_px
        speed = np.linalg.norm(np.gradient(place, axis=0), axis=1) * frame_rate
        stands = (speed < SLOW) & low[:, column] & (weight[:, landmark] > SEEN_FROM)
        start = 0
        for frame in range(len(stands) + 1):
            goes_on = frame < len(stands) and stands[frame]
            if goes_on and np.linalg.norm(place[frame] - place[start : frame + 1].mean(0)) < AWAY:
                continue
            if frame - start >= least:
                found.append(Standing(landmark, range(start, frame)))
            start = frame if goes_on else frame + 1
    return found


def pull(
    standing: Sequence[Standing],
    points: Points,
    slopes: Slopes,
    blocks: Float64[np.ndarray, "N P P"],
    right: Float64[np.ndarray, "N P"],
) -> None:
    """Add to normal equations what draws each foot that stands to the middle of where it is."""
    for one in standing:
        frames = slice(one.frames.start, one.frames.stop)
        places = points[frames, one.landmark]
        away, moves = (places - places.mean(0)) / SIGMA, slopes[frames, one.landmark] / SIGMA
        blocks[frames] += moves.swapaxes(1, 2) @ moves
        right[frames] -= np.einsum("ncp,nc->np", moves, away)


def _steadied(places: Float64[np.ndarray, "N 2"], length: int) -> Float64[np.ndarray, "N 2"]:
    """Take the tremble out: the mean over so many frames around each."""
    ends = np.pad(places, ((length // 2, (length - 1) // 2), (0, 0)), mode="edge")
    sums = np.cumsum(np.concatenate([np.zeros((1, 2)), ends]), axis=0)
    return (sums[length:] - sums[:-length]) / length
