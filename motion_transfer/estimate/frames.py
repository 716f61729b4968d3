"""IUV of frames that are in memory."""

from __future__ import annotations

from collections.abc import Generator
from fractions import Fraction
from os import PathLike
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.person import EVERYBODY
from motion_transfer.errors import InputError
from motion_transfer.estimate.clip import Frame, MissingPeople, estimate_clip
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.media.pictures.frames import FramePictures

GIVEN = Path("the given pictures")


def estimate_frames(
    pictures: UInt8[np.ndarray, "N H W 3"],
    *,
    frame_rate: Fraction | float | None = None,
    person: str = EVERYBODY,
    missing: MissingPeople = "background",
    estimator: str = "blazepose",
    estimator_model: str | PathLike[str] | None = None,
    with_alpha: bool = False,
) -> Generator[Frame, None, None]:
    """Estimate the IUV of RGB pictures in memory, as `mt iuv` does of files.

    Args:
        pictures: The frames of a clip; those of several shots are told apart.
        frame_rate: For smoothing over time; None means 30.
        estimator_model: DensePose's file.
    The other arguments, the frames that come, and what is raised are those of `estimate_clip`.
    """
    if pictures.dtype != np.uint8 or pictures.ndim != 4 or pictures.shape[3] != 3:
        raise InputError(
            f"{GIVEN}: an array of {pictures.dtype} {list(pictures.shape)}, where uint8"
            " N x H x W x 3 is wanted"
        )
    rate = None if frame_rate is None else Fraction(frame_rate).limit_denominator(1001)
    model = None if estimator_model is None else Path(estimator_model)
    yield from estimate_clip(
        FramePictures(pictures, GIVEN, rate),
        open_estimator(estimator, model, frame_rate=rate),
        person=person,
        missing=missing,
        with_alpha=with_alpha,
    )
