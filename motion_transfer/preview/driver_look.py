"""A driver that can be shown before it has been looked through."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_stream import IuvReader, open_reader
from motion_transfer.preview.kept import Kept
from motion_transfer.render.events import Listener
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.person import People, find_people, take_as_one
from motion_transfer.render.picture_driver import ORDER, PictureDriver, estimate_driver
from motion_transfer.render.plan import SeenFrame, digest_of_iuv
from motion_transfer.render.prepare import DriverFile, are_pictures, open_iuv_driver

BLOCK_FRAMES = 16
KEPT_BYTES = 256 * 2**20
"""Of decoded frames: to jump into a video is to decode from its last key frame."""


@dataclass
class DriverLook:
    """What is known of a driver so far; written by the thread that looks, read by any.

    Attributes:
        seen: by frame, those that were looked at and could be read.
        broken: by frame, why it cannot be read.
        pictures: where the driver is raw pictures: what was made of them.
        most_people: in any frame so far.
    """

    path: Path
    reader: IuvReader
    frame_rate: Fraction | None
    pictures: PictureDriver | None = None
    seen: dict[int, SeenFrame] = field(default_factory=dict)
    broken: dict[int, str] = field(default_factory=dict)
    most_people: int = 0
    _kept: Kept[np.ndarray] = field(default_factory=lambda: Kept(KEPT_BYTES, lambda a: a.nbytes))

    @property
    def frame_count(self) -> int:
        return self.reader.stream.frame_count

    @property
    def whole(self) -> bool:
        """Every frame was looked at."""
        return len({*self.seen, *self.broken}) == self.frame_count

    def read(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        """One frame's IUV, not to be written to. Raises: InputError naming the broken frame."""
        kept = self._kept.get(index)
        if kept is not None:
            return kept
        # whoever asks for the next one, plays: decoding then goes on instead of beginning anew
        playing = self._kept.get(index - 1) is not None
        stop = min(index + (BLOCK_FRAMES if playing else 1), self.frame_count)
        frames = self.reader.read(index, stop)
        try:
            wanted = next(frames)
        except InputError as error:
            self.broken[index] = str(error)
            raise
        self._kept.put(index, wanted)
        with suppress(InputError):  # who asks for those will hear of it
            for number, iuv in enumerate(frames, index + 1):
                self._kept.put(number, iuv)
        return wanted

    def people_in(self, iuv: UInt8[np.ndarray, "H W 3"]) -> People:
        """Everybody in a frame."""
        return take_as_one(iuv) if self.pictures else find_people(iuv)

    def look_at(self, frames: Iterable[int]) -> None:
        """Look at single frames; broken ones are noted."""
        for index in frames:
            if index in self.seen or index in self.broken:
                continue
            try:
                self._note(index, self.read(index))
            except InputError:
                continue

    def look_through(self, stop: threading.Event, done: Callable[[int], object]) -> None:
        """Look at every frame in order, until it is done or `stop` is set.

        Args:
            done: called with the number of frames looked at so far.
        """
        for start in range(0, self.frame_count, BLOCK_FRAMES):
            block = range(start, min(start + BLOCK_FRAMES, self.frame_count))
            if stop.is_set():
                return
            try:
                for index, iuv in enumerate(self.reader.read(block.start, block.stop), start):
                    self._note(index, iuv)
            except InputError:  # one of them: the others can be read one by one
                self.look_at(block)
            done(block.stop)

    def _note(self, index: int, iuv: UInt8[np.ndarray, "H W 3"]) -> None:
        people = self.people_in(iuv)
        self.most_people = max(self.most_people, len(people.persons))
        self._kept.put(index, iuv)
        self.seen[index] = SeenFrame(people, digest_of_iuv(iuv))


def open_look(options: RenderOptions, folder: Path, listener: Listener) -> DriverLook:
    """Open a driver; if it is raw pictures, find their IUV first, which takes a while.

    Args:
        folder: where the IUV of pictures is kept.
    Raises: InputError if there is no such driver, or nothing in it can be read.
    """
    if are_pictures(options):
        pictures = estimate_driver(options, folder, listener)
        reader = DriverFile(pictures.iuv, "fail", ORDER).open()
        return DriverLook(options.driver, reader, pictures.frame_rate, pictures)
    stream = open_iuv_driver(options, options.missing or "fail", listener)
    return DriverLook(options.driver, open_reader(stream, options.iuv_order), stream.frame_rate)
