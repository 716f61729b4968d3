"""Files of several pictures as a clip: animated PNG, WebP and AVIF, and TIFF with several pages."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import accumulate, islice
from pathlib import Path

import imageio.v3 as iio
from PIL import Image

from motion_transfer.errors import InputError
from motion_transfer.media.files import read_bytes
from motion_transfer.media.pictures.photo import (
    Photo,
    decode_photo,
    explain_damage,
    is_heif,
    open_image,
)
from motion_transfer.media.pictures.png import find_png_fault
from motion_transfer.media.pictures.stream import (
    LARGEST_DENOMINATOR,
    LayeredStream,
    PhotoStream,
    PictureStream,
    Timing,
    plan_timing,
    show_steadily,
)

SUBFILE_TYPE, REDUCED = 254, 1
"""The tag of a TIFF page's type, and its bit that marks a smaller copy of another page, such as a
thumbnail."""

JPEG_SIGNATURE = b"\xff\xd8\xff"


def open_several(path: Path) -> PictureStream:
    """Open a file that may hold several pictures; with a single one it is a photo.

    Raises: InputError if it cannot be read.
    """
    clip = AnimatedPicture(path, count) if (count := _count(path)) > 1 else None
    return clip if clip and clip.frame_count > 1 else PhotoStream(path)


class AnimatedPicture(LayeredStream):
    """The pictures of one file: at a constant rate, or pages, which have no times.

    They are turned upright as their EXIF says.
    """

    def __init__(self, path: Path, count: int) -> None:
        """Raises: InputError naming the picture that is broken."""
        self._count = count
        sizes: list[tuple[int, ...]] = []
        durations: list[Fraction] = []
        notes: list[str] = []
        has_alpha = False
        for photo, shown in self._decode(path):
            sizes.append(photo.rgb.shape[:2])
            durations.append(shown)
            notes.extend(photo.notes)
            has_alpha = has_alpha or photo.alpha is not None
        *self._begins, total = accumulate(durations, initial=Fraction(0))
        self._timing: Timing | None = None
        if total:
            rate = (len(durations) / total).limit_denominator(LARGEST_DENOMINATOR)
            times = list(zip(self._begins, durations, strict=True))
            self._timing = plan_timing(times, Fraction(1), rate, path)
        super().__init__(path, self._timing.count if self._timing else len(durations), *sizes[0])
        if self._timing:
            self._take_timing(self._timing)
        self.notes += tuple(dict.fromkeys(notes))  # all pictures may have the same
        self.has_alpha = has_alpha

    def _play(self, start: int) -> Iterator[Callable[[], Photo]]:
        pictures = (
            partial(self._check_size, photo, number)
            for number, (photo, _) in enumerate(self._decode(self.path))
        )
        if self._timing is None:
            return islice(pictures, start, None)
        return show_steadily(zip(self._begins, pictures, strict=True), self._timing, start)

    def _decode(self, path: Path) -> Iterator[tuple[Photo, Fraction]]:
        """Decode every picture, each with how long it is shown, in seconds; 0 for a page."""
        with path.open("rb") as opened:
            with explain_damage(str(path)):
                file = open_image(opened, str(path))
            for number in range(self._count):
                where = f"picture {number} of {path}"
                with explain_damage(where):
                    decoded = _decode_part(file, number, path, where)
                if decoded:
                    yield decoded


def _count(path: Path) -> int:
    """Count the pictures of a file by its headers; 1 if it is for readers of photos."""
    data = read_bytes(path, "picture")
    # whatever a phone's photo is called, what else lies in it is depth or a burst
    if data.startswith(JPEG_SIGNATURE) or is_heif(data) or find_png_fault(data):
        return 1
    try:
        with explain_damage(str(path)), iio.imopen(data, "r", plugin="pillow") as file:
            # `...` stands for all pictures, which the types leave out
            return file.properties(index=...).n_images or 1  # pyright: ignore[reportArgumentType]
    except InputError:
        return 1  # readers of photos say what is wrong


def _decode_part(
    file: Image.Image, number: int, path: Path, where: str
) -> tuple[Photo, Fraction] | None:
    """Decode one picture, and tell how long it is shown; None if it is no part of the clip."""
    file.seek(number)
    # an APNG may begin with a still for programs that cannot play it
    if getattr(file, "tag_v2", {}).get(SUBFILE_TYPE, 0) & REDUCED if number else _is_still(file):
        return None
    photo = decode_photo(file, path, where)
    # only now: WebP and AVIF tell a picture's duration when it has been decoded
    milliseconds = Fraction(file.info.get("duration") or 0)
    return photo, milliseconds.limit_denominator(LARGEST_DENOMINATOR) / 1000


def _is_still(file: Image.Image) -> bool:
    return bool(file.info.get("default_image"))
