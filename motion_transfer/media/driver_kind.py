"""Whether a driver is IUV already, or raw pictures whose IUV has yet to be found.

An IUV image has a channel that never exceeds 24, and nothing in the others where that one is 0: no
photo looks like that. What was IUV before a lossy codec is told apart as well, and what is only
mistaken for IUV (drawings of parts, scaled UV), so that the readers can say what is wrong with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Literal

import av
import numpy as np
from av.error import FFmpegError
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.image import read_photo
from motion_transfer.media.iuv_array import ARRAY_SUFFIXES
from motion_transfer.media.iuv_dump import DUMP_SUFFIXES
from motion_transfer.media.iuv_image import IUV_SUFFIXES
from motion_transfer.media.iuv_lookalikes import explain_picture, explain_scaled_uv
from motion_transfer.media.picture_stream import PHOTO_SUFFIXES, list_photos
from nhrr_core.iuv import PART_COUNT

DriverKind = Literal["iuv", "pictures"]

LOOKED_AT = 48
"""Frames, until one says what the driver is: clips fade in."""

CODEC_NOISE = 16
"""Grey levels that a codec adds to flat colours."""

MOSTLY = 0.995
"""Share of the pixels that have to agree, where a codec has smeared outlines."""

LIT = 0.8
LIT_LEVEL = 100
"""U and V run to 255: a fifth of the person's pixels is brighter than this in either. Codecs smear
colours over outlines, so the part channel is held to its limit in as many only."""

EMPTY_SHARE = 0.1
"""Of a frame of IUV nobody is in at least so much."""

Frame = UInt8[np.ndarray, "H W 3"]


def tell_kind(path: Path) -> DriverKind:
    """What a driver is.

    Raises: InputError if there are pictures, and none of them says.
    """
    if path.is_file() and path.suffix.lower() in (*ARRAY_SUFFIXES, *DUMP_SUFFIXES):
        return "iuv"
    frames = _frames(path)
    if frames is None:
        return "iuv"  # nothing that could be a picture: the readers of IUV say why
    seen = dark = False
    for frame in islice(frames, LOOKED_AT):
        seen = True
        kind = kind_of(frame)
        if kind is not None:
            return kind
        dark = dark or bool(frame.any())
    if seen and dark:
        raise InputError(
            f"driver {path}: it cannot be told whether these are IUV or pictures of a person; say"
            " it with --driver-kind iuv or pictures"
        )
    return "iuv"


def kind_of(frame: Frame) -> DriverKind | None:
    """What one frame shows; None where it is too dark to be told."""
    if not frame.any():
        return None
    for image in (frame, frame[..., ::-1]):
        if _is_iuv(image) or _was_iuv(image) or _is_scaled(image):
            return "iuv"
    if explain_picture(frame) is not None:
        return "iuv"
    pixels = frame.reshape(-1, 3)
    bright = np.quantile(pixels, MOSTLY, axis=0) > PART_COUNT + CODEC_NOISE
    crowded = _black_share(pixels) < EMPTY_SHARE and min(pixels.max(0)[[0, 2]]) > PART_COUNT
    return "pictures" if (bright[0] and bright[2]) or (bright.any() and crowded) else None


def _is_iuv(image: Frame) -> bool:
    """Whether (I, U, V) are what they should be, exactly."""
    part = image[..., 0]
    background = image[part == 0]
    return int(part.max()) <= PART_COUNT and len(background) > 0 and not background.any()


def _is_scaled(image: Frame) -> bool:
    return int(image[..., 0].max()) <= PART_COUNT and explain_scaled_uv(image) is not None


def _was_iuv(image: Frame) -> bool:
    """Whether (I, U, V) look like IUV behind a lossy codec: one channel dark, others not, and much
    of the frame black in all."""
    pixels = image.reshape(-1, 3)
    person = pixels[(pixels > CODEC_NOISE).any(1)]
    if not 0 < len(person) <= (1 - EMPTY_SHARE) * len(pixels):
        return False
    high = np.quantile(person, LIT, axis=0)
    return bool(high[0] <= PART_COUNT + CODEC_NOISE and high[1:].min() > LIT_LEVEL)


def _black_share(pixels: UInt8[np.ndarray, "N 3"]) -> float:
    return float((pixels <= CODEC_NOISE).all(1).mean())


def _frames(path: Path) -> Iterator[Frame] | None:
    """The first pictures of a driver, as they are; None if there are none."""
    if path.is_dir():
        try:
            files = list_photos(path)
        except InputError:
            return None
        named = [f for f in files if f.stem.lower().endswith(("iuv", "_inds"))]
        return None if named else _photos(files)
    if not path.is_file():
        return None
    if path.suffix.lower() in (*PHOTO_SUFFIXES, *IUV_SUFFIXES):
        return _photos([path])
    return _decode(path)


def _photos(files: Iterable[Path]) -> Iterator[Frame]:
    """Pictures that can be read; of the others the readers say what is wrong."""
    for file in files:
        try:
            yield read_photo(file, "driver").rgb
        except InputError:
            return


def _decode(path: Path) -> Iterator[Frame]:
    try:
        with av.open(str(path)) as container:
            for frame in container.decode(video=0):
                yield frame.to_ndarray(format="rgb24")
    except (FFmpegError, IndexError):
        return
