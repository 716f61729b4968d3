"""Retargeting: a driver's landmarks and mask brought to the proportions of a source.

Bones are measured between world landmarks, in metres: perspective does not change them. Every bone
keeps its direction and changes its length, from the pelvis outwards, so all joint angles stay. In
the picture the body is then moved up or down until its lowest landmark is as high as it was: who
stands on the floor still does, and who jumps is as far above it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

import cv2
import numpy as np
from jaxtyping import Float, Float32

from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.networks import SeenBody
from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.interface import (
    LANDMARK,
    LANDMARK_COUNT,
    SIDES,
    Bone,
    Landmarks,
    both_sides,
)

SHOWN = 0.5  # visibility and presence from which a landmark counts
GRID = 64  # the warp of a mask is computed at 64 x 64 places and interpolated between them
NEAR = 0.05  # lengths of the trunk: bones that are nearer than this count alike

LARGEST_CHANGE = 1.4
"""Times as long, or as short. Shares of the stature differ by less, even between a small child and
an adult; more is a bone that was measured wrongly."""

STATURE = ("trunk", "head", "thigh", "shin")
"""What lies above each other in somebody who stands."""

_MIDDLES = {
    "pelvis": ("left-hip", "right-hip"),
    "neck": ("left-shoulder", "right-shoulder"),
    "skull": ("left-ear", "right-ear"),
}
_CROWN = "crown"  # as far above the ears as the shoulders are below them: no hair reaches further

BONES: dict[str, tuple[Bone, ...]] = {
    "trunk": ((_MIDDLES["pelvis"], _MIDDLES["neck"]),),
    "shoulders": ((("right-shoulder",), ("left-shoulder",)),),
    "hips": ((("right-hip",), ("left-hip",)),),
    "head": ((_MIDDLES["neck"], _MIDDLES["skull"]),),
    "upper-arm": both_sides(("shoulder", "elbow")),
    "lower-arm": both_sides(("elbow", "wrist")),
    "thigh": both_sides(("hip", "knee")),
    "shin": both_sides(("knee", "ankle")),
}
"""What is measured; left and right are one bone, as people are nearly symmetric and measurements
are not."""

PLACE = {name: row for row, name in enumerate((*LANDMARK, *_MIDDLES, _CROWN))}
"""The landmarks, and places between them that bones start from."""

_ARM = (
    *(("shoulder", "elbow", "upper-arm"), ("elbow", "wrist", "lower-arm")),
    *(("wrist", finger, "lower-arm") for finger in ("pinky", "index", "thumb")),
)
_LEG = (
    *(("hip", "knee", "thigh"), ("knee", "ankle", "shin")),
    *(("ankle", "heel", "shin"), ("ankle", "foot-index", "shin")),
)
TREE: tuple[tuple[str, str, str], ...] = (
    *(("pelvis", "neck", "trunk"), ("neck", "skull", "head"), ("skull", _CROWN, "head")),
    *(("skull", name, "head") for name in LANDMARK if LANDMARK[name] < LANDMARK["left-shoulder"]),
    *(("neck", f"{side}-shoulder", "shoulders") for side in SIDES),
    *(("pelvis", f"{side}-hip", "hips") for side in SIDES),
    *((f"{s}-{a}", f"{s}-{b}", scale) for s in SIDES for a, b, scale in _ARM + _LEG),
)
"""From where, to where, and what scales it; hands go with the lower arm, feet with the shin."""

CONTROLS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("pelvis", "neck", ("shoulders", "hips")),
    *((f"{s}-hip", f"{s}-shoulder", ("shoulders", "hips")) for s in SIDES),
    *((f"left-{joint}", f"right-{joint}", (f"{joint}s",)) for joint in ("shoulder", "hip")),
    *(("neck", _CROWN, ("head",)), ("skull", "nose", ("head",))),
    *(
        (f"{s}-{a}", f"{s}-{b}", (scale,))
        for s in SIDES
        for a, b, scale in (*_ARM, *_LEG, ("heel", "foot-index", "shin"))
    ),
)
"""The lines along which a mask is warped, and whose mean scale widens it there."""


Proportions = dict[str, float]
"""Lengths of the bones that were shown, metres, by the names of `BONES`."""


@dataclass(frozen=True)
class BodyFit:
    """What turns a driver's proportions into a source's.

    Attributes:
        scales: For each of `BONES`, the new length over the driver's; 1 leaves it.
    """

    scales: dict[str, float]

    def __post_init__(self) -> None:
        whole = self.scales.keys() == BONES.keys()
        if not whole or not all(isfinite(scale) and scale > 0 for scale in self.scales.values()):
            raise InputError(
                f"scales {self.scales}; a body fit needs one above 0 for each of {', '.join(BONES)}"
            )


def measure_proportions(seen: Sequence[Landmarks]) -> Proportions:
    """Measure one person in one or many pictures: the median over those that show a bone.

    Raises: InputError for landmarks that are none.
    """
    lengths: dict[str, list[float]] = {name: [] for name in BONES}
    for landmarks in seen:
        _check_landmarks(landmarks)
        shown = np.minimum(landmarks.visibility, landmarks.presence) >= SHOWN
        for name, places in BONES.items():
            for start, end in places:
                rows = [[LANDMARK[joint] for joint in ends] for ends in (start, end)]
                # of two that a middle lies between one is enough: the other hides in profile
                if shown[rows[0]].any() and shown[rows[1]].any():
                    ends = [landmarks.world[row].mean(0) for row in rows]
                    lengths[name].append(float(np.linalg.norm(ends[1] - ends[0])))
    medians = {name: float(np.median(found)) for name, found in lengths.items() if found}
    return {name: length for name, length in medians.items() if length > 0}


def compare_proportions(source: Proportions, driver: Proportions) -> BodyFit:
    """Find what gives the driver's body the source's proportions, at the driver's own height.

    Height is that of the bones of `STATURE` which both show. A bone that one of them does not show
    stays the driver's; none changes by more than `LARGEST_CHANGE`.

    Raises: InputError where they have no bone of `STATURE` in common: nothing tells their sizes.
    """
    shared = source.keys() & driver.keys()
    stature = [name for name in STATURE if name in shared]
    if not stature:
        raise InputError(
            "too little of the body to compare: neither trunk, head nor legs are shown in both"
            " source and driver; use a photo that shows more, or leave out --fit-body"
        )
    heights = [sum(person[name] for name in stature) for person in (source, driver)]
    same_height = heights[1] / heights[0]
    scales = dict.fromkeys(BONES, 1.0)
    for name in shared:
        scale = source[name] * same_height / driver[name]
        scales[name] = min(max(scale, 1 / LARGEST_CHANGE), LARGEST_CHANGE)
    return BodyFit(scales)


def fit_landmarks(landmarks: Landmarks, fit: BodyFit) -> Landmarks:
    """Move landmarks to where they are in another body in the same pose.

    Visibility and presence stay. Raises: InputError for landmarks that are none.
    """
    _check_landmarks(landmarks)
    return replace(
        landmarks,
        image=_fit_image(landmarks, fit)[:LANDMARK_COUNT].astype(np.float32),
        world=_fit_places(_places(landmarks.world), fit)[:LANDMARK_COUNT].astype(np.float32),
    )


def fit_body(body: SeenBody, fit: BodyFit) -> SeenBody:
    """Make what BlazePose would have seen of another body in the same pose: landmarks and mask.

    The region grows where the body does; where to look next stays, as the frame has not changed.
    Raises: InputError for landmarks that are none.
    """
    fitted = fit_landmarks(body.landmarks, fit)
    before = _places(body.landmarks.image)[:, :2]
    after = _fit_image(body.landmarks, fit)[:, :2]
    # larger by what the body reaches further from the region's middle
    middle = (body.region.x, body.region.y)
    reach = [np.abs(points - middle).max() for points in (before, after)]
    growth = max(1.0, float(reach[1] / max(reach[0], 1e-6)))
    region = replace(body.region, side=body.region.side * growth)
    mask = _warp(body.mask, body.region, region, before, after, fit)
    return replace(body, landmarks=fitted, region=region, mask=mask, features=None)


def _check_landmarks(landmarks: Landmarks) -> None:
    points, chances = (LANDMARK_COUNT, 3), (LANDMARK_COUNT,)
    for values, shape in (
        *((landmarks.image, points), (landmarks.world, points)),
        *((landmarks.visibility, chances), (landmarks.presence, chances)),
    ):
        if values.shape != shape or not np.isfinite(values).all():
            raise InputError(
                f"landmarks of shape {values.shape}, all finite: {np.isfinite(values).all()};"
                f" {shape} finite numbers are needed"
            )


def _places(points: Float32[np.ndarray, "33 3"]) -> Float[np.ndarray, "places 3"]:
    middles = [points[[LANDMARK[name] for name in ends]].mean(0) for ends in _MIDDLES.values()]
    _, neck, skull = middles
    return np.concatenate([points, np.stack([*middles, 2 * skull - neck])]).astype(np.float64)


def _fit_places(
    places: Float[np.ndarray, "places 3"], fit: BodyFit
) -> Float[np.ndarray, "places 3"]:
    fitted = places.copy()
    for start, end, scale in TREE:
        bone = places[PLACE[end]] - places[PLACE[start]]
        fitted[PLACE[end]] = fitted[PLACE[start]] + fit.scales[scale] * bone
    return fitted


def _fit_image(landmarks: Landmarks, fit: BodyFit) -> Float[np.ndarray, "places 3"]:
    fitted = _fit_places(_places(landmarks.image), fit)
    # of all landmarks and not of the feet: also people who sit, kneel or stand on their hands stay
    fitted[:, 1] += landmarks.image[:, 1].max() - fitted[:LANDMARK_COUNT, 1].max()
    return fitted


def _warp(
    mask: Float32[np.ndarray, "S S"],
    old: Region,
    new: Region,
    before: Float[np.ndarray, "places 2"],
    after: Float[np.ndarray, "places 2"],
    fit: BodyFit,
) -> Float32[np.ndarray, "S S"]:
    """Warp the mask into the new region.

    Each pixel is looked up where every bone says that it comes from: as far along the bone, and as
    far beside it by the bone's width; near bones count more. This is the field of Beier and Neely,
    Feature-based image metamorphosis (SIGGRAPH 1992), without turns, as bones keep their direction.
    """
    size = mask.shape[0]
    to_frame, from_frame = new.matrix(size), cv2.invertAffineTransform(old.matrix(size))
    coarse = (np.arange(GRID) + 0.5) * (size / GRID) - 0.5
    x, y = (axis.reshape(-1) for axis in np.meshgrid(coarse, coarse))
    # OpenCV's whole numbers are pixel centres
    places = np.stack([x, y], 1) @ to_frame[:, :2].T + to_frame[:, 2] + 0.5
    moves = _moves(places, before, after, fit) @ from_frame[:, :2].T
    moves = moves.reshape(GRID, GRID, 2).astype(np.float32)
    column, row = np.meshgrid(np.arange(size), np.arange(size))
    # only moves are interpolated: where nothing moves, every pixel stays exactly what it was
    still = from_frame @ np.vstack([to_frame, [0, 0, 1]])
    origin = np.stack([column, row], -1) @ still[:, :2].T + still[:, 2]
    origin = (origin + cv2.resize(moves, (size, size))).astype(np.float32)
    return cv2.remap(mask, origin[..., 0].copy(), origin[..., 1].copy(), cv2.INTER_LINEAR)


def _moves(
    places: Float[np.ndarray, "N 2"],
    before: Float[np.ndarray, "places 2"],
    after: Float[np.ndarray, "places 2"],
    fit: BodyFit,
) -> Float[np.ndarray, "N 2"]:
    """Tell how far it is from places of the fitted body to where they come from, frame pixels."""
    rows = np.array([[PLACE[start], PLACE[end]] for start, end, _ in CONTROLS])
    width = np.array([np.mean([fit.scales[name] for name in names]) for _, _, names in CONTROLS])
    start, along = after[rows[:, 0]], after[rows[:, 1]] - after[rows[:, 0]]
    origin, origin_along = before[rows[:, 0]], before[rows[:, 1]] - before[rows[:, 0]]
    away = places[:, None] - start  # N controls 2
    length = np.maximum(np.square(along).sum(-1), 1e-6)
    share = ((away * along).sum(-1) / length).clip(0, 1)[..., None]
    beside = away - share * along
    moves = origin + share * origin_along + beside / width[:, None] - places[:, None]
    # the shoulders' width too, as a trunk that leans towards the camera is short in the picture
    trunk = np.linalg.norm(after[PLACE["neck"]] - after[PLACE["pelvis"]])
    shoulders = np.linalg.norm(after[PLACE["left-shoulder"]] - after[PLACE["right-shoulder"]])
    near = NEAR * max(float(trunk), float(shoulders), 1.0)
    weight = 1 / np.square(np.square(beside).sum(-1) + near**2)
    weight /= weight.sum(1, keepdims=True)
    return (moves * weight[..., None]).sum(1)
