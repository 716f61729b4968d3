"""Whether a driver is IUV already, or raw pictures whose IUV has yet to be found.

An IUV image has a channel that never exceeds 24, and nothing in the others where that one is 0: no
photo looks like that. What was IUV before a lossy codec is told apart as well, and what is only
mistaken for IUV (drawings of parts, scaled UV), so that the readers can say what is wrong with it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

import numpy as np
from av.error import FFmpegError
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.container import find_pictures, open_input
from motion_transfer.media.iuv.formats import DriverKind, find_iuv_format
from motion_transfer.media.iuv.lookalikes import explain_picture, explain_scaled_uv
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, list_photos, open_pictures
from motion_transfer.media.pictures.photo import read_photo
from nhrr_core.parts import PART_COUNT

LOOKED_AT = 48
"""How many frames are looked at until one says what the driver is: clips fade in."""

# The numbers below are chosen so that photos, IUV and IUV behind H.264 are told apart.

CODEC_NOISE = 16
"""Grey levels that a codec adds to flat colours."""

MOSTLY = 0.995
"""Share of the pixels that have to agree, where a codec has smeared outlines."""

LIT = 0.8
LIT_LEVEL = 100
"""U and V run to 255: a fifth of the person's pixels is brighter than this in either. Codecs smear
colours over outlines, so the part channel is held to its limit in as many only."""

EMPTY_SHARE = 0.1
"""Least share of a frame of IUV that shows nobody."""

Frame = UInt8[np.ndarray, "H W 3"]


def tell_kind(path: Path) -> DriverKind:
    """Tell what a driver is.

    Raises: InputError if there are pictures, and none of them says.
    """
    if not path.is_dir() and find_iuv_format(path).always_iuv:
        return "iuv"
    dark = False
    for frame in islice(_frames(path), LOOKED_AT):
        kind = kind_of(frame)
        if kind is not None:
            return kind
        dark = dark or bool(frame.any())
    if dark:
        raise InputError(
            f"driver {path}: it cannot be told whether these are IUV or pictures of a person; say"
            " it with --driver-kind iuv or pictures"
        )
    return "iuv"


def kind_of(frame: Frame) -> DriverKind | None:
    """Tell what one frame shows; None where it is too dark for that."""
    if not frame.any():
        return None
    for image in (frame, frame[..., ::-1]):
        if int(image[..., 0].max()) <= PART_COUNT:
            background = image[image[..., 0] == 0]
            if (len(background) and not background.any()) or explain_scaled_uv(image):
                return "iuv"
        if _was_iuv(image):
            return "iuv"
    if explain_picture(frame) is not None:
        return "iuv"
    pixels = frame.reshape(-1, 3)
    # in IUV of either channel order, the first or the last channel is dark; in a picture of a
    # crowded scene one of them may be, too, but then hardly anything is black
    bright = np.quantile(pixels, MOSTLY, axis=0) > PART_COUNT + CODEC_NOISE
    black = (pixels <= CODEC_NOISE).all(1).mean()
    crowded = black < EMPTY_SHARE and min(pixels.max(0)[[0, 2]]) > PART_COUNT
    return "pictures" if (bright[0] and bright[2]) or (bright.any() and crowded) else None


def _was_iuv(image: Frame) -> bool:
    """Tell whether (I, U, V) look like IUV behind a lossy codec.

    One channel is dark and the others are not, and much of the frame is black in all.
    """
    pixels = image.reshape(-1, 3)
    person = pixels[(pixels > CODEC_NOISE).any(1)]
    if not 0 < len(person) <= (1 - EMPTY_SHARE) * len(pixels):
        return False
    high = np.quantile(person, LIT, axis=0)
    return bool(high[0] <= PART_COUNT + CODEC_NOISE and high[1:].min() > LIT_LEVEL)


def _frames(path: Path) -> Iterator[Frame]:
    """Decode the pictures of a driver, as they are, as far as there are any that can be read.

    Where there are none, or one is damaged, the readers of IUV say what is wrong.
    """
    with suppress(InputError, FFmpegError, IndexError):
        if path.is_dir():
            files = list_photos(path)
            # one file that is called IUV is enough: photos may lie between
            if not any(file.stem.lower().endswith(("iuv", "_inds")) for file in files):
                yield from (read_photo(file, "driver").rgb for file in files)
        elif path.suffix.lower() in PHOTO_SUFFIXES:
            yield read_photo(path, "driver").rgb
            yield from islice(open_pictures(path).read(), 1, None)  # it may hold several
        elif path.is_file():
            with open_input(path, "driver") as container:
                for frame in container.decode(find_pictures(container, f"driver {path}")):
                    yield frame.to_ndarray(format="rgb24")
