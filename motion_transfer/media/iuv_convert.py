"""From one IUV serialization to another, without loss."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from motion_transfer.media.iuv_array import ArrayFolder, ArrayStream
from motion_transfer.media.iuv_image import ChannelOrder
from motion_transfer.media.iuv_stream import IuvReader, Missing, list_gaps, open_reader, open_stream
from motion_transfer.media.iuv_writing import IuvFormat, write_iuv


@dataclass(frozen=True, kw_only=True)
class ConvertOptions:
    """What to convert, and into what.

    Attributes:
        source: anything that `open_stream` knows.
        output: a folder of PNG, `.mkv`, `.npy`, or `.png` for one frame.
        iuv_order: force the channel order of the source, `iuv` or `vui`.
        output_order: the channel order to write, for pictures and video.
        missing: what a number missing from a folder does: `fail`, `hold` or `background`.
        frame_rate: of a video; None: the source's, or 30.
    """

    source: Path
    output: Path
    iuv_order: ChannelOrder | None = None
    output_order: ChannelOrder = "vui"
    missing: Missing = "fail"
    frame_rate: Fraction | None = None
    force: bool = False


def open_source(options: ConvertOptions) -> tuple[IuvReader, IuvFormat, list[str]]:
    """The reader, what will be written, and notes for the user. Raises: InputError."""
    stream = open_stream(options.source, missing=options.missing)
    reader = open_reader(stream, options.iuv_order)
    notes = list(stream.notes)
    if stream.gaps:
        filled = "shows nobody" if options.missing == "background" else "repeats the frame before"
        notes.append(f"{list_gaps(stream.gaps)}; each {filled}")
    settings = IuvFormat(
        frame_count=stream.frame_count,
        height=reader.height,
        width=reader.width,
        order=options.output_order,
        frame_rate=options.frame_rate or stream.frame_rate,
        force=options.force,
    )
    return reader, settings, notes


def convert_iuv(
    options: ConvertOptions, done: Callable[[int], object] = int
) -> tuple[IuvFormat, list[str]]:
    """Rewrite IUV in another form; pixels stay as they are.

    Args:
        done: called with 1 after each frame.
    Returns: what was written, and notes for the user.
    Raises: InputError and its kinds; nothing half-written stays behind.
    """
    reader, settings, notes = open_source(options)
    write_iuv(reader.read(0, settings.frame_count), options.output, settings, done)
    if isinstance(reader.stream, ArrayFolder | ArrayStream) and reader.stream.holds_global_uv:
        notes.append(
            "the furthest pixel lay"
            f" {reader.stream.largest_distance_texels:.2f} texels of 256 from its entry"
        )
    return settings, notes
