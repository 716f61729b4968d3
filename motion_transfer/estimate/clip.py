"""A clip of raw pictures as IUV, frame after frame.

Decoding, estimating and what becomes of the frames run in a thread each, a few frames apart.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.estimate.choice import EVERYBODY, Follower
from motion_transfer.estimate.interface import Estimator
from motion_transfer.estimate.shots import mark_shots
from motion_transfer.estimate.together import lay_together
from motion_transfer.media.ahead import read_ahead
from motion_transfer.media.picture_stream import PictureStream
from motion_transfer.repair.gaps import fill_gaps

AHEAD_FRAMES = 4
MissingPeople = Literal["hold", "background", "fail"]

Frame = UInt8[np.ndarray, "H W 3"]


@dataclass
class ClipSummary:
    """What was seen, as far as the clip was read.

    Attributes:
        shots: the frames with which shots begin.
        empty: half-open ranges of frames in which nobody was found.
        most_people: in one frame.
    """

    frame_count: int = 0
    shots: list[int] = field(default_factory=list)
    empty: list[tuple[int, int]] = field(default_factory=list)
    most_people: int = 0

    @property
    def empty_count(self) -> int:
        return sum(stop - start for start, stop in self.empty)

    def add(self, people: int) -> None:
        """Take the next frame into account, in which so many people were found."""
        index = self.frame_count
        self.frame_count += 1
        self.most_people = max(self.most_people, people)
        if people:
            return
        if self.empty and self.empty[-1][1] == index:
            self.empty[-1] = (self.empty[-1][0], index + 1)
        else:
            self.empty.append((index, index + 1))


def estimate_clip(
    pictures: PictureStream,
    estimator: Estimator,
    *,
    person: str = EVERYBODY,
    missing: MissingPeople = "background",
    chosen: range | None = None,
    summary: ClipSummary | None = None,
) -> Generator[Frame, None, None]:
    """The IUV of every frame, H x W x 3 uint8, (I, U, V).

    Args:
        person: `all`, `largest`, an index from the left, or a box; see `Follower`.
        missing: what a frame without anybody shows: the frame before (`hold`; at the start, the
            first one with somebody), `background`, or it is an error (`fail`).
        chosen: the frames that are wanted: those before are shown empty, those behind are not read.
        summary: filled as frames are read; of the chosen ones.
    Raises: InputError if nobody is found in any frame, or in one where `fail` forbids it, or for a
        frame that is broken.
    """
    summary = summary if summary is not None else ClipSummary()
    chosen = chosen or range(pictures.frame_count)
    frames = _estimate(pictures, estimator, person, summary, chosen, fail=missing == "fail")
    with closing(read_ahead(frames, AHEAD_FRAMES)) as ahead:
        yield from fill_gaps(ahead, "hold") if missing == "hold" else ahead
    if summary.empty_count == summary.frame_count:
        what = pictures.path if summary.frame_count == 1 else f"any frame of {pictures.path}"
        raise InputError(
            f"nobody was found in {what}; it should show a person, upright and larger than about"
            " 60 pixels, whose IUV can otherwise be made by DensePose"
        )


def _estimate(
    pictures: PictureStream,
    estimator: Estimator,
    person: str,
    summary: ClipSummary,
    chosen: range,
    *,
    fail: bool,
) -> Iterator[Frame]:
    follower = Follower(person)
    marked = mark_shots(islice(pictures.read(), chosen.stop))
    with closing(read_ahead(marked, AHEAD_FRAMES)) as frames:
        for index, (picture, begins) in enumerate(frames):
            if index < chosen.start:
                yield np.zeros_like(picture)
                continue
            if begins or index == chosen.start:
                summary.shots.append(index)
                estimator.start_shot()
                follower.start_shot()
            people = follower.pick(estimator.estimate(picture), pictures.where(index))
            summary.add(len(people))
            if fail and not people:
                raise InputError(
                    f"{pictures.where(index)}: nobody found; cut the clip there, or choose"
                    " --missing hold or --missing background"
                )
            yield lay_together(people, *picture.shape[:2])
