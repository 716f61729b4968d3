"""Output as an animated picture, WebP or PNG: one encoder goes once over lossless segments."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import av
from av.video.reformatter import VideoReformatter

from motion_transfer.errors import OutputError
from motion_transfer.media.container import open_output
from motion_transfer.media.output import video
from motion_transfer.media.output.formats import OutputFormat
from motion_transfer.media.output.marks import MakeMark
from motion_transfer.media.output.segments import Segments, WriteFrame
from motion_transfer.media.output.whole import digest_output as digest_output
from motion_transfer.media.output.whole import mark_file
from motion_transfer.media.output.whole import read_mark as read_mark


@dataclass(frozen=True)
class Animation:
    """How one format of animated pictures is written.

    Attributes:
        encoder: FFmpeg's name of the encoder.
        pixel_formats: Of frames without alpha, and with it.
        options: The encoder's.
        loop: The container's option that makes it play for ever.
        mixes: Whether the colours of neighbours are mixed.
        longest_side: The format's limit, px.
    """

    encoder: str
    pixel_formats: tuple[str, str]
    options: dict[str, str] = field(default_factory=dict)
    loop: dict[str, str] = field(default_factory=dict)
    mixes: bool = False
    longest_side: int | None = None


ANIMATIONS = {
    # a frame's packet is the whole file, compressed, which the encoder keeps until the end
    "webp": Animation(
        "libwebp_anim",
        ("bgra", "bgra"),  # it makes YUV of it itself, and leaves out alpha that is opaque
        {"quality": "90", "compression_level": "4"},
        {"loop": "0"},
        mixes=True,
        longest_side=16_383,
    ),
    "apng": Animation("apng", ("rgb24", "rgba"), {"pred": "mixed"}, {"plays": "0"}),
}


def open_segment(
    path: Path, output_format: OutputFormat, *, size: tuple[int, int], **settings: Any
) -> AbstractContextManager[WriteFrame]:
    """Open a lossless segment whose colours are prepared for the format that comes of it.

    Raises: OutputError for a size that the format cannot hold.
    """
    animation = ANIMATIONS[output_format.kind]
    if animation.longest_side and max(size) > animation.longest_side:
        raise OutputError(
            f"{output_format.kind} cannot hold {size[0]} x {size[1]}, its longest side is"
            f" {animation.longest_side} px; choose another ending"
        )
    return video.open_segment(path, output_format, size=size, mixes=animation.mixes, **settings)


def join_segments(
    segments: Segments,
    destination: Path,
    output_format: OutputFormat,
    rate: Fraction,
    _audio: object = None,
    mark: MakeMark | None = None,
) -> None:
    """Encode segments as an animation that loops; WebP rounds frame times to milliseconds."""
    animation = ANIMATIONS[output_format.kind]
    pixels = animation.pixel_formats[output_format.transparent]
    with open_output(destination, format_name=output_format.kind, options=animation.loop) as output:
        stream = output.add_stream(animation.encoder, rate=rate, options=animation.options)
        stream = cast(av.VideoStream, stream)
        context = stream.codec_context
        context.thread_count = 1
        context.time_base = 1 / rate
        stream.pix_fmt = pixels
        reformatter = VideoReformatter()
        first = next(video.decode_segments(segments, rate))
        stream.width, stream.height = first.width, first.height
        for frame in video.decode_segments(segments, rate):
            output.mux(stream.encode(reformatter.reformat(frame, format=pixels)))
        output.mux(stream.encode(None))
    mark_file(destination, mark)
