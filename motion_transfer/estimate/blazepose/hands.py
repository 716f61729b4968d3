"""MediaPipe's hand networks: where a hand is, from the body's landmarks, and its 21 points.

Source: Bazarevsky and Zhang, On-device real-time hand tracking with MediaPipe (2019); the crops'
numbers are those of MediaPipe's graphs `hand_landmarks_from_pose_to_recrop_roi` and
`hand_recrop_by_roi_cpu` (0.10.14).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import atan2, hypot, pi

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.inference import CpuNetwork
from motion_transfer.estimate.interface import AT_ONCE, LANDMARK, SIDES, Landmarks
from motion_transfer.estimate.models import HAND_CROPPER, HAND_LANDMARKER, find_model

POINT_COUNT = 21
"""The wrist, then four of each finger from the thumb on: its knuckles, the nearest first, and its
tip."""

CROPPER_SIZE, LANDMARKS_SIZE = 256, 224
FIRST_CROP = 2.7  # times twice the way from the wrist to the knuckles
TOWARDS_TIPS = 0.1  # both crops are moved by this share of their side, away from the wrist

SURE = 0.3  # visibility from which wrist and knuckles of the body are looked at
LEAST_PRESENCE = 0.8
"""Chance that a hand is there. Measured: of synthetic people's hands, those less sure than this are
drawn no better than the IUV network paints them, all others are (an intersection over union of 0.75
instead of 0.58)."""

LEAST_SIDE = 0.1
"""Chance that it is a hand of the side that it is taken for; with less it is the other one, or the
body's left and right were taken for each other."""

LEAST_SIZE = 16  # px from the wrist to the knuckles' middle, doubled: in smaller ones nothing shows


class HandModel:
    """The two networks; threads may share it.

    Raises: InputError where the models are missing.
    """

    def __init__(self) -> None:
        self._cropper = CpuNetwork(find_model(HAND_CROPPER), at_once=AT_ONCE)
        self._landmarker = CpuNetwork(find_model(HAND_LANDMARKER), at_once=AT_ONCE)

    def find(
        self, frame: UInt8[np.ndarray, "H W 3"], landmarks: Landmarks, side: str
    ) -> Float32[np.ndarray, "21 3"] | None:
        """Find the points of a hand of somebody whose landmarks are known.

        Args:
            side: The person's own, `left` or `right`.
        Returns: X and y in frame pixels, and depth in the same unit, 0 at the wrist and smaller
            nearer to the camera; None where the hand is not surely seen.
        """
        rows = [LANDMARK[f"{side}-{name}"] for name in ("wrist", "index", "pinky")]
        if (landmarks.visibility[rows] < SURE).any():
            return None
        region = first_region(*landmarks.image[rows, :2])
        if region.side < FIRST_CROP * LEAST_SIZE or not region.has_middle_in(frame):
            return None
        region = self._crop(frame, region)
        if not region.is_usable:
            return None
        seen = region.cut(frame, LANDMARKS_SIZE)
        outputs = self._landmarker.run(seen[None].astype(np.float32) / 255)
        points, (presence, is_right) = outputs[0].reshape(-1, 3), (o.item() for o in outputs[1:3])
        of_side = is_right if side == "right" else 1 - is_right
        if presence < LEAST_PRESENCE or of_side < LEAST_SIDE:
            return None
        on_frame = region.to_frame(points[:, :2] / LANDMARKS_SIZE)
        depth = points[:, 2:] / LANDMARKS_SIZE * region.side
        return np.concatenate([on_frame, depth], 1).astype(np.float32)

    def _crop(self, frame: UInt8[np.ndarray, "H W 3"], region: Region) -> Region:
        """Look where in a crop the hand lies."""
        seen = region.cut(frame, CROPPER_SIZE)
        (found,) = self._cropper.run(seen[None].astype(np.float32) / 255)
        middle, below = region.to_frame(found.reshape(2, 2) / CROPPER_SIZE)
        return _region(middle, middle - below, 2.0)


@cache
def open_hand_model() -> HandModel:
    """Open the networks, once for the whole process. Raises: InputError as `HandModel`."""
    return HandModel()


def find_hands(
    frame: UInt8[np.ndarray, "H W 3"], landmarks: Landmarks, sides: Sequence[str] = SIDES
) -> dict[str, Float32[np.ndarray, "21 3"]]:
    """Find the hands of somebody whose landmarks are known."""
    model = open_hand_model()
    found = {side: model.find(frame, landmarks, side) for side in sides}
    return {side: points for side, points in found.items() if points is not None}


def first_region(wrist: np.ndarray, index: np.ndarray, pinky: np.ndarray) -> Region:
    """Lay the region in which a hand is looked for: from the body's landmarks, x and y each."""
    knuckle = (2 * index + pinky) / 3  # of the middle finger
    return _region(knuckle, knuckle - wrist, 2 * FIRST_CROP)


def _region(middle: np.ndarray, up: np.ndarray, scale: float) -> Region:
    """Lay a square with a direction of the frame upwards, so many times as large as that is long,
    and move it towards the tips."""
    x, y = float(up[0]), float(up[1])
    side = scale * hypot(x, y)
    turn = pi / 2 - atan2(-y, x)
    region = Region(float(middle[0]), float(middle[1]), side, turn)
    ahead = region.to_frame(np.array([[0.5, 0.5 - TOWARDS_TIPS]], np.float32))[0]
    return Region(float(ahead[0]), float(ahead[1]), side, turn)
