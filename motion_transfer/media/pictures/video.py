"""Videos as people film them, in any container and codec that FFmpeg reads.

`FilmedVideo` is read from beginning to end, as a clip to work on; `IndexedVideo` gives any frame by
its number, to look at.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from jaxtyping import Int32, UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.alpha import Picture
from motion_transfer.media.container import find_pictures, open_input
from motion_transfer.media.pictures.decoding import (
    decode_frames,
    describe_colours,
    find_alpha,
    find_alpha_mode,
    to_picture,
)
from motion_transfer.media.pictures.display import (
    deinterlaced,
    describe_pixels,
    find_pixel_ratio,
    square_size,
)
from motion_transfer.media.pictures.stream import (
    Frame,
    LayeredStream,
    plan_timing,
    show_steadily,
)

Pixels = UInt8[np.ndarray, "H W *C"]


@dataclass(frozen=True)
class _Shape:
    """How a file's frames become pictures, as it says itself.

    Attributes:
        pixel_ratio: Width by height of a pixel.
        matrix: Turns it upright, if the file asks for that.
        premultiplied: Whether colours are multiplied by alpha.
    """

    pixel_ratio: Fraction
    matrix: Int32[np.ndarray, "3 3"] | None
    premultiplied: bool


class IndexedVideo:
    """A video whose frames are read by number, from any thread."""

    def __init__(self, path: Path) -> None:
        """Raises: InputError if the file is missing, is no video, or holds no frames."""
        self.path = path
        with _opened(path, lambda reason: f"{path} is not a readable video: {reason}") as video:
            packets = video[0].demux(video[1])
            self._timestamps = sorted(p.pts for p in packets if p.pts is not None)
        if not self._timestamps:
            raise InputError(f"video {path} holds no frames")

    @property
    def frame_count(self) -> int:
        return len(self._timestamps)

    def read(self, index: int) -> Frame:
        """Read one frame, RGB, as it is shown.

        Raises: InputError naming the frame that cannot be decoded.
        """
        wanted = self._timestamps[index]
        before = self._timestamps[max(index - 1, 0)]  # what is interlaced is told by its neighbours
        where = f"frame {index} of {self.path}"
        with _opened(self.path, lambda reason: _damaged(where, reason)) as (container, stream):
            container.seek(before, stream=stream, backward=True)
            premultiplied = find_alpha_mode(container, stream) == "premultiplied"
            for frame in pick_frames(deinterlaced(decode_frames(container, stream)), [wanted]):
                shape = _Shape(find_pixel_ratio(stream), _display_matrix(frame), premultiplied)
                return _show(frame, shape).on_white()
        raise InputError(f"{where} cannot be decoded; export it again")


class FilmedVideo(LayeredStream):
    """A video as a clip: upright, of whole frames with square pixels, and at a constant rate."""

    def __init__(self, path: Path) -> None:
        """Raises: InputError if it is no video, or has no frames that can be decoded."""

        def refuse(reason: str | None) -> str:
            return f"{path} is neither a picture nor a video that can be read: {reason}"

        with _opened(path, refuse) as (container, stream):
            rate = stream.average_rate or stream.guessed_rate
            base = stream.time_base or Fraction(1)
            times = [
                (packet.pts, packet.duration or 0)
                for packet in container.demux(stream)
                if packet.size and not packet.is_discard  # an edit list hides some
            ]
        self._timing = plan_timing(times, base, rate and Fraction(rate), path)
        self._clocked = all(pts is not None for pts, _ in times)
        with _opened(path, refuse) as (container, stream):
            first = next(decode_frames(container, stream), None)
            if first is None:
                raise InputError(f"video {path} holds no frames")
            mode = find_alpha_mode(container, stream)
            ratio, matrix = find_pixel_ratio(stream), _display_matrix(first)
            self._shape = _Shape(ratio, matrix, mode == "premultiplied")
            height, width = _show(first, self._shape).rgb.shape[:2]
            notes = describe_pixels(path, stream) + describe_colours(path, stream, first, mode)
            if first.interlaced_frame:
                notes += (f"{path} is interlaced; every frame is made whole (FFmpeg's bwdif)",)
        super().__init__(path, self._timing.count, height, width)
        self._take_timing(self._timing)
        self.notes += notes
        self.has_alpha = find_alpha(first) is not None

    def _play(self, start: int) -> Iterator[Callable[[], Picture]]:
        shown: av.VideoFrame | None = None
        make: Callable[[], Picture] | None = None
        index = start
        with _opened(self.path, lambda reason: _damaged(self.where(index), reason)) as video:
            if start and self._clocked:
                self._seek(*video, start)
            for frame in show_steadily(self._decode(*video), self._timing, start):
                if make is None or frame is not shown:
                    shown, make = frame, partial(self._shown, frame, index)
                yield make
                index += 1
        if shown is None:
            raise InputError(f"video {self.path} holds no frames from {start} on; export it again")

    def _seek(self, container: InputContainer, stream: av.VideoStream, index: int) -> None:
        """Go to the last key frame that is not shown after a frame."""
        # one before: what is interlaced is told by its neighbours
        middle = self._timing.middle_seconds(max(0, index - 1))
        time = int(middle / (stream.time_base or Fraction(1)))
        container.seek(time, stream=stream, backward=True)

    def _decode(
        self, container: InputContainer, stream: av.VideoStream
    ) -> Iterator[tuple[Fraction, av.VideoFrame]]:
        """Decode frames, each with when it is shown, in seconds."""
        stream.thread_type = "AUTO"
        for number, frame in enumerate(deinterlaced(decode_frames(container, stream))):
            if self._clocked and frame.pts is not None and frame.time_base is not None:
                yield frame.pts * frame.time_base, frame
            else:
                yield self.start_seconds + number / self._timing.rate, frame

    def _shown(self, frame: av.VideoFrame, index: int) -> Picture:
        picture = _show(frame, self._shape)
        return self._check_size(picture, index, "the video began with", "export it in one size")


def pick_frames(
    frames: Iterable[av.VideoFrame], timestamps: Sequence[int]
) -> Iterator[av.VideoFrame]:
    """Pick the frames with these times, in order; end before the first that is not there.

    Args:
        frames: What is decoded after a seek, which goes to the key frame before.
    """
    left = deque(timestamps)
    for frame in frames:
        if frame.pts is None or frame.pts < left[0]:
            continue
        if frame.pts > left.popleft():
            return  # the decoder dropped the one that is wanted, and another must not stand for it
        yield frame
        if not left:
            return


def turn_upright(picture: Pixels, matrix: Int32[np.ndarray, "3 3"] | None) -> Pixels:
    """Turn a picture as a display matrix says: quarter turns and mirrors; others are left alone.

    Convention: rows of the matrix say where the picture's x and y go, x to the right, y down.
    """
    if matrix is None:
        return picture
    (a, b), (c, d) = matrix[:2, :2].tolist()
    if abs(b) > abs(a) and abs(c) > abs(d):
        picture, a, d = picture.swapaxes(0, 1), c, b
    if a < 0:
        picture = picture[:, ::-1]
    if d < 0:
        picture = picture[::-1]
    return np.ascontiguousarray(picture)


def _show(frame: av.VideoFrame, shape: _Shape) -> Picture:
    """Turn a frame into a picture as it is shown: RGB, with square pixels, upright."""
    size = square_size(frame.width, frame.height, shape.pixel_ratio)
    picture = to_picture(frame, size, premultiplied=shape.premultiplied)
    alpha = None if picture.alpha is None else turn_upright(picture.alpha, shape.matrix)
    return Picture(turn_upright(picture.rgb, shape.matrix), alpha)


def _display_matrix(frame: av.VideoFrame) -> Int32[np.ndarray, "3 3"] | None:
    """Find how the file asks to be shown, if it does."""
    data = frame.side_data.get("DISPLAYMATRIX")
    return None if data is None else np.frombuffer(bytes(data), np.int32).reshape(3, 3)


def _damaged(where: str, reason: str | None) -> str:
    return f"{where} is damaged ({reason}); export it again"


@contextmanager
def _opened(
    path: Path, explain: Callable[[str | None], str]
) -> Iterator[tuple[InputContainer, av.VideoStream]]:
    """Open a file and its pictures; FFmpeg's refusals on the way become InputError.

    Args:
        explain: Puts FFmpeg's reason into a message.
    """
    try:
        with open_input(path) as container:
            yield container, find_pictures(container, f"video {path}")
    except FFmpegError as error:
        raise InputError(explain(error.strerror)) from error
