"""Output as PNG: a folder with every frame, or one frame as a picture."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count, islice
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.media.files import read_bytes
from motion_transfer.media.output.contents import shorten
from motion_transfer.media.output.formats import OutputFormat
from motion_transfer.media.output.marks import MakeMark, Mark, parse_mark
from motion_transfer.media.output.pixels import prepare_picture
from motion_transfer.media.output.segments import Segments, WriteFrame
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.pictures.xmp import digest_pictures, find_xmp, put_xmp
from motion_transfer.media.publish import is_frame


@contextmanager
def open_segment(
    path: Path, output_format: OutputFormat, *, first: int, **_: object
) -> Iterator[WriteFrame]:
    """Open a folder of PNG, numbered through the whole output; each says what it is."""
    path.mkdir()
    numbers = count(first)
    xmp = output_format.mark and output_format.mark.xmp()
    yield lambda frame: write_png(path / f"{next(numbers):06d}.png", prepare_picture(frame), xmp)


def join_segments(
    segments: Segments,
    destination: Path,
    output_format: OutputFormat,
    _rate: object,
    _audio: object = None,
    mark: MakeMark | None = None,
) -> None:
    """Put the frames of all segments into one folder, or make the only one the output.

    The first of them says what the whole output says of itself.
    """
    folders = [sorted(folder.iterdir()) for folder, _ in segments]
    files = [file for folder in folders for file in folder]
    several = output_format.row.several
    if several:
        destination.mkdir()
    for file in files:
        place = destination / file.name if several else destination
        if mark is not None and file is files[0]:
            made = mark([_digest(folder) for folder in folders])
            place.write_bytes(put_xmp(file.read_bytes(), made.xmp()))
        else:
            _link(file, place)


def digest_output(output: Path, counts: Sequence[int]) -> list[str]:
    """Make a digest of each run of so many frames, see `segments.digest_output`."""
    files = iter(_list_frames(output))
    digests = [_digest(list(islice(files, number))) for number in counts]
    rest = list(files)
    return digests + [_digest(rest)] * bool(rest)


def read_mark(output: Path) -> Mark | None:
    """Read what the first frame says, see `segments.read_mark`."""
    files = _list_frames(output)
    try:
        xmp = find_xmp(read_bytes(files[0], "picture")) if files else None
    except ValueError:
        return None
    return parse_mark(xmp.decode("utf-8", "replace")) if xmp else None


def _list_frames(output: Path) -> list[Path]:
    return sorted(filter(is_frame, output.iterdir())) if output.is_dir() else [output]


def _digest(files: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        try:
            digest.update(digest_pictures(read_bytes(file, "picture")))
        except ValueError as error:
            raise InputError(f"{file} is damaged, or no PNG: {error}") from None
    return shorten(digest.digest())


def _link(file: Path, destination: Path) -> None:
    """Give a file a second name, so that its segment stays whole; copy it where that fails."""
    try:
        destination.hardlink_to(file)
    except OSError:
        shutil.copyfile(file, destination)
