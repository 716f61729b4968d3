"""What every estimator gives: for a frame, the people in it.

Convention: pixel centres lie at +0.5, x to the right, y down. Left and right are the person's own.
Arrays of one person cover only that person's box, so that memory follows the people and not the
frame; `on_frame` puts them back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float32, UInt8

LANDMARK_NAMES = (
    "nose",
    *(
        f"{side}-eye-{place}"
        for side in ("left", "right")
        for place in ("inner", "middle", "outer")
    ),
    *("left-ear", "right-ear", "mouth-left", "mouth-right"),
    *(
        f"{side}-{joint}"
        for joint in ("shoulder", "elbow", "wrist", "pinky", "index", "thumb")
        for side in ("left", "right")
    ),
    *(
        f"{side}-{joint}"
        for joint in ("hip", "knee", "ankle", "heel", "foot-index")
        for side in ("left", "right")
    ),
)
"""BlazePose's 33, in its order (Bazarevsky et al., BlazePose, 2020)."""

LANDMARK_COUNT = len(LANDMARK_NAMES)
LANDMARK = {name: index for index, name in enumerate(LANDMARK_NAMES)}


@dataclass(frozen=True)
class Box:
    """Whole pixels of a frame: columns left..right, rows top..bottom, the ends not included."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def width(self) -> int:
        return self.right - self.left

    @property
    def height(self) -> int:
        return self.bottom - self.top

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, to index an array with."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def overlap(self, other: Box) -> float:
        """Intersection over union, 0..1."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.bottom, other.bottom) - max(self.top, other.top)
        shared = max(width, 0) * max(height, 0)
        return shared / max(1, self.width * self.height + other.width * other.height - shared)


@dataclass(frozen=True)
class Landmarks:
    """Points of one person, 33 in the order of `LANDMARK_NAMES`.

    Attributes:
        image: x and y in frame pixels, and depth in the same unit, 0 at the middle of the hips and
            smaller nearer to the camera. Points may lie outside the frame.
        world: metres from the middle of the hips; x to the right of the picture, y down, z away.
        visibility: chance that the point is in the picture and nothing covers it, 0..1.
        presence: chance that the point is in the picture, 0..1.
    """

    image: Float32[np.ndarray, "33 3"]
    world: Float32[np.ndarray, "33 3"]
    visibility: Float32[np.ndarray, " 33"]
    presence: Float32[np.ndarray, " 33"]


@dataclass(frozen=True)
class PersonEstimate:
    """One person of a frame.

    Attributes:
        track: the same number for the same person in all frames of a shot.
        box: where `iuv` and `alpha` lie.
        iuv: (I, U, V) of the body without clothes or hair; 0 where it is not.
        alpha: how much of each pixel is this person, with clothes and hair, 0..255.
        confidence: that a person is there, 0..1.
        landmarks: None where the estimator has none.
    """

    track: int
    box: Box
    iuv: UInt8[np.ndarray, "h w 3"]
    alpha: UInt8[np.ndarray, "h w"]
    confidence: float
    landmarks: Landmarks | None

    def on_frame(
        self, height: int, width: int
    ) -> tuple[UInt8[np.ndarray, "H W 3"], UInt8[np.ndarray, "H W"]]:
        """IUV and alpha on a whole frame of that size, 0 around the box."""
        iuv = np.zeros((height, width, 3), np.uint8)
        alpha = np.zeros((height, width), np.uint8)
        iuv[self.box.slices], alpha[self.box.slices] = self.iuv, self.alpha
        return iuv, alpha


class Estimator(Protocol):
    """Frames to people."""

    def estimate(self, frame: UInt8[np.ndarray, "H W 3"]) -> list[PersonEstimate]:
        """The people of the next frame of a shot, the most confident first; maybe nobody."""
        ...

    def start_shot(self) -> None:
        """Forget who was where: the next frame has nothing to do with the last one."""
        ...
