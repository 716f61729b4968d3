"""How long a person's bones are, and what turns one person's proportions into another's.

Lengths are those of the world landmarks, metres: perspective does not change them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from motion_transfer.errors import InputError
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_COUNT, Landmarks

SHOWN = 0.5
"""Visibility and presence from which a landmark counts."""

LARGEST_CHANGE = 1.4
"""Times as long, or as short. Shares of the stature differ by less, even between a small child and
an adult; more is a bone that was measured wrongly."""

STATURE = ("trunk", "head", "thigh", "shin")
"""What lies above each other in somebody who stands."""

Ends = tuple[tuple[str, ...], tuple[str, ...]]


def _both(*ends: tuple[str, str]) -> tuple[Ends, ...]:
    return tuple(
        ((f"{side}-{start}",), (f"{side}-{end}",))
        for side in ("left", "right")
        for start, end in ends
    )


_SHOULDERS = ("left-shoulder", "right-shoulder")
_HIPS = ("left-hip", "right-hip")

BONES: dict[str, tuple[Ends, ...]] = {
    "trunk": ((_HIPS, _SHOULDERS),),
    "shoulders": (((_SHOULDERS[1],), (_SHOULDERS[0],)),),
    "hips": (((_HIPS[1],), (_HIPS[0],)),),
    "head": ((_SHOULDERS, ("left-ear", "right-ear")),),
    "upper-arm": _both(("shoulder", "elbow")),
    "lower-arm": _both(("elbow", "wrist")),
    "thigh": _both(("hip", "knee")),
    "shin": _both(("knee", "ankle")),
}
"""Each from the middle of some landmarks to the middle of others; left and right are one bone, as
people are nearly symmetric and measurements are not."""


@dataclass(frozen=True)
class Proportions:
    """Lengths of the bones that were shown, metres, by the names of `BONES`."""

    lengths: dict[str, float]


@dataclass(frozen=True)
class BodyFit:
    """What turns a driver's proportions into a source's.

    Attributes:
        scales: for each of `BONES`, the new length over the driver's; 1 leaves it.
    """

    scales: dict[str, float]

    def __post_init__(self) -> None:
        unfit = {
            name: self.scales.get(name)
            for name in BONES
            if not (isfinite(self.scales.get(name, 0)) and self.scales.get(name, 0) > 0)
        }
        if unfit or len(self.scales) != len(BONES):
            raise InputError(
                f"scales {self.scales}; a body fit needs one above 0 for each of {', '.join(BONES)}"
            )


def measure_proportions(seen: Sequence[Landmarks]) -> Proportions:
    """One person's proportions, from one or many pictures: the median over those that show a bone.

    Raises: InputError for landmarks that are none.
    """
    lengths: dict[str, list[float]] = {name: [] for name in BONES}
    for landmarks in seen:
        check_landmarks(landmarks)
        shown = np.minimum(landmarks.visibility, landmarks.presence) >= SHOWN
        for name, places in BONES.items():
            for start, end in places:
                rows = [[LANDMARK[joint] for joint in ends] for ends in (start, end)]
                # of two that a middle lies between one is enough: the other hides in profile
                if shown[rows[0]].any() and shown[rows[1]].any():
                    ends = [landmarks.world[row].mean(0) for row in rows]
                    lengths[name].append(float(np.linalg.norm(ends[1] - ends[0])))
    medians = {name: float(np.median(found)) for name, found in lengths.items() if found}
    return Proportions({name: length for name, length in medians.items() if length > 0})


def compare_proportions(source: Proportions, driver: Proportions) -> BodyFit:
    """What gives the driver's body the source's proportions, at the driver's own height.

    Height is that of the bones of `STATURE` which both show. A bone that one of them does not show
    stays the driver's; none changes by more than `LARGEST_CHANGE`.

    Raises: InputError where they have no bone of `STATURE` in common: nothing tells their sizes.
    """
    shared = [name for name in STATURE if name in source.lengths and name in driver.lengths]
    if not shared:
        raise InputError(
            "too little of the body to compare: neither trunk, head nor legs are shown in both"
            " source and driver; use a photo that shows more, or leave out --fit-body"
        )
    heights = [sum(person.lengths[name] for name in shared) for person in (source, driver)]
    same_height = heights[1] / heights[0]
    scales = dict.fromkeys(BONES, 1.0)
    for name in BONES:
        if name in source.lengths and name in driver.lengths:
            scale = source.lengths[name] * same_height / driver.lengths[name]
            scales[name] = min(max(scale, 1 / LARGEST_CHANGE), LARGEST_CHANGE)
    return BodyFit(scales)


def check_landmarks(landmarks: Landmarks) -> None:
    """Raises: InputError for landmarks of another number, or that are no numbers."""
    wanted = ((landmarks.image, 2), (landmarks.world, 2))
    wanted += ((landmarks.visibility, 1), (landmarks.presence, 1))
    for values, dimensions in wanted:
        shape = (LANDMARK_COUNT, 3)[:dimensions]
        if values.shape != shape or not np.isfinite(values).all():
            raise InputError(
                f"landmarks of shape {values.shape}, all finite: {np.isfinite(values).all()};"
                f" {shape} finite numbers are needed"
            )
