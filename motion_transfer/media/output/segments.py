"""Chunks become segments, segments become the output.

A segment is a chunk's frames, written on their own in a form that joins without encoding anything
again; so the output's bytes depend on the chunks only, and not on who wrote them when. Which form
that is, the table of kinds says.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from fractions import Fraction
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.output.audio import AudioCut
from motion_transfer.media.output.formats import OUTPUT_KINDS, OutputFormat, kind_of
from motion_transfer.media.output.marks import MakeMark, Mark

WriteFrame = Callable[[UInt8[np.ndarray, "H W C"]], object]
"""Takes a frame: RGB, or, where the format is transparent, RGBA that is not multiplied."""

Segments = Sequence[tuple[Path, int]]
"""Finished segments in order, with the number of frames in each."""


def segment_path(folder: Path, index: int, output_format: OutputFormat) -> Path:
    """Name the segment of a chunk in the work folder."""
    return folder / f"{index:06d}{output_format.segment_suffix}"


def open_segment(
    path: Path,
    output_format: OutputFormat,
    *,
    size: tuple[int, int],
    rate: Fraction,
    first: int,
) -> AbstractContextManager[WriteFrame]:
    """Open the segment of one chunk; it is complete when its block ends without an error.

    Args:
        size: (width, height), px.
        rate: Frames per second.
        first: The number of the chunk's first frame in the output.
    Returns: A context manager with a function that appends a frame.
    Raises: OutputError if the encoder refuses that size or rate.
    """
    opener = resolve_name(f"{output_format.row.module}:open_segment")
    return opener(path, output_format, size=size, rate=rate, first=first)


def join_segments(
    segments: Segments,
    destination: Path,
    output_format: OutputFormat,
    rate: Fraction,
    audio: AudioCut | None = None,
    mark: MakeMark | None = None,
) -> None:
    """Make the output of finished segments.

    Args:
        mark: What it is to say of itself, see `digest_output` for what it is told.
    """
    joiner = resolve_name(f"{output_format.row.module}:join_segments")
    joiner(segments, destination, output_format, rate, audio, mark)


def digest_output(output: Path, counts: Sequence[int]) -> list[str]:
    """Make a digest of what each segment of an output shows, sound and marks left out.

    Args:
        counts: How many frames each segment has.
    Returns: One for each segment, and one more if there are more frames; one in all where one
        encoder went over all frames.
    Raises: InputError if it cannot be read.
    """
    return _call(output, "digest_output", counts)


def read_mark(output: Path) -> Mark | None:
    """Read what a file or folder says of itself; None if it says nothing, or is no output."""
    kind = kind_of(output)
    if kind is None or not output.exists() or output.is_dir() != (kind == "frames"):
        return None
    return _call(output, "read_mark")


def _call(output: Path, name: str, *arguments: Any) -> Any:
    kind = kind_of(output)
    if kind is None or not output.exists():
        raise InputError(
            f"{output} is no output; supported are "
            + ", ".join(row.help for row in OUTPUT_KINDS.values())
        )
    return resolve_name(f"{OUTPUT_KINDS[kind].module}:{name}")(output, *arguments)
