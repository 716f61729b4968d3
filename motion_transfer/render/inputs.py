"""The files that a run reads, by what they are for; light to import."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from motion_transfer.media.iuv.formats import list_iuv_names, names_file
from motion_transfer.render.options import (
    NO_AUDIO,
    DriverOptions,
    EstimatorOptions,
    InputOptions,
    OutputOptions,
    RenderOptions,
    SourceOptions,
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
    photos = [(options.source, options.source_iuv)]
    photos += [(garment.photo, garment.iuv) for garment in options.garments]
    for photo, given in photos:
        yield photo
        yield from [given] if given else list_iuv_names(photo)


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
