"""A clip of raw pictures as IUV, frame after frame.

Decoding, estimating and what becomes of the frames run in a thread each, a few frames apart.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.estimate.choice import EVERYBODY, Follower
from motion_transfer.estimate.interface import Estimator, Landmarks, PersonEstimate
from motion_transfer.estimate.shots import mark_shots
from motion_transfer.estimate.together import lay_alpha, lay_together
from motion_transfer.media.ahead import read_ahead
from motion_transfer.media.picture_stream import PictureStream
from motion_transfer.repair.gaps import fill_gaps

AHEAD_FRAMES = 4
MissingPeople = Literal["hold", "background", "fail"]

Frame = UInt8[np.ndarray, "H W C"]


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
    with_alpha: bool = False,
) -> Generator[Frame, None, None]:
    """The IUV of every frame, H x W x 3 uint8, (I, U, V).

    Args:
        person: `all`, `largest`, an index from the left, or a box; see `Follower`.
        missing: what a frame without anybody shows: the frame before (`hold`; at the start, the
            first one with somebody), `background`, or it is an error (`fail`).
        chosen: the frames that are wanted: those before are shown empty, those behind are not read.
        summary: filled as frames are read; of the chosen ones.
        with_alpha: a fourth channel says how much of each pixel is a person, 0..255.
    Raises: InputError if nobody is found in any frame, or in one where `fail` forbids it, or for a
        frame that is broken.
    """
    summary = summary if summary is not None else ClipSummary()
    chosen = chosen or range(pictures.frame_count)
    seen = _follow(pictures, estimator, person, chosen)
    frames = _draw(pictures, seen, summary, fail=missing == "fail", with_alpha=with_alpha)
    with closing(read_ahead(frames, AHEAD_FRAMES)) as ahead:
        yield from fill_gaps(ahead, "hold") if missing == "hold" else ahead
    if summary.empty_count == summary.frame_count:
        raise _nobody(pictures, summary.frame_count)


def follow_landmarks(
    pictures: PictureStream,
    estimator: Estimator,
    *,
    person: str,
    chosen: range,
    count: int,
    done: Callable[[int], object] = int,
) -> list[Landmarks]:
    """The landmarks of one person in the first `count` of the chosen frames that have them.

    Args:
        person: as `estimate_clip`'s, but for `all`.
        done: called with 1 after each frame.
    Raises: InputError if nobody is found in any of them, or for a frame that is broken.
    """
    found: list[Landmarks] = []
    with closing(_follow(pictures, estimator, person, chosen)) as frames:
        for seen in frames:
            found += [one.landmarks for one in seen.people[:1] if one.landmarks is not None]
            if seen.is_chosen:
                done(1)
            if len(found) == count:
                break
    if not found:
        raise _nobody(pictures, len(chosen))
    return found


def _nobody(pictures: PictureStream, frame_count: int) -> InputError:
    what = pictures.path if frame_count == 1 else f"any frame of {pictures.path}"
    return InputError(
        f"nobody was found in {what}; it should show a person, upright and larger than about"
        " 60 pixels, whose IUV can otherwise be made by DensePose"
    )


@dataclass(frozen=True)
class _Seen:
    """A frame and its chosen people; nobody before the first chosen frame."""

    index: int
    picture: Frame
    is_chosen: bool
    begins: bool
    people: list[PersonEstimate]


def _follow(
    pictures: PictureStream, estimator: Estimator, person: str, chosen: range
) -> Generator[_Seen, None, None]:
    follower = Follower(person)
    marked = mark_shots(islice(pictures.read(), chosen.stop))
    with closing(read_ahead(marked, AHEAD_FRAMES)) as frames:
        for index, (picture, begins) in enumerate(frames):
            if index < chosen.start:
                yield _Seen(index, picture, False, False, [])
                continue
            begins = begins or index == chosen.start
            if begins:
                estimator.start_shot()
                follower.start_shot()
            people = follower.pick(estimator.estimate(picture), pictures.where(index))
            yield _Seen(index, picture, True, begins, people)


def _draw(
    pictures: PictureStream,
    frames: Generator[_Seen, None, None],
    summary: ClipSummary,
    *,
    fail: bool,
    with_alpha: bool,
) -> Iterator[Frame]:
    with closing(frames):
        for seen in frames:
            height, width = seen.picture.shape[:2]
            if seen.begins:
                summary.shots.append(seen.index)
            if seen.is_chosen:
                summary.add(len(seen.people))
                if fail and not seen.people:
                    raise InputError(
                        f"{pictures.where(seen.index)}: nobody found; cut the clip there, or choose"
                        " --missing hold or --missing background"
                    )
            iuv = lay_together(seen.people, height, width)
            if with_alpha:
                iuv = np.dstack([iuv, lay_alpha(seen.people, height, width)])
            yield iuv
