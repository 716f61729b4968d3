"""Output as video: each segment one closed group of pictures, joined by copying packets.

Every segment has a single-threaded encoder of its own, since the bytes of a threaded one depend on
the number of cores. Time inside segments is counted in frames, exactly.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.reformatter import ColorRange
from jaxtyping import UInt8

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.alpha import ALPHA_MODE, BESIDE
from motion_transfer.media.container import find_pictures, open_input, open_output
from motion_transfer.media.output.audio import AudioCut, AudioTrack
from motion_transfer.media.output.contents import digest_packets
from motion_transfer.media.output.formats import CONTAINERS, OutputFormat
from motion_transfer.media.output.marks import MakeMark, Mark, parse_mark
from motion_transfer.media.output.pixels import BT709, make_converter
from motion_transfer.media.output.segments import Segments, WriteFrame

LONGEST_GROUP = 10_000  # frames; longer than any chunk, so that a segment is one group of pictures
DECODED_AHEAD = 16  # frames; H.264 and H.265 decode a frame at most so long before it is shown
BIT_EXACT = {"fflags": "+bitexact"}  # or Matroska's are marked with random numbers
XMP_BOX = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")  # the UUID of a box of XMP
os.environ.setdefault("SVT_LOG", "0")  # the AV1 encoder greets on stderr otherwise


@contextmanager
def open_segment(
    path: Path,
    output_format: OutputFormat,
    *,
    size: tuple[int, int],
    rate: Fraction,
    mixes: bool | None = None,
    **_: object,
) -> Iterator[WriteFrame]:
    """Open a closed group of pictures in an intermediate container; scene cuts may begin more.

    Args:
        mixes: As of `make_converter`.
    Raises: OutputError if the encoder refuses that size or rate.
    """
    codec = output_format.codec
    options = dict(codec.options)
    if output_format.crf is not None:
        options["crf"] = str(output_format.crf)
    container_name = codec.segment_container
    with open_output(path, format_name=container_name, options=BIT_EXACT) as container:
        stream = container.add_stream(codec.encoder, rate=rate, options=options)
        stream = cast(av.VideoStream, stream)
        stream.width, stream.height = size
        stream.pix_fmt = codec.pixel_format
        context = stream.codec_context
        context.thread_count = 1
        context.time_base = 1 / rate
        context.gop_size = LONGEST_GROUP
        if not codec.keeps_rgb:
            _tag_bt709(context)
        try:
            context.open()
        except FFmpegError as error:
            raise OutputError(
                f"{codec.encoder} cannot encode {size[0]} x {size[1]} at {rate} frames/s"
                f" ({error.strerror}); choose another --codec or --fps"
            ) from error
        numbers, decoded = count(), count(-DECODED_AHEAD)
        convert = make_converter(output_format, mixes=mixes)

        def encode(picture: av.VideoFrame | None) -> None:
            for packet in stream.encode(picture):
                # x265's own are uninitialised memory where there are fewer frames than it delays
                packet.dts = next(decoded)
                container.mux(packet)

        def write(frame: UInt8[np.ndarray, "H W C"]) -> None:
            picture = convert(frame)
            picture.pts, picture.time_base = next(numbers), context.time_base
            encode(picture)

        yield write
        encode(None)


def join_segments(
    segments: Segments,
    destination: Path,
    output_format: OutputFormat,
    rate: Fraction,
    audio: AudioCut | None,
    mark: MakeMark | None = None,
) -> None:
    """Copy the packets of segments into one container, and lay sound between them."""
    made = mark and mark([digest for each in segments for digest in _digest_segment(*each)])
    container = CONTAINERS[destination.suffix]
    options = dict(BIT_EXACT)
    if container.is_mp4:
        options["movflags"] = "+faststart"
        if output_format.transparent:
            options["movflags"] += "+use_metadata_tags"  # QuickTime's list holds any key
    orders = [_showing_order(path, rate) for path, _ in segments]
    # a frame is decoded before it is shown: decoding begins as much earlier as one ever needs
    delay = max(index - number for order in orders for index, number in enumerate(order))
    with open_output(destination, options=options) as output:
        if output_format.alpha_mode:
            output.metadata[ALPHA_MODE] = output_format.alpha_mode
        if made is not None:
            output.metadata.update(comment=made.comment, description=made.sentence)
        stream = sound = None
        first = 0
        for (path, frame_count), order in zip(segments, orders, strict=True):
            with open_input(path, "segment") as segment:
                template = segment.streams.video[0]
                if stream is None:
                    stream = output.add_stream_from_template(template, opaque=True)
                    stream.time_base = 1 / rate
                    if not output_format.codec.keeps_rgb:
                        _tag_bt709(stream.codec_context)  # VP9 does not carry all of it itself
                    if template.metadata.get(ALPHA_MODE) == BESIDE:
                        stream.metadata[ALPHA_MODE] = BESIDE
                    if output_format.codec.tag and container.is_mp4:
                        stream.codec_context.codec_tag = output_format.codec.tag
                    if audio is not None:
                        sound = AudioTrack(audio, output, container.audio)
                for index, (packet, number) in enumerate(
                    zip(_packets(segment), order, strict=True)
                ):
                    packet.pts = first + number
                    packet.dts = first + index - delay
                    packet.duration = 1
                    packet.time_base = 1 / rate
                    packet.stream = stream
                    if sound is not None:
                        sound.write_until((first + index) / rate)
                    output.mux(packet)
            first += frame_count
        if sound is not None:
            sound.write_until(None)
    if made is not None and container.is_mp4:
        _append_xmp(destination, made.xmp(with_record=False))


def _append_xmp(path: Path, xmp: bytes) -> None:
    """Append XMP to a file of the MP4 family: nothing in it has to move. Source: ISO 16684-3."""
    with path.open("ab") as file:
        file.write(struct.pack(">I4s", 8 + len(XMP_BOX) + len(xmp), b"uuid") + XMP_BOX + xmp)


def digest_output(output: Path, counts: Sequence[int]) -> list[str]:
    """Make a digest of each run of so many packets, see `segments.digest_output`."""
    try:
        with open_input(output, "output") as container:
            find_pictures(container, str(output))
            return digest_packets(container, counts)
    except FFmpegError as error:
        raise InputError(f"{output} cannot be read: {error.strerror}") from error


def read_mark(output: Path) -> Mark | None:
    """Read what a video's comment says, see `segments.read_mark`."""
    try:
        with open_input(output, "output") as container:
            told = {key.lower(): value for key, value in container.metadata.items()}
    except (InputError, FFmpegError):
        return None
    return parse_mark(told.get("comment", ""))


def decode_segments(segments: Segments, rate: Fraction) -> Iterator[av.VideoFrame]:
    """Decode the frames of all segments, numbered through."""
    index = 0
    for path, _ in segments:
        with open_input(path, "segment") as container:
            for frame in container.decode(video=0):
                frame.pts, frame.time_base = index, 1 / rate
                yield frame
                index += 1


def _digest_segment(path: Path, frame_count: int) -> list[str]:
    with open_input(path, "segment") as segment:
        return digest_packets(segment, [frame_count])


def _tag_bt709(context: VideoCodecContext) -> None:
    context.colorspace = context.color_primaries = context.color_trc = BT709
    context.color_range = ColorRange.MPEG


def _showing_order(path: Path, rate: Fraction) -> list[int]:
    """List the frame number in its segment of each packet, in decoding order."""
    with open_input(path, "segment") as segment:
        numbers = [round((p.pts or 0) * p.time_base * rate) for p in _packets(segment)]
    start = min(numbers)  # the container shifts time so that decoding begins at 0
    return [number - start for number in numbers]


def _packets(segment: InputContainer) -> Iterator[av.Packet]:
    """Read packets in decoding order, one a frame, without the empty one that flushes decoders."""
    return (packet for packet in segment.demux(video=0) if packet.size)
