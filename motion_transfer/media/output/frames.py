"""Output as PNG: a folder with every frame, or one frame as a picture."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from motion_transfer.media.output.formats import OutputFormat
from motion_transfer.media.output.pixels import prepare_picture
from motion_transfer.media.output.segments import Segments, WriteFrame
from motion_transfer.media.pictures.photo import write_png


@contextmanager
def open_segment(path: Path, *_: object, first: int, **__: object) -> Iterator[WriteFrame]:
    """Open a folder of PNG, numbered through the whole output."""
    path.mkdir()
    numbers = count(first)
    yield lambda frame: write_png(path / f"{next(numbers):06d}.png", prepare_picture(frame))


def join_segments(
    segments: Segments, destination: Path, output_format: OutputFormat, *_: object
) -> None:
    """Put the frames of all segments into one folder, or make the only one the output."""
    files = [file for folder, _ in segments for file in folder.iterdir()]
    if not output_format.row.several:
        _link(files[0], destination)
        return
    destination.mkdir()
    for file in files:
        _link(file, destination / file.name)


def _link(file: Path, destination: Path) -> None:
    """Give a file a second name, so that its segment stays whole; copy it where that fails."""
    try:
        destination.hardlink_to(file)
    except OSError:
        shutil.copyfile(file, destination)
