"""MediaPipe's face network: 468 points of a face, looked for where the body's landmarks are.

Source: Kartynnik et al., Real-time facial surface geometry from monocular video on mobile GPUs
(2019); the second crop is that of MediaPipe's graph `face_landmark_landmarks_to_roi` (0.10.14).
"""

from __future__ import annotations

from functools import cache
from math import atan2, exp, hypot, pi

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.inference import CpuNetwork
from motion_transfer.estimate.interface import AT_ONCE, LANDMARK, Landmarks
from motion_transfer.estimate.models import FACE_LANDMARKER, find_model

POINT_COUNT = 468
OUTER_EYES = (33, 263)
"""Points of both eyes' outer corners, the picture's left one first: MediaPipe's own numbers."""

FACE_SIZE = 192
FIRST_CROP = 3.7
"""Times how large the body's landmarks say that the face is. Measured: the middle of what the
second crop comes to on synthetic people."""

CROP = 1.5  # times the points' own extent

LEAST_PRESENCE = 0.95
"""Chance that a face is there. Measured: of synthetic people who look at the camera, or past it by
less than 60 degrees, nearly all have more; of those seen from behind or beyond the profile none."""

LEAST_CROP = 30  # px of a crop's side: two thirds of it is the face


class FaceModel:
    """The network; threads may share it.

    Raises: InputError where the model is missing.
    """

    def __init__(self) -> None:
        self._network = CpuNetwork(find_model(FACE_LANDMARKER), at_once=AT_ONCE)

    def find(
        self, frame: UInt8[np.ndarray, "H W 3"], landmarks: Landmarks
    ) -> Float32[np.ndarray, "468 3"] | None:
        """Find the points of the face of somebody whose landmarks are known.

        Returns: X and y in frame pixels, and depth in the same unit, smaller nearer to the camera;
            None where the face is not surely seen.
        """
        region, points = first_region(landmarks), None
        for _ in range(2):  # where the first look's points are one sees better
            if not region.is_usable or region.side < LEAST_CROP or not region.has_middle_in(frame):
                return None
            points = self._look(frame, region)
            if points is None:
                return None
            region = next_region(points)
        return points

    def _look(
        self, frame: UInt8[np.ndarray, "H W 3"], region: Region
    ) -> Float32[np.ndarray, "468 3"] | None:
        seen = region.cut(frame, FACE_SIZE)
        found, logit = self._network.run(seen[None].astype(np.float32) / 255)
        if 1 / (1 + exp(-logit.item())) < LEAST_PRESENCE:
            return None
        points = found.reshape(POINT_COUNT, 3) / FACE_SIZE
        on_frame = region.to_frame(points[:, :2])
        return np.concatenate([on_frame, points[:, 2:] * region.side], 1).astype(np.float32)


@cache
def open_face_model() -> FaceModel:
    """Open the network, once for the whole process. Raises: InputError as `FaceModel`."""
    return FaceModel()


def find_face(
    frame: UInt8[np.ndarray, "H W 3"], landmarks: Landmarks
) -> Float32[np.ndarray, "468 3"] | None:
    """Find the face of somebody whose landmarks are known; None where it is not surely seen."""
    return open_face_model().find(frame, landmarks)


def first_region(landmarks: Landmarks) -> Region:
    """Lay the region in which a face is looked for, upright, from the body's landmarks."""
    places = {name: landmarks.image[row, :2].astype(float) for name, row in LANDMARK.items()}
    left, right = (
        np.mean([places[f"{side}-eye-{part}"] for part in ("inner", "middle", "outer")], 0)
        for side in ("left", "right")
    )
    eyes, mouth = (left + right) / 2, (places["mouth-left"] + places["mouth-right"]) / 2
    ears = (places["left-ear"] + places["right-ear"]) / 2
    across, down, ahead = left - right, mouth - eyes, places["nose"] - ears
    # one of them is seen at its length, whichever way the face looks
    size = max(
        *(hypot(*down), hypot(*across), 0.6 * hypot(*ahead)),
        0.45 * hypot(*(places["left-ear"] - places["right-ear"])),
    )
    # eyes lie across; in profile the mouth still lies below
    x, y = down + np.array([-across[1], across[0]])
    middle = (eyes + mouth) / 2
    return Region(
        float(middle[0]), float(middle[1]), FIRST_CROP * size, atan2(float(y), float(x)) - pi / 2
    )


def next_region(points: Float32[np.ndarray, "468 3"]) -> Region:
    """Lay the region around a face whose points are known, its eyes level."""
    x, y = points[OUTER_EYES[1], :2] - points[OUTER_EYES[0], :2]
    upright = Region(0, 0, 1, atan2(float(y), float(x)))
    back = Region(0, 0, 1, -upright.turn).rotate(points[:, :2])
    low, high = back.min(0), back.max(0)
    middle = upright.rotate((low + high)[None] / 2)[0]
    side = CROP * float((high - low).max())
    return Region(float(middle[0]), float(middle[1]), side, upright.turn)
