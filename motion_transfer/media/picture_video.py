"""Videos as people film them, read from beginning to end: upright, at a constant rate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.error import FFmpegError
from jaxtyping import Int32

from motion_transfer.errors import InputError
from motion_transfer.media.picture_stream import Frame, PictureStream

DEFAULT_RATE = Fraction(30)
LARGEST_DENOMINATOR = 1001
"""Of the mean of a varying rate: any shorter fraction is as good."""

STEADY = Fraction(1, 2)
"""Of a frame's time: how far a frame of a constant rate may be from its place."""


@dataclass(frozen=True)
class Timing:
    """When frames are shown.

    Attributes:
        rate: of the output, frames a second.
        count: of the output's frames.
        start_seconds: of the first one.
        constant: whether the file has this rate itself.
    """

    rate: Fraction
    count: int
    start_seconds: Fraction
    constant: bool


class VideoPictures(PictureStream):
    """A video of any container and codec that FFmpeg reads.

    A varying rate becomes its mean: each output frame is the one that is on the screen in the
    middle of its time, so frames are repeated or left out and nothing drifts from the sound.
    """

    def __init__(self, path: Path) -> None:
        """Raises: InputError if it is no video, or has no frames that can be decoded."""
        try:
            with av.open(str(path)) as container:
                if not container.streams.video:
                    raise InputError(f"video {path} has no pictures in it")
                stream = container.streams.video[0]
                rate = stream.average_rate or stream.guessed_rate
                base = stream.time_base or Fraction(1)
                times = [
                    (packet.pts, packet.duration or 0)
                    for packet in container.demux(stream)
                    if packet.size and not packet.is_discard
                ]
            self._timing = plan_timing(times, base, rate and Fraction(rate), path)
            self._clocked = all(pts is not None for pts, _ in times)
            with av.open(str(path)) as container:
                first = next(container.decode(video=0), None)
        except FFmpegError as error:
            raise InputError(
                f"{path} is neither a picture nor a video that can be read: {error.strerror}"
            ) from error
        if first is None:
            raise InputError(f"video {path} holds no frames")
        self._matrix = _display_matrix(first)
        height, width = turn_upright(first.to_ndarray(format="rgb24"), self._matrix).shape[:2]
        super().__init__(path, self._timing.count, height, width)
        self.frame_rate = self._timing.rate
        self.start_seconds = self._timing.start_seconds
        if not self._timing.constant:
            self.notes = (
                f"{path} has a varying frame rate; it is read at its mean, {self.frame_rate}"
                f" ({float(self.frame_rate):.2f}) frames/s, by repeating and leaving out frames",
            )

    def read(self) -> Iterator[Frame]:
        frame_seconds = 1 / self._timing.rate
        middle = self.start_seconds + frame_seconds / 2
        shown: av.VideoFrame | None = None
        picture: Frame | None = None
        index = 0
        try:
            with av.open(str(self.path)) as container:
                container.streams.video[0].thread_type = "AUTO"
                for number, frame in enumerate(container.decode(video=0)):
                    begins = self._begins(frame, number)
                    while index < self.frame_count and shown is not None and begins > middle:
                        picture = self._upright(shown, index) if picture is None else picture
                        yield picture
                        index, middle = index + 1, middle + frame_seconds
                    shown, picture = frame, None
        except FFmpegError as error:
            raise InputError(
                f"{self.where(index)} is damaged ({error.strerror}); export it again"
            ) from error
        if shown is None:
            raise InputError(f"video {self.path} holds no frames")
        picture = self._upright(shown, index) if picture is None else picture
        for _ in range(index, self.frame_count):
            yield picture

    def where(self, index: int) -> str:
        return f"frame {index} of {self.path}"

    def _begins(self, frame: av.VideoFrame, number: int) -> Fraction:
        """When a decoded frame is shown, seconds."""
        if self._clocked and frame.pts is not None and frame.time_base is not None:
            return frame.pts * frame.time_base
        return self.start_seconds + number / self._timing.rate

    def _upright(self, frame: av.VideoFrame, index: int) -> Frame:
        picture = turn_upright(frame.to_ndarray(format="rgb24"), self._matrix)
        if picture.shape[:2] != (self.height, self.width):
            raise InputError(
                f"{self.where(index)} is {picture.shape[1]} x {picture.shape[0]}, but the video"
                f" began with {self.width} x {self.height}; export it in one size"
            )
        return picture


def plan_timing(
    times: list[tuple[int | None, int]], base: Fraction, rate: Fraction | None, path: Path
) -> Timing:
    """The output's frames from the file's packets.

    Args:
        times: of each packet its presentation time, if it has one, and its duration, in `base`.
        rate: what the container says, if anything.
    Raises: InputError if there are no packets.
    """
    if not times:
        raise InputError(f"video {path} holds no frames")
    known = sorted((pts, duration) for pts, duration in times if pts is not None)
    if len(known) < len(times):  # no clock in the file: its frames follow each other
        return Timing(rate or DEFAULT_RATE, len(times), Fraction(0), constant=True)
    start, last = known[0][0] * base, known[-1][0] * base
    if rate and all(
        abs(pts * base - start - index / rate) < STEADY / rate
        for index, (pts, _) in enumerate(known)
    ):
        return Timing(rate, len(known), start, constant=True)
    if last == start:
        return Timing(rate or DEFAULT_RATE, len(known), start, constant=True)
    mean = ((len(known) - 1) / (last - start)).limit_denominator(LARGEST_DENOMINATOR)
    mean = max(mean, Fraction(1, LARGEST_DENOMINATOR))
    length = last - start + (known[-1][1] * base or 1 / mean)
    return Timing(mean, max(1, round(length * mean)), start, constant=False)


def turn_upright(picture: Frame, matrix: Int32[np.ndarray, "3 3"] | None) -> Frame:
    """A picture as a display matrix says: quarter turns and mirrors; others are left alone.

    Convention: rows of the matrix say where the picture's x and y go, x to the right, y down.
    """
    if matrix is None:
        return picture
    (a, b), (c, d) = matrix[:2, :2].tolist()
    if abs(b) > abs(a) and abs(c) > abs(d):
        picture, a, d = picture.transpose(1, 0, 2), c, b
    if a < 0:
        picture = picture[:, ::-1]
    if d < 0:
        picture = picture[::-1]
    return np.ascontiguousarray(picture)


def _display_matrix(frame: av.VideoFrame) -> Int32[np.ndarray, "3 3"] | None:
    """How the file asks to be shown, if it does."""
    data = frame.side_data.get("DISPLAYMATRIX")
    return None if data is None else np.frombuffer(bytes(data), np.int32).reshape(3, 3)
