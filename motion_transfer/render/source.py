"""The source of a run: photos are read, their IUV is read or estimated, garments are laid over."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from motion_transfer.drawing.person import COVERS, Follower
from motion_transfer.drawing.source import Source, SourcePicture, read_person, unfold_source
from motion_transfer.errors import InputError
from motion_transfer.estimate.interface import PersonEstimate
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.media.iuv.formats import find_iuv_of, list_iuv_names
from motion_transfer.media.pictures.photo import Photo, read_photo
from motion_transfer.render.options import EstimatorOptions, Garment, SourceOptions
from nhrr_core.iuv import ALL_PARTS

SMALLEST_VISIBLE_SHARE = 0.01  # of the texels; a frontal half-length portrait shows about 0.2


def check_photos(options: SourceOptions) -> None:
    """Raise InputError if a photo is missing."""
    garments = [("garment", garment.photo) for garment in options.garments]
    for what, photo in [("source", options.source), *garments]:
        if not photo.exists():
            raise InputError(f"{what} {photo} does not exist")


def read_source(options: SourceOptions, texture_size: int) -> Source:
    """Read the source, and garments, and unfold what they show.

    Args:
        texture_size: Side of the partial texture, which the renderer decides, in texels.
    Raises: InputError if a file is missing or unfit, sizes differ, nobody or too little is seen,
        or a garment photo shows none of its parts.
    """
    photo = read_photo(options.source)
    iuv_path = options.source_iuv or find_iuv_of(options.source)
    taken = {part for garment in options.garments for part in garment.parts}
    kept = tuple(part for part in ALL_PARTS if part not in taken)
    pictures = [_read_picture(photo, iuv_path, options.person, options, "source", kept)]
    for number, garment in enumerate(options.garments):
        pictures.append(_read_garment(garment, options.garments[number + 1 :], options))
    source = unfold_source(pictures, texture_size, iuv_path)
    share = float(source.visibility.mean())
    if share < SMALLEST_VISIBLE_SHARE:
        raise InputError(
            f"source {options.source} shows too little of the body ({share:.1%} of the texture);"
            " use a larger photo, or choose another --person"
        )
    return source


def estimate_person(
    photo: Photo, choice: str, options: EstimatorOptions, what: str
) -> PersonEstimate:
    """Find one person in a photo that comes without IUV.

    Args:
        choice: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px.
        what: The photo's role, for messages.
    Raises: InputError if nobody is found, or what it takes to look is missing.
    """
    names = " nor ".join(path.name for path in list_iuv_names(photo.path))
    lacking = f"no IUV found for {photo.path} (neither {names} is beside it)"
    try:
        estimator = open_estimator(options.estimator, options.estimator_model)
    except InputError as error:
        raise InputError(f"{lacking}, and to estimate it: {error}") from error
    people = estimator.estimate(photo.on_white())
    chosen = Follower[PersonEstimate](choice).pick(people, f"{what} {photo.path}")
    if not chosen:
        raise InputError(
            f"{lacking}, and nobody was found in it; give a photo that shows a person, or make its"
            " IUV with DensePose and name it"
        )
    return chosen[0]


def _read_garment(
    garment: Garment, later: tuple[Garment, ...], options: SourceOptions
) -> SourcePicture:
    photo = read_photo(garment.photo, "garment")
    path = garment.iuv or find_iuv_of(garment.photo)
    covered = {part for other in later for part in other.parts}
    parts = tuple(part for part in garment.parts if part not in covered)
    return _read_picture(photo, path, "largest", options, "garment", parts)


def _read_picture(
    photo: Photo,
    iuv_path: Path | None,
    choice: str,
    options: SourceOptions,
    what: str,
    parts: tuple[int, ...],
) -> SourcePicture:
    """Find the chosen person of a photo: by its IUV, or by looking at it."""
    if iuv_path is not None:
        iuv = read_person(photo, iuv_path, choice, options.source_iuv_order, what)
        return SourcePicture(photo, iuv, parts=parts)
    person = estimate_person(photo, choice, options, what)
    iuv, alpha = person.on_frame(*photo.rgb.shape[:2])
    if photo.alpha is not None:
        alpha = np.minimum(alpha, photo.alpha)
    return SourcePicture(photo, iuv * (alpha >= COVERS)[..., None], alpha, parts)
