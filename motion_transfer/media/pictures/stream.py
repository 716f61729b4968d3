"""What every clip of pictures offers: upright frames of one size at a constant rate, one by one.

A varying rate becomes its mean: each output frame is the one that is on the screen in the middle of
its time, so that frames are repeated or left out and nothing drifts from the sound.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.alpha import Picture, Rgba, add_alpha
from motion_transfer.media.pictures.photo import Photo, read_photo

Frame = UInt8[np.ndarray, "H W 3"]
Ticks = int | Fraction
Shown = TypeVar("Shown")
Held = TypeVar("Held", Photo, Picture)

DEFAULT_RATE = Fraction(30)
"""Frames per second where nothing tells a rate."""

LARGEST_DENOMINATOR = 1001
"""Limit for the mean of a varying rate; 1001 is what broadcast rates such as 30000/1001 need, and
any longer fraction is no better."""

STEADY = Fraction(1, 2)
"""Share of a frame's time by which a frame of a constant rate may be away from its place."""


@dataclass(frozen=True)
class Timing:
    """When the output's frames are shown.

    Attributes:
        rate: Frames per second.
        count: How many frames there are.
        start_seconds: When the first one is shown.
        constant: Whether the file has this rate itself.
    """

    rate: Fraction
    count: int
    start_seconds: Fraction
    constant: bool

    def middle_seconds(self, index: int) -> Fraction:
        """Tell the middle of the time at which an output frame is shown."""
        return self.start_seconds + (index + Fraction(1, 2)) / self.rate


class PictureStream(ABC):
    """RGB frames of one size.

    Attributes:
        frame_rate: The rate of the frames, or None where they come without one.
        start_seconds: When the first frame is shown, on the clock of the file's sound.
        has_alpha: Whether there is alpha: in the first picture, or in any one of an animation.
        notes: What the user should know of how this clip is read, in sentences; there may be more
            of them when it has been.
    """

    def __init__(self, path: Path, frame_count: int, height: int, width: int) -> None:
        self.path = path
        self.frame_count = frame_count
        self.height = height
        self.width = width
        self.frame_rate: Fraction | None = None
        self.start_seconds = Fraction(0)
        self.has_alpha = False
        self.notes: tuple[str, ...] = ()

    @abstractmethod
    def read(self) -> Iterator[Frame]:
        """Read every frame in order; where it is transparent, white shows.

        Raises: InputError naming the frame that is broken.
        """

    def read_rgba(self) -> Iterator[Rgba]:
        """Read every frame in order with its alpha, the colours not multiplied by it.

        Raises: InputError naming the frame that is broken.
        """
        return map(add_alpha, self.read())

    def play(self, start: int = 0) -> Iterator[Callable[[], Frame]]:
        """Give each frame from `start` on as a call that makes it: who skips it pays little.

        A frame that is repeated is the same object. Raises: InputError, see `read`, also in the
        calls.
        """
        for frame in islice(self.read(), start, None):
            yield partial(_itself, frame)

    def where(self, index: int) -> str:
        """Name the place of a frame, for messages."""
        return f"frame {index} of {self.path}"

    def _take_timing(self, timing: Timing) -> None:
        """Have the rate and the beginning of a timing, and say so if the file's rate varies."""
        self.frame_rate, self.start_seconds = timing.rate, timing.start_seconds
        if not timing.constant:
            self.notes = (
                f"{self.path} has a varying frame rate; it is read at its mean, {timing.rate}"
                f" ({float(timing.rate):.2f}) frames/s, by repeating and leaving out frames",
            )

    def _check_size(
        self,
        picture: Held,
        index: int,
        first: str = "the first picture is",
        remedy: str = "pictures of one clip need one size, give others one by one",
    ) -> Held:
        """Hold a frame to the size of the first one. Raises: InputError."""
        height, width = picture.rgb.shape[:2]
        if (height, width) != (self.height, self.width):
            raise InputError(
                f"{self.where(index)} is {width} x {height}, but {first}"
                f" {self.width} x {self.height}; {remedy}"
            )
        return picture


class LayeredStream(PictureStream):
    """Pictures that may be transparent."""

    @abstractmethod
    def _play(self, start: int) -> Iterator[Callable[[], Photo | Picture]]:
        """Give calls that make the pictures; of one that is repeated it is the same call."""

    def read(self) -> Iterator[Frame]:
        return (frame() for frame in self.play())

    def read_rgba(self) -> Iterator[Rgba]:
        return (frame() for frame in self._converted(0, lambda picture: picture.rgba()))

    def play(self, start: int = 0) -> Iterator[Callable[[], Frame]]:
        return self._converted(start, lambda picture: picture.on_white())

    def _converted(
        self, start: int, convert: Callable[[Photo | Picture], Shown]
    ) -> Iterator[Callable[[], Shown]]:
        """Have every picture converted, and repeated ones once."""
        last = converted = None
        for make in self._play(start):
            if converted is None or make is not last:
                last, converted = make, cache(partial(_convert, make, convert))
            yield converted


class PhotoStream(LayeredStream):
    """One photo, or several of one size, turned upright as their EXIF says."""

    def __init__(self, path: Path, files: list[Path] | None = None) -> None:
        """Raises: InputError if the first photo cannot be read."""
        self._files = files or [path]
        first = read_photo(self._files[0], "picture")
        super().__init__(path, len(self._files), *first.rgb.shape[:2])
        self.notes = first.notes
        self.has_alpha = first.alpha is not None

    def _play(self, start: int) -> Iterator[Callable[[], Photo]]:
        return (partial(self._photo, index) for index in range(start, len(self._files)))

    def _photo(self, index: int) -> Photo:
        photo = read_photo(self._files[index], "picture")
        self.notes = tuple(dict.fromkeys((*self.notes, *photo.notes)))  # may be read twice
        return self._check_size(photo, index)

    def where(self, index: int) -> str:
        return f"frame {index}, {self._files[index]}" if self.path.is_dir() else str(self.path)


def plan_timing(
    times: Sequence[tuple[Ticks | None, Ticks]], base: Fraction, rate: Fraction | None, path: Path
) -> Timing:
    """Plan the output's frames from the times of the file's.

    Args:
        times: When each frame is shown, if the file says, and for how long, in units of `base`.
        base: The length of a tick, seconds.
        rate: What the container says, if anything.
        path: The file, for messages.
    Raises: InputError if there are no frames.
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
    mean = max(mean, Fraction(1, LARGEST_DENOMINATOR))  # a slower one would be rounded to none
    length = last - start + (known[-1][1] * base or 1 / mean)
    return Timing(mean, max(1, round(length * mean)), start, constant=False)


def show_steadily(
    frames: Iterable[tuple[Fraction, Shown]], timing: Timing, start: int = 0
) -> Iterator[Shown]:
    """Yield for each output frame the one that is on the screen in the middle of its time.

    Args:
        frames: Pairs of when a frame is shown, in seconds, and the frame, in order; the first one
            begins before the middle of the first output frame.
        start: The first output frame.
    """
    frame_seconds = 1 / timing.rate
    middle = timing.middle_seconds(start)
    shown: Shown | None = None
    index = start
    for begins, frame in frames:
        while index < timing.count and shown is not None and begins > middle:
            yield shown
            index, middle = index + 1, middle + frame_seconds
        shown = frame
    for _ in range(index, timing.count):
        if shown is not None:
            yield shown


def _itself(frame: Frame) -> Frame:
    return frame


def _convert(
    make: Callable[[], Photo | Picture], convert: Callable[[Photo | Picture], Shown]
) -> Shown:
    return convert(make())
