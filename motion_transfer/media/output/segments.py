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

import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.output.audio import AudioCut
from motion_transfer.media.output.formats import OutputFormat

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
) -> None:
    """Make the output of finished segments."""
    joiner = resolve_name(f"{output_format.row.module}:join_segments")
    joiner(segments, destination, output_format, rate, audio)
