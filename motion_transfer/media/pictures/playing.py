"""Pictures of a clip by number, for several threads that each want a stretch of them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from motion_transfer.errors import InputError
from motion_transfer.media.pictures.stream import Frame, PictureStream

OPEN_DECODERS = 4  # kept for the next stretch
FARTHEST_SKIP = 300
"""Frames; as far as encoders lay key frames apart, a decoder that goes on beats one that seeks."""


@dataclass
class _Decoder:
    position: int
    pictures: Iterator[Callable[[], Frame]]


class Player:
    """Gives pictures by number; decoders are kept open, and go on where they stand."""

    def __init__(self, clip: PictureStream) -> None:
        self._clip = clip
        self._idle: list[_Decoder] = []
        self._lock = threading.Lock()

    def read(self, numbers: Iterable[int]) -> Iterator[Frame]:
        """Read pictures, not to be written to; numbers that rise cost no more than their decoding.

        Raises: InputError naming the picture that is broken.
        """
        decoder: _Decoder | None = None
        picture: Frame | None = None
        shown = -1
        try:
            for number in numbers:
                if number != shown or picture is None:
                    if decoder is None or not 0 <= number - decoder.position <= FARTHEST_SKIP:
                        self._put_back(decoder)
                        decoder = self._take(number)
                    picture, shown = self._go_to(decoder, number)(), number
                yield picture
        except InputError:
            decoder = None  # it stands nowhere
            raise
        finally:
            self._put_back(decoder)

    def _go_to(self, decoder: _Decoder, number: int) -> Callable[[], Frame]:
        make: Callable[[], Frame] | None = None
        while decoder.position <= number:
            make = next(decoder.pictures, None)
            if make is None:
                raise InputError(f"{self._clip.where(number)} is not there; export it again")
            decoder.position += 1
        assert make is not None  # `_take` gives a decoder that has not passed it
        return make

    def _take(self, number: int) -> _Decoder:
        """Take the decoder that is nearest before a picture, or open one there."""
        with self._lock:
            before = [d for d in self._idle if 0 <= number - d.position <= FARTHEST_SKIP]
            if before:
                nearest = max(before, key=lambda decoder: decoder.position)
                self._idle.remove(nearest)
                return nearest
        return _Decoder(number, self._clip.play(number))

    def _put_back(self, decoder: _Decoder | None) -> None:
        if decoder is None or decoder.position >= self._clip.frame_count:
            return
        with self._lock:
            self._idle.append(decoder)
            del self._idle[:-OPEN_DECODERS]
