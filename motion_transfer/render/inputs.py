"""The files that a run reads, by what they are for; light to import."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from motion_transfer.media.iuv.formats import (
    find_iuv_of,
    list_clip_iuv_names,
    list_iuv_names,
    names_file,
)
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, list_photos
from motion_transfer.render.options import (
    NO_AUDIO,
    DriverOptions,
    EstimatorOptions,
    InputOptions,
    OutputOptions,
    RenderOptions,
    SourceOptions,
    is_kept,
)

CAPTURED = ".bvh"
"""The ending of a motion that is a file."""


def appearance_files(options: RenderOptions) -> Iterator[Path]:
    """List what a source's appearance is made from. Raises: WeightsError if weights are missing."""
    yield from photo_files(options)
    yield from model_files(options)
    yield from options.weights_files


def photo_files(options: SourceOptions) -> Iterator[Path]:
    """List the photos of a source with their IUV; all names by which IUV would be found."""
    photos = [*options.sources, *((garment.photo, garment.iuv) for garment in options.garments)]
    for photo, given in photos:
        yield photo
        yield from [given] if given else iuv_names(photo)


def is_clip(source: Path) -> bool:
    """Tell whether a source is a video or a folder, and no single photo or kept source."""
    if is_kept(source):
        return False
    return source.is_dir() or source.suffix.lower() not in PHOTO_SUFFIXES


def iuv_names(source: Path) -> list[Path]:
    """List where the IUV of a source is looked for."""
    if is_kept(source):
        return []
    return list_clip_iuv_names(source) if is_clip(source) else list_iuv_names(source)


def find_source_iuv(source: Path) -> Path | None:
    """Find the IUV beside a source; None where it is estimated, or in the source itself.

    Raises: InputError if there is no such source.
    """
    if is_clip(source):
        return next((name for name in list_clip_iuv_names(source) if name.exists()), None)
    return None if is_kept(source) else find_iuv_of(source)


def has_own_iuv(source: Path) -> bool:
    """Tell whether a source holds all IUV: it was kept, or is a folder with that of every photo."""
    if not source.is_dir():
        return is_kept(source)
    photos = list_source_photos(source)
    return all(any(name.exists() for name in list_iuv_names(photo)) for photo in photos)


def list_source_photos(folder: Path) -> list[Path]:
    """List the photos of a folder, without their IUV. Raises: InputError if there are none."""
    photos = list_photos(folder)
    iuv = {name for photo in photos for name in list_iuv_names(photo)}
    return [photo for photo in photos if photo not in iuv]


def model_files(options: EstimatorOptions) -> Iterator[Path]:
    """List the estimator's model, if one is named."""
    if options.estimator_model is not None:
        yield options.estimator_model


def motion_files(options: InputOptions) -> Iterator[Path]:
    """List what a driver's motion is made from."""
    yield from driver_files(options)
    yield from model_files(options)
    if options.fit_body:
        yield from photo_files(options)


def driver_files(options: DriverOptions) -> Iterator[Path]:
    """List the driver, or the file that a motion was captured in; nothing for other motions."""
    if names_file(options.driver):
        yield options.driver
        return
    captured = Path(str(options.driver).partition(":")[2].partition(",")[0])
    if captured.suffix.lower() == CAPTURED:
        yield captured


def audio_files(options: OutputOptions) -> Iterator[Path]:
    """List the sound, if a file is named."""
    if options.audio is not None and str(options.audio) != NO_AUDIO:
        yield options.audio
