"""Who is in a photo that comes without its IUV."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.estimate.choice import Follower
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.media.image import Photo
from motion_transfer.render.beside import list_iuv_names
from motion_transfer.render.options import RenderOptions

COVERS = 128
"""Alpha from which a pixel is the person's."""


@dataclass(frozen=True)
class SourcePerson:
    """One person of a photo.

    Attributes:
        iuv: (I, U, V), 0 where this person is not.
        alpha: how much of each pixel is this person, 0..255, where somebody could tell; else None.
    """

    iuv: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"] | None = None


def estimate_person(photo: Photo, choice: str, options: RenderOptions, what: str) -> SourcePerson:
    """The chosen person's IUV and alpha, estimated.

    Args:
        choice: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px.
        what: the photo's role, for messages.
    Raises: InputError if nobody is found, or what it takes to look is missing.
    """
    beside = " nor ".join(path.name for path in list_iuv_names(photo.path))
    lacking = f"no IUV found for {photo.path} (neither {beside} is beside it)"
    try:
        estimator = open_estimator(options.estimator, options.estimator_model)
    except InputError as error:
        raise InputError(f"{lacking}, and to estimate it: {error}") from error
    people = estimator.estimate(photo.on_white())
    chosen = Follower(choice).pick(people, f"{what} {photo.path}")
    if not chosen:
        raise InputError(
            f"{lacking}, and nobody was found in it; give a photo that shows a person, or make its"
            " IUV with DensePose and name it"
        )
    iuv, alpha = chosen[0].on_frame(*photo.rgb.shape[:2])
    if photo.alpha is not None:
        alpha = np.minimum(alpha, photo.alpha)
    return SourcePerson(iuv * (alpha >= COVERS)[..., None], alpha)
