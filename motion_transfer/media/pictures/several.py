"""Files of several pictures as a clip: animated PNG, WebP and AVIF, and TIFF with several pages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from itertools import accumulate
from pathlib import Path
from typing import cast

import imageio.v3 as iio
import numpy as np
from imageio.plugins.pillow import PillowPlugin

from motion_transfer.errors import InputError
from motion_transfer.media.pictures.photo import Photo, allow_large
from motion_transfer.media.pictures.stream import (
    LARGEST_DENOMINATOR,
    Frame,
    PhotoStream,
    PictureStream,
    Timing,
    plan_timing,
    show_steadily,
)

REDUCED = 1
"""The bit in a TIFF page's type that marks a smaller copy of another page, such as a thumbnail."""

UNREADABLE = (OSError, SyntaxError, ValueError, EOFError)
"""What Pillow raises for damaged files of one format or another."""


def open_several(path: Path) -> PictureStream:
    """Open a file that may hold several pictures; with a single one it is a photo.

    Raises: InputError if it cannot be read.
    """
    try:
        with _opened(path) as file:
            # reads headers only; `...` stands for all pictures, which the types leave out
            count = file.properties(index=...).n_images or 1  # pyright: ignore[reportArgumentType]
    except UNREADABLE:
        count = 1  # whoever reads photos says what is wrong
    clip = AnimatedPicture(path, count) if count > 1 else None
    return clip if clip and clip.frame_count > 1 else PhotoStream(path)


class AnimatedPicture(PictureStream):
    """The pictures of one file: at a constant rate, or pages, which have no times.

    They are turned upright as their EXIF says; where they are transparent, white shows.
    """

    def __init__(self, path: Path, count: int) -> None:
        """Raises: InputError naming the picture that is broken."""
        self._count = count
        sizes, durations = zip(
            *((picture.shape[:2], shown) for picture, shown in self._decode(path)), strict=True
        )
        *self._begins, total = accumulate(durations, initial=Fraction(0))
        self._timing: Timing | None = None
        if total:
            rate = (len(durations) / total).limit_denominator(LARGEST_DENOMINATOR)
            times = list(zip(self._begins, durations, strict=True))
            self._timing = plan_timing(times, Fraction(1), rate, path)
        super().__init__(path, self._timing.count if self._timing else len(durations), *sizes[0])
        if self._timing:
            self._take_timing(self._timing)

    def read(self) -> Iterator[Frame]:
        pictures = (
            self._check_size(picture, number)
            for number, (picture, _) in enumerate(self._decode(self.path))
        )
        if self._timing is None:
            return pictures
        return show_steadily(zip(self._begins, pictures, strict=True), self._timing)

    def _decode(self, path: Path) -> Iterator[tuple[Frame, Fraction]]:
        """Decode every picture, each with how long it is shown, in seconds; 0 for a page."""
        with _opened(path) as file:
            for number in range(self._count):
                try:
                    shown = _read_upright(file, number, path)
                except UNREADABLE as error:
                    raise InputError(
                        f"picture {number} of {path} is damaged: {error}; save it again"
                    ) from error
                if shown:
                    yield shown


def _read_upright(file: PillowPlugin, number: int, path: Path) -> tuple[Frame, Fraction] | None:
    """Read one picture, upright and on white, and how long it is shown; None if it is no part."""
    facts = file.metadata(index=number)
    # an APNG may begin with a still for programs that cannot play it
    if facts.get("NewSubfileType", 0) & REDUCED if number else facts.get("default_image"):
        return None
    transparent = "A" in facts["mode"] or "transparency" in facts
    with allow_large():
        if facts["mode"].startswith("I"):  # 16-bit grey; converting it would clip, not scale
            grey = (file.read(index=number, rotate=True).astype(np.uint32) >> 8).astype(np.uint8)
            pixels = np.dstack([grey] * 3)
        else:
            pixels = file.read(index=number, mode="RGBA" if transparent else "RGB", rotate=True)
    alpha = pixels[..., 3] if transparent else None
    photo = Photo(path, np.ascontiguousarray(pixels[..., :3]), alpha, turned=False)
    # asked for once more: WebP and AVIF tell a picture's duration when it has been decoded
    milliseconds = Fraction(file.metadata(index=number).get("duration") or 0)
    return photo.on_white(), milliseconds.limit_denominator(LARGEST_DENOMINATOR) / 1000


@contextmanager
def _opened(path: Path) -> Iterator[PillowPlugin]:
    with allow_large():
        file = iio.imopen(path, "r", plugin="pillow")
    with file:
        yield cast(PillowPlugin, file)
