"""From one IUV serialization to another, without loss."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from motion_transfer.media.folders import list_gaps
from motion_transfer.media.iuv.formats import ChannelOrder, Missing
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.iuv.stream import IuvReader
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv


@dataclass(frozen=True, kw_only=True)
class ConvertOptions:
    """What to convert, and into what.

    Attributes:
        source: Anything that `open_stream` knows.
        output: A folder of PNG, `.mkv`, `.npy`, or `.png` for one frame.
        iuv_order: Forces the channel order of the source.
        output_order: The channel order to write, for pictures and video.
        missing: What a number missing from a folder does.
        frame_rate: The rate of a video; None for the source's, or 30.
        force: Whether to replace an existing output.
    """

    source: Path
    output: Path
    iuv_order: ChannelOrder | None = None
    output_order: ChannelOrder = "vui"
    missing: Missing = "fail"
    frame_rate: Fraction | None = None
    force: bool = False


def open_source(options: ConvertOptions) -> tuple[IuvReader, IuvOutput, list[str]]:
    """Open what is to be converted.

    Returns: The reader, what will be written, and notes for the user.
    Raises: InputError.
    """
    stream = open_stream(options.source, missing=options.missing)
    reader = open_reader(stream, options.iuv_order)
    notes = list(stream.notes)
    if stream.gaps:
        filled = "shows nobody" if options.missing == "background" else "repeats the frame before"
        notes.append(f"{list_gaps(stream.gaps)}; each {filled}")
    settings = IuvOutput(
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
) -> tuple[IuvOutput, list[str]]:
    """Rewrite IUV in another form; pixels stay as they are.

    Args:
        done: Called with 1 after each frame.
    Returns: What was written, and notes for the user.
    Raises: InputError and its kinds; nothing half-written stays behind.
    """
    reader, settings, notes = open_source(options)
    write_iuv(reader.read(0, settings.frame_count), options.output, settings, done)
    return settings, [*notes, *reader.stream.closing_notes()]
