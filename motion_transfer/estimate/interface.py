"""What every estimator gives: for a frame, the people in it.

Convention: pixel centres lie at +0.5, x to the right, y down. Left and right are the person's own.
Arrays of one person cover only that person's box, so that memory follows the people and not the
frame; `PersonEstimate.on_frame` puts them back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError

AT_ONCE = 2
"""How many frames are finished at once, see `StagedEstimator`. Measured: BlazePose takes as long to
find somebody, which is done frame after frame, as the IUV takes to be painted."""

SIDES = ("left", "right")
_PAIRED = (
    *("shoulder", "elbow", "wrist", "pinky", "index", "thumb"),
    *("hip", "knee", "ankle", "heel", "foot-index"),
)
LANDMARK_NAMES = (
    "nose",
    *(f"{side}-eye-{place}" for side in SIDES for place in ("inner", "middle", "outer")),
    *("left-ear", "right-ear", "mouth-left", "mouth-right"),
    *(f"{side}-{joint}" for joint in _PAIRED for side in SIDES),
)
"""BlazePose's 33, in its order (Bazarevsky et al., BlazePose, 2020)."""

LANDMARK_COUNT = len(LANDMARK_NAMES)
LANDMARK = {name: index for index, name in enumerate(LANDMARK_NAMES)}


def other_side(name: str) -> str:
    """Name the mirror image of a landmark; of the nose it is the nose."""
    swap = {"left": "right", "right": "left"}
    return "-".join(swap.get(word, word) for word in name.split("-"))


Bone = tuple[tuple[str, ...], tuple[str, ...]]
"""A line from the middle of some landmarks to the middle of others."""


def both_sides(*ends: tuple[str, str]) -> tuple[Bone, ...]:
    """List the bones between joints that both sides of a body have, the left ones first."""
    return tuple(((f"{side}-{a}",), (f"{side}-{b}",)) for side in SIDES for a, b in ends)


@dataclass(frozen=True)
class Landmarks:
    """Points of one person, 33 in the order of `LANDMARK_NAMES`.

    Attributes:
        image: X and y in frame pixels, and depth in the same unit, 0 at the middle of the hips and
            smaller nearer to the camera. Points may lie outside the frame.
        world: Metres from the middle of the hips; x to the right of the picture, y down, z away.
        visibility: Chance that the point is in the picture and nothing covers it, 0..1.
        presence: Chance that the point is in the picture, 0..1.
    """

    image: Float32[np.ndarray, "33 3"]
    world: Float32[np.ndarray, "33 3"]
    visibility: Float32[np.ndarray, " 33"]
    presence: Float32[np.ndarray, " 33"]


def mean_landmarks(found: Sequence[Landmarks]) -> Landmarks:
    """Take the mean of what several looks at one person found."""
    return Landmarks(
        image=np.stack([each.image for each in found]).mean(0),
        world=np.stack([each.world for each in found]).mean(0),
        visibility=np.stack([each.visibility for each in found]).mean(0),
        presence=np.stack([each.presence for each in found]).mean(0),
    )


@dataclass(frozen=True)
class PersonEstimate:
    """One person of a frame.

    Attributes:
        track: The same number for the same person in all frames of a shot.
        box: Where `iuv` and `alpha` lie.
        iuv: (I, U, V) of the body without clothes or hair; 0 where it is not.
        alpha: How much of each pixel is this person, with clothes and hair, 0..255.
        confidence: Chance that a person is there, 0..1.
        landmarks: None where the estimator has none.
    """

    track: int
    box: Box
    iuv: UInt8[np.ndarray, "h w 3"]
    alpha: UInt8[np.ndarray, "h w"]
    confidence: float
    landmarks: Landmarks | None

    @property
    def pixels(self) -> int:
        """How many pixels of the frame are this person's body."""
        return int(np.count_nonzero(self.iuv[..., 0]))

    def on_frame(
        self, height: int, width: int
    ) -> tuple[UInt8[np.ndarray, "H W 3"], UInt8[np.ndarray, "H W"]]:
        """Put IUV and alpha on a whole frame of that size, 0 around the box."""
        iuv = np.zeros((height, width, 3), np.uint8)
        alpha = np.zeros((height, width), np.uint8)
        iuv[self.box.slices], alpha[self.box.slices] = self.iuv, self.alpha
        return iuv, alpha


class Estimator(Protocol):
    """What turns frames into people, one frame of a shot after the other."""

    def estimate(self, frame: UInt8[np.ndarray, "H W 3"]) -> list[PersonEstimate]:
        """Find the people of the next frame of a shot, the most confident first; maybe nobody."""
        ...

    def start_shot(self) -> None:
        """Forget who was where: the next frame has nothing to do with the last one."""


Finish = Callable[[], list[PersonEstimate]]
"""Finds out the rest about the people of a frame."""


@runtime_checkable
class StagedEstimator(Estimator, Protocol):
    """An estimator of which only a part has to see one frame after the other."""

    def locate(self, frame: UInt8[np.ndarray, "H W 3"]) -> Finish:
        """Look at the next frame of a shot. What is left to do, any thread may do at any time."""
        ...


def check_frame(frame: np.ndarray) -> None:
    """Raise InputError unless a frame is an RGB picture."""
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8 or not frame.size:
        raise InputError(
            f"a frame of shape {frame.shape} and type {frame.dtype}; RGB of 8 bits (H x W x 3)"
            " is needed"
        )
