"""Retargeting: a driver's landmarks and mask brought to the proportions of a source.

Convention: every bone keeps its direction and changes its length, from the pelvis outwards, so all
joint angles stay. In the picture the body is then moved up or down until its lowest landmark is as
high as it was: who stands on the floor still does, and who jumps is as far above it.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float, Float32

from motion_transfer.estimate.blazepose_landmarks import SeenBody
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_COUNT, Landmarks
from motion_transfer.estimate.proportions import BodyFit, check_landmarks
from motion_transfer.estimate.region import Region

GRID = 64
"""The warp of a mask is computed at 64 x 64 places and interpolated between them."""

NEAR = 0.05
"""Lengths of the trunk: bones that are nearer than this count alike."""

_MIDDLES = {
    "pelvis": ("left-hip", "right-hip"),
    "neck": ("left-shoulder", "right-shoulder"),
    "skull": ("left-ear", "right-ear"),
}
_CROWN = "crown"
"""As far above the ears as the shoulders are below them: no hair reaches further."""

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
    *(("neck", f"{side}-shoulder", "shoulders") for side in ("left", "right")),
    *(("pelvis", f"{side}-hip", "hips") for side in ("left", "right")),
    *((f"{s}-{a}", f"{s}-{b}", scale) for s in ("left", "right") for a, b, scale in _ARM + _LEG),
)
"""From where, to where, and what scales it; hands go with the lower arm, feet with the shin."""

CONTROLS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("pelvis", "neck", ("shoulders", "hips")),
    *((f"{s}-hip", f"{s}-shoulder", ("shoulders", "hips")) for s in ("left", "right")),
    *((f"left-{joint}", f"right-{joint}", (f"{joint}s",)) for joint in ("shoulder", "hip")),
    *(("neck", _CROWN, ("head",)), ("skull", "nose", ("head",))),
    *(
        (f"{s}-{a}", f"{s}-{b}", (scale,))
        for s in ("left", "right")
        for a, b, scale in (*_ARM, *_LEG, ("heel", "foot-index", "shin"))
    ),
)
"""The lines along which a mask is warped, and whose mean scale widens it there."""


def fit_landmarks(landmarks: Landmarks, fit: BodyFit) -> Landmarks:
    """The landmarks of the same pose in another body.

    Visibility and presence stay. Raises: InputError for landmarks that are none.
    """
    check_landmarks(landmarks)
    return replace(
        landmarks,
        image=_fitted_image(landmarks, fit)[:LANDMARK_COUNT].astype(np.float32),
        world=_fitted_places(_places(landmarks.world), fit)[:LANDMARK_COUNT].astype(np.float32),
    )


def fit_body(body: SeenBody, fit: BodyFit) -> SeenBody:
    """What BlazePose would have seen of the same pose in another body: landmarks and mask.

    The region grows where the body does; where to look next stays, as the frame has not changed.
    Raises: InputError for landmarks that are none.
    """
    fitted = fit_landmarks(body.landmarks, fit)
    before = _places(body.landmarks.image)[:, :2]
    after = _fitted_image(body.landmarks, fit)[:, :2]
    region = _grown(body.region, before, after)
    mask = _warp(body.mask, body.region, region, before, after, fit)
    return replace(body, landmarks=fitted, region=region, mask=mask)


def _places(points: Float32[np.ndarray, "33 3"]) -> Float[np.ndarray, "places 3"]:
    middles = [points[[LANDMARK[name] for name in ends]].mean(0) for ends in _MIDDLES.values()]
    _, neck, skull = middles
    return np.concatenate([points, np.stack([*middles, 2 * skull - neck])]).astype(np.float64)


def _fitted_places(
    places: Float[np.ndarray, "places 3"], fit: BodyFit
) -> Float[np.ndarray, "places 3"]:
    fitted = places.copy()
    for start, end, scale in TREE:
        bone = places[PLACE[end]] - places[PLACE[start]]
        fitted[PLACE[end]] = fitted[PLACE[start]] + fit.scales[scale] * bone
    return fitted


def _fitted_image(landmarks: Landmarks, fit: BodyFit) -> Float[np.ndarray, "places 3"]:
    fitted = _fitted_places(_places(landmarks.image), fit)
    # of all landmarks and not of the feet: also people who sit, kneel or stand on their hands stay
    fitted[:, 1] += landmarks.image[:, 1].max() - fitted[:LANDMARK_COUNT, 1].max()
    return fitted


def _grown(
    region: Region, before: Float[np.ndarray, "places 2"], after: Float[np.ndarray, "places 2"]
) -> Region:
    """The region, larger by what the body reaches further from its middle."""
    reach = [np.abs(points - (region.x, region.y)).max() for points in (before, after)]
    return replace(region, side=region.side * max(1.0, float(reach[1] / max(reach[0], 1e-6))))


def _warp(
    mask: Float32[np.ndarray, "S S"],
    old: Region,
    new: Region,
    before: Float[np.ndarray, "places 2"],
    after: Float[np.ndarray, "places 2"],
    fit: BodyFit,
) -> Float32[np.ndarray, "S S"]:
    """The mask in the new region.

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
    """From places of the fitted body to where they come from, frame pixels."""
    rows = np.array([[PLACE[start], PLACE[end]] for start, end, _ in CONTROLS])
    width = np.array([np.mean([fit.scales[name] for name in names]) for _, _, names in CONTROLS])
    start, along = after[rows[:, 0]], after[rows[:, 1]] - after[rows[:, 0]]
    origin, origin_along = before[rows[:, 0]], before[rows[:, 1]] - before[rows[:, 0]]
    away = places[:, None] - start  # N controls 2
    length = np.maximum(np.square(along).sum(-1), 1e-6)
    share = ((away * along).sum(-1) / length).clip(0, 1)[..., None]
    beside = away - share * along
    moves = origin + share * origin_along + beside / width[:, None] - places[:, None]
    trunk = np.linalg.norm(after[PLACE["neck"]] - after[PLACE["pelvis"]])
    shoulders = np.linalg.norm(after[PLACE["left-shoulder"]] - after[PLACE["right-shoulder"]])
    near = NEAR * max(float(trunk), float(shoulders), 1.0)
    weight = 1 / np.square(np.square(beside).sum(-1) + near**2)
    weight /= weight.sum(1, keepdims=True)
    return (moves * weight[..., None]).sum(1)
