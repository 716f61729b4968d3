"""From one IUV serialization to another, without loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.folders import list_gaps
from motion_transfer.media.iuv.formats import ChannelOrder, Missing
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.iuv.stream import IuvReader
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv
from motion_transfer.media.unchanged import Inputs


@dataclass(frozen=True, kw_only=True)
class ConvertOptions:
    """What to convert, and into what.

    Attributes:
        source: Anything that `open_stream` knows.
        output: A folder of PNG, `.mkv`, `.npy`, or `.png` for one frame.
        iuv_order: Forces the channel order of the source.
        output_order: The channel order to write, for pictures and video.
        missing: What a number missing from a folder or a dump does.
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


@dataclass(frozen=True)
class OpenedSource:
    """What is to be converted.

    Attributes:
        settings: What will be written.
        notes: For the user.
        inputs: What it is read from.
    """

    reader: IuvReader
    settings: IuvOutput
    notes: list[str]
    inputs: Inputs

    def frames(self) -> Iterator[UInt8[np.ndarray, "H W 3"]]:
        """Read every frame. Raises: InputError, also if the source changes meanwhile."""
        return self.inputs.guard(self.reader.read(0, self.settings.frame_count))


def open_source(options: ConvertOptions) -> OpenedSource:
    """Open what is to be converted. Raises: InputError."""
    inputs = Inputs([options.source])
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
    return OpenedSource(reader, settings, notes, inputs)


def convert_iuv(
    options: ConvertOptions, done: Callable[[int], object] = int
) -> tuple[IuvOutput, list[str]]:
    """Rewrite IUV in another form; pixels stay as they are.

    Args:
        done: Called with 1 after each frame.
    Returns: What was written, and notes for the user.
    Raises: InputError and its kinds; nothing half-written stays behind.
    """
    source = open_source(options)
    write_iuv(source.frames(), options.output, source.settings, done)
    return source.settings, [*source.notes, *source.reader.stream.closing_notes()]
