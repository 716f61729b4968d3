"""Chunks become segments, segments become the output.

A segment is a chunk's frames, encoded on their own by a single-threaded encoder: one closed group
of pictures, so that segments can be joined by copying packets and the result's bytes depend on the
chunks only. Time inside segments is counted in frames, exactly.
"""

from __future__ import annotations

import os
import shutil
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Self, cast

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.reformatter import ColorRange, Colorspace, Interpolation
from jaxtyping import UInt8

from motion_transfer.errors import OutputError
from motion_transfer.media.audio import AudioCut, AudioTrack
from motion_transfer.media.formats import OutputFormat
from motion_transfer.media.gif import write_gif
from motion_transfer.media.image import write_png

SEGMENT_CONTAINER = "nut"  # takes every codec, and any frame rate without rounding
BT709 = 1  # H.273's number for primaries, transfer and matrix
os.environ.setdefault("SVT_LOG", "0")  # the AV1 encoder greets on stderr otherwise


class SegmentWriter(ABC):
    """Takes the frames of one chunk; a context manager that completes the segment."""

    @abstractmethod
    def write(self, frame: UInt8[np.ndarray, "H W 3"]) -> None:
        """Append a frame."""

    @abstractmethod
    def finish(self) -> None:
        """Complete the segment; called once, after the last frame."""

    @abstractmethod
    def release(self) -> None:
        """Let go of files; called once, whether the segment was completed or not."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self.finish()
        finally:
            self.release()


class FrameSegment(SegmentWriter):
    """A folder of PNG, numbered through the whole output."""

    def __init__(self, path: Path, first: int) -> None:
        path.mkdir()
        self._path = path
        self._index = first

    def write(self, frame: UInt8[np.ndarray, "H W 3"]) -> None:
        write_png(self._path / f"{self._index:06d}.png", frame)
        self._index += 1

    def finish(self) -> None:
        """Every frame is whole on disk already."""

    def release(self) -> None:
        """Nothing is held open."""


class VideoSegment(SegmentWriter):
    """A closed group of pictures in an intermediate container."""

    def __init__(
        self, path: Path, output_format: OutputFormat, size: tuple[int, int], rate: Fraction
    ) -> None:
        codec = output_format.codec
        self._container = av.open(str(path), "w", format=SEGMENT_CONTAINER)
        options = dict(codec.options)
        if output_format.crf is not None:
            options["crf"] = str(output_format.crf)
        stream = self._container.add_stream(codec.encoder, rate=rate, options=options)
        self._stream = cast(av.VideoStream, stream)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = codec.pixel_format
        context = self._stream.codec_context
        context.thread_count = 1
        context.time_base = 1 / rate
        context.gop_size = 10_000  # one group of pictures a segment; scene cuts may add more
        self._rgb = "bgr" in codec.pixel_format
        if not self._rgb:
            _tag_bt709(context)
        self._index = 0
        try:
            context.open()
        except FFmpegError as error:
            self._container.close()
            raise OutputError(
                f"{codec.encoder} cannot encode {size[0]} x {size[1]} at {rate} frames/s"
                f" ({error.strerror}); choose another --codec or --fps"
            ) from error

    def write(self, frame: UInt8[np.ndarray, "H W 3"]) -> None:
        picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
        picture = (
            picture.reformat(format=self._stream.pix_fmt)
            if self._rgb
            else picture.reformat(
                format=self._stream.pix_fmt,
                dst_colorspace=Colorspace.ITU709,
                dst_color_range=ColorRange.MPEG,
                interpolation=Interpolation.AREA,
            )
        )
        picture.pts = self._index
        picture.time_base = self._stream.codec_context.time_base
        self._index += 1
        self._container.mux(self._stream.encode(picture))

    def finish(self) -> None:
        self._container.mux(self._stream.encode(None))

    def release(self) -> None:
        self._container.close()


def segment_path(folder: Path, index: int, output_format: OutputFormat) -> Path:
    """Where the segment of a chunk lies in the work folder."""
    suffix = ".nut" if output_format.kind in ("video", "gif") else ""
    return folder / f"{index:06d}{suffix}"


def open_segment(
    path: Path,
    output_format: OutputFormat,
    *,
    size: tuple[int, int],
    rate: Fraction,
    first: int,
) -> SegmentWriter:
    """A writer for one chunk. `size` is (width, height), `first` the chunk's first frame."""
    if output_format.kind in ("frames", "image"):
        return FrameSegment(path, first)
    return VideoSegment(path, output_format, size, rate)


def join_segments(
    segments: Sequence[tuple[Path, int]],
    destination: Path,
    output_format: OutputFormat,
    rate: Fraction,
    audio: AudioCut | None = None,
) -> None:
    """Make the output of finished segments, given with the number of frames in each."""
    if output_format.kind == "frames":
        destination.mkdir()
        for folder, _ in segments:
            for file in folder.iterdir():
                _link(file, destination / file.name)
    elif output_format.kind == "image":
        _link(next(segments[0][0].iterdir()), destination)
    elif output_format.kind == "gif":
        write_gif([path for path, _ in segments], destination, rate)
    else:
        _copy_packets(segments, destination, output_format, rate, audio)


def _link(file: Path, destination: Path) -> None:
    """A second name for a file, so that its segment stays whole; else a copy."""
    try:
        destination.hardlink_to(file)
    except OSError:
        shutil.copyfile(file, destination)


def _copy_packets(
    segments: Sequence[tuple[Path, int]],
    destination: Path,
    output_format: OutputFormat,
    rate: Fraction,
    audio: AudioCut | None,
) -> None:
    options = {"fflags": "+bitexact"}  # or Matroska's are marked with random numbers
    if destination.suffix in (".mp4", ".mov"):
        options["movflags"] = "+faststart"
    orders = [_showing_order(path, rate) for path, _ in segments]
    delay = max(index - number for order in orders for index, number in enumerate(order))
    with av.open(str(destination), "w", options=options) as output:
        stream = sound = None
        first = 0
        for (path, frame_count), order in zip(segments, orders, strict=True):
            with av.open(str(path)) as segment:
                template = segment.streams.video[0]
                if stream is None:
                    stream = output.add_stream_from_template(template, opaque=True)
                    stream.time_base = 1 / rate
                    if "bgr" not in output_format.codec.pixel_format:
                        _tag_bt709(stream.codec_context)  # VP9 does not carry all of it itself
                    if output_format.codec.tag and destination.suffix in (".mp4", ".mov"):
                        stream.codec_context.codec_tag = output_format.codec.tag
                    if audio is not None:
                        sound = AudioTrack(audio, output, destination.suffix)
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


def _tag_bt709(context: VideoCodecContext) -> None:
    context.colorspace = context.color_primaries = context.color_trc = BT709
    context.color_range = ColorRange.MPEG


def _showing_order(path: Path, rate: Fraction) -> list[int]:
    """The frame number in its segment of each packet, in decoding order."""
    with av.open(str(path)) as segment:
        numbers = [round((p.pts or 0) * p.time_base * rate) for p in _packets(segment)]
    start = min(numbers)  # the container shifts time so that decoding begins at 0
    return [number - start for number in numbers]


def _packets(segment: InputContainer) -> Iterator[av.Packet]:
    """Packets in decoding order, one a frame; what follows them to flush a decoder is left out."""
    return (packet for packet in segment.demux(video=0) if packet.size)
