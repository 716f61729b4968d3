"""A clip of raw pictures as IUV, frame after frame, one person or several in each.

Decoding, finding people, and what becomes of the frames run in a thread each, a few frames apart;
what is left to do about the people found is done for several frames at once.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations, islice
from typing import Literal

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.cores import core_count
from motion_transfer.drawing.person import EVERYBODY, Box, Follower
from motion_transfer.errors import InputError
from motion_transfer.estimate.ahead import read_ahead, work_ahead
from motion_transfer.estimate.interface import (
    AT_ONCE,
    Estimator,
    Finish,
    Landmarks,
    PersonEstimate,
    StagedEstimator,
)
from motion_transfer.estimate.shots import mark_shots
from motion_transfer.media.pictures.stream import PictureStream
from motion_transfer.repair.gaps import fill_gaps

AHEAD_FRAMES = 4  # a few, so that a slow frame of one thread does not stop the others

NOBODY = 255  # higher than anybody's number, so that the lowest number around a pixel is a person
MOST_PEOPLE = NOBODY - 1  # in a frame; those after them are left out

MissingPeople = Literal["hold", "background", "fail"]
Frame = UInt8[np.ndarray, "H W C"]


@dataclass
class ClipSummary:
    """What was seen, as far as the clip was read.

    Attributes:
        shots: The frames of the clip with which shots begin.
        empty: Half-open ranges of the chosen frames in which nobody was found.
        most_people: How many were found in one frame, at most.
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
        if not people:
            goes_on = bool(self.empty) and self.empty[-1][1] == index
            start = self.empty.pop()[0] if goes_on else index
            self.empty.append((start, index + 1))


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
    """Estimate the IUV of every frame, H x W x 3 uint8, (I, U, V).

    Args:
        person: `all`, `largest`, an index from the left, or a box; see `Follower`.
        missing: What a frame without anybody shows: the frame before (`hold`; at the start, the
            first one with somebody), `background`, or it is an error (`fail`).
        chosen: The frames that are wanted: those before are shown empty, those behind are not read.
        summary: Filled as frames are read; tells of the chosen ones.
        with_alpha: Whether a fourth channel says how much of each pixel is a person, 0..255.
    Raises: InputError if nobody is found in any frame, or in one where `fail` forbids it, or for a
        frame that is broken.
    """
    summary = summary if summary is not None else ClipSummary()
    chosen = chosen or range(pictures.frame_count)
    seen = follow_people(pictures, estimator, person, chosen)
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
    """Find the landmarks of one person in the first `count` of the chosen frames that have them.

    Args:
        person: As that of `estimate_clip`, but for `all`.
        done: Called with 1 after each frame.
    Raises: InputError if nobody is found in any of them, or for a frame that is broken.
    """
    found: list[Landmarks] = []
    with closing(follow_people(pictures, estimator, person, chosen)) as frames:
        for seen in frames:
            found += [one.landmarks for one in seen.people[:1] if one.landmarks is not None]
            if seen.is_chosen:
                done(1)
            if len(found) == count:
                break
    if not found:
        raise _nobody(pictures, len(chosen))
    return found


def lay_iuv(
    people: Sequence[PersonEstimate], height: int, width: int
) -> UInt8[np.ndarray, "H W 3"]:
    """Lay the people of a frame in one IUV image, and still apart.

    A pixel that several claim goes to the one whose alpha is higher there: where somebody is
    covered, its mask ends. An image of (I, U, V) does not say whose a pixel is, and connected
    pixels are taken for one person's; so between people who touch, one pixel of background stays.
    """
    iuv = np.zeros((height, width, 3), np.uint8)
    people = people[:MOST_PEOPLE]
    if not any(_touch(a.box, b.box) for a, b in combinations(people, 2)):
        for person in people:
            iuv[person.box.slices] = person.iuv
        return iuv
    owner = np.full((height, width), NOBODY, np.uint8)
    claim = np.full((height, width), -1, np.int16)  # below alpha 0, which may be a body, too
    for number, person in enumerate(people):
        place = person.box.slices
        wins = (person.iuv[..., 0] > 0) & (person.alpha > claim[place])
        # not by `[wins]`: of a large photo its list of indices takes more memory than the photo
        np.copyto(iuv[place], person.iuv, where=wins[..., None])
        np.copyto(claim[place], person.alpha, where=wins)
        np.copyto(owner[place], number, where=wins)
    nearby = cv2.erode(owner, np.ones((3, 3), np.uint8))  # the lowest number around
    iuv *= (nearby == owner)[..., None]
    return iuv


def lay_alpha(
    people: Sequence[PersonEstimate], height: int, width: int
) -> UInt8[np.ndarray, "H W"]:
    """Tell how much of each pixel is anybody, 0..255; where several are, the most certain's."""
    alpha = np.zeros((height, width), np.uint8)
    for person in people:
        place = person.box.slices
        np.maximum(alpha[place], person.alpha, out=alpha[place])
    return alpha


def _touch(one: Box, other: Box) -> bool:
    across = one.left <= other.right and other.left <= one.right
    return across and one.top <= other.bottom and other.top <= one.bottom


@dataclass(frozen=True)
class SeenPicture:
    """A frame of raw pictures, and whom of its people was meant.

    Attributes:
        is_chosen: Whether it is one of the chosen frames; before them, nobody is looked for.
        begins: Whether a shot begins here.
    """

    index: int
    picture: Frame
    is_chosen: bool
    begins: bool
    people: list[PersonEstimate]


def follow_people(
    pictures: PictureStream, estimator: Estimator, person: str, chosen: range
) -> Generator[SeenPicture, None, None]:
    """Find the people of every frame up to the last chosen one, and follow those that are meant.

    Args:
        person: As that of `estimate_clip`.
    Raises: InputError for a frame that is broken, or if the choice means nobody.
    """
    follower = Follower(person)
    marked = mark_shots(islice(pictures.read(), chosen.stop))
    at_once = min(AT_ONCE, core_count())
    with (
        closing(read_ahead(marked, AHEAD_FRAMES)) as frames,
        closing(work_ahead(_locate(frames, estimator, chosen), AHEAD_FRAMES, at_once)) as located,
    ):
        for index, (picture, begins, people) in enumerate(located):
            if begins:
                follower.start_shot()
            picked = follower.pick(people, pictures.where(index))
            yield SeenPicture(index, picture, index >= chosen.start, begins, picked)


def _locate(
    frames: Iterable[tuple[Frame, bool]], estimator: Estimator, chosen: range
) -> Generator[Callable[[], tuple[Frame, bool, list[PersonEstimate]]], None, None]:
    """What has to see one frame after the other; gives what is left to do."""
    for index, (picture, begins) in enumerate(frames):
        if index < chosen.start:
            yield partial(_finish, picture, False, list)
            continue
        # the first frame that is looked at has no past, wherever its shot began
        begins = begins or index == chosen.start
        if begins:
            estimator.start_shot()
        staged = isinstance(estimator, StagedEstimator)
        finish = estimator.locate(picture) if staged else partial(list, estimator.estimate(picture))
        yield partial(_finish, picture, begins, finish)


def _finish(
    picture: Frame, begins: bool, finish: Finish
) -> tuple[Frame, bool, list[PersonEstimate]]:
    return picture, begins, finish()


def _draw(
    pictures: PictureStream,
    frames: Generator[SeenPicture, None, None],
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
            iuv = lay_iuv(seen.people, height, width)
            yield cv2.merge([iuv, lay_alpha(seen.people, height, width)]) if with_alpha else iuv


def _nobody(pictures: PictureStream, frame_count: int) -> InputError:
    what = pictures.path if frame_count == 1 else f"any frame of {pictures.path}"
    return InputError(
        f"nobody was found in {what}; it should show a person, upright and larger than about"
        " 60 pixels, whose IUV can otherwise be made by DensePose"
    )
