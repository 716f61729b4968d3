"""IUV in a lossless video.

What a lossy codec or a conversion to YUV did to part indices cannot be undone, so that such a video
is refused. So is one that breaks off or is damaged inside: decoders show something all the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
from av.container import InputContainer
from av.error import FFmpegError

from motion_transfer.errors import IuvFileError
from motion_transfer.media.container import find_pictures, hear_complaints, open_input
from motion_transfer.media.iuv.lookalikes import explain_picture
from motion_transfer.media.iuv.stream import IuvStream, Raw
from motion_transfer.media.pictures.display import (
    describe_pixels,
    find_pixel_ratio,
    square_size,
    stretch_whole,
)
from motion_transfer.media.pictures.stream import plan_timing
from motion_transfer.media.pictures.video import pick_frames

LOSSLESS_CODECS = ("ffv1", "ffvhuff", "huffyuv", "utvideo", "png", "apng", "qtrle", "rawvideo")
LOSSLESS_REMEDY = (
    "store the IUV as PNG frames, or with `ffmpeg -i ... -c:v ffv1 -pix_fmt bgr0 out.mkv`"
)

CAREFUL = {"err_detect": "crccheck+explode"}
"""For decoders that look at checksums only if they are told to, such as PNG's."""


class VideoStream(IuvStream):
    """A lossless RGB video. Raises: IuvFileError for a lossy codec or a YUV pixel format."""

    def __init__(self, path: Path) -> None:
        try:
            with open_input(path, "driver") as container:
                stream = find_pictures(container, f"driver {path}")
                codec, pixels = stream.codec_context.name, stream.codec_context.pix_fmt or ""
                _check_lossless(path, container, stream)
                # frames are found by these times: containers differ in how they count frames
                times = sorted(
                    (packet.pts, packet.duration or 0)
                    for packet in container.demux(stream)
                    if packet.pts is not None
                )
                self._timestamps = [pts for pts, _ in times]
                self._pixel_ratio = find_pixel_ratio(stream)
                notes = describe_pixels(path, stream)
                base = stream.time_base or Fraction(1)
                rate = stream.average_rate or stream.guessed_rate
                if times and rate:
                    last, duration = (ticks * base for ticks in times[-1])
                    # Matroska does not always say how long the last frame is shown
                    _check_whole(path, container, last + (duration or 1 / rate), 1 / rate)
        except FFmpegError as error:
            raise IuvFileError(
                f"driver {path} is not a readable video: {error.strerror}"
            ) from error
        if not self._timestamps:
            raise IuvFileError(f"driver {path} holds no frames")
        super().__init__(path, f"IUV video ({codec}, {pixels})", len(self._timestamps))
        self.frame_rate = Fraction(rate) if rate else None
        self.start_seconds = self._timestamps[0] * base
        if not plan_timing(times, base, self.frame_rate, path).constant:
            notes += (
                f"{path} has a varying frame rate; its frames are shown evenly, at the mean, and"
                " may drift from its sound",
            )
        self.notes = notes

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        index = start
        try:
            with open_input(self.path, "driver") as container:
                stream = find_pictures(container, f"driver {self.path}")
                stream.codec_context.options |= CAREFUL
                stream.codec_context.thread_count = 1  # chunks are read in parallel already
                wanted = self._timestamps[start:stop]
                container.seek(wanted[0], stream=stream, backward=True)
                for frame in pick_frames(_decode_intact(container, stream), wanted):
                    size = square_size(frame.width, frame.height, self._pixel_ratio)
                    yield stretch_whole(frame.to_ndarray(format="rgb24"), size)
                    index += 1
        except (FFmpegError, _DamagedError) as error:
            reason = error.strerror if isinstance(error, FFmpegError) else error
            raise IuvFileError(
                f"{self.where(index)} is damaged ({reason}); export it again"
            ) from error
        if index < stop:
            raise IuvFileError(f"{self.where(index)} cannot be decoded; export the driver again")


class _DamagedError(Exception):
    """A decoder complained about a frame."""


def _decode_intact(container: InputContainer, stream: av.VideoStream) -> Iterator[av.VideoFrame]:
    """Decode frames as long as the decoder does not complain; in this thread only."""
    frames = container.decode(stream)
    while True:
        with hear_complaints() as complaints:
            frame = next(frames, None)
        if complaints:
            raise _DamagedError(" ".join(complaints[0][2].split()))
        if frame is None:
            return
        yield frame


def _check_lossless(path: Path, container: InputContainer, stream: av.VideoStream) -> None:
    codec, pixels = stream.codec_context.name, stream.codec_context.pix_fmt or ""
    if codec not in LOSSLESS_CODECS:
        known = _explain_first_frame(container, stream)
        if known:
            raise IuvFileError(f"driver {path} is not IUV: {known}")
        raise IuvFileError(
            f"driver {path} is compressed with {codec}, which destroys part indices;"
            f" {LOSSLESS_REMEDY}"
        )
    if not any(mark in pixels for mark in ("rgb", "bgr", "gbr")):
        raise IuvFileError(
            f"driver {path} stores {pixels} pixels, and the conversion to them already destroyed"
            f" part indices; {LOSSLESS_REMEDY}"
        )


def _explain_first_frame(container: InputContainer, stream: av.VideoStream) -> str | None:
    """Tell what the pictures of a lossy video are, if they are often mistaken for IUV."""
    frame = next(container.decode(stream), None)
    return None if frame is None else explain_picture(frame.to_ndarray(format="rgb24"))


def _check_whole(
    path: Path, container: InputContainer, end_seconds: Fraction, frame_seconds: Fraction
) -> None:
    """Compare where packets end with the length in the header: Matroska breaks off silently."""
    promised_seconds = Fraction(container.duration or 0, av.time_base)
    if len(container.streams) == 1 and promised_seconds > end_seconds + frame_seconds / 2:
        raise IuvFileError(
            f"driver {path} is truncated: it should last {float(promised_seconds):.2f} s, but ends"
            f" after {float(end_seconds):.2f} s; export it again"
        )
