"""Before any frame is rendered: who is followed, where the window lies, how the frames are cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from hashlib import sha256
from typing import Protocol

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_stream import IuvReader
from motion_transfer.media.stream import IuvStream
from motion_transfer.render.person import People, Person, choose_person, find_people, follow
from motion_transfer.render.window import Window, plan_window

CHUNK_FRAMES = 48
"""Cut points are multiples of this, whatever the number of workers: they decide the bytes."""

SCAN_FRAMES = 16


class FrameReader(Protocol):
    """What is asked of a driver while it is rendered; an `IuvReader` is one."""

    @property
    def stream(self) -> IuvStream: ...

    def read(self, start: int, stop: int) -> Iterator[np.ndarray]:
        """Frames start..stop-1, H x W x 3 uint8, (I, U, V)."""
        ...


def digest_of_iuv(iuv: UInt8[np.ndarray, "H W 3"]) -> str:
    """Of a frame's content; hexadecimal."""
    return sha256(np.ascontiguousarray(iuv).data).hexdigest()


@dataclass(frozen=True)
class Chunk:
    """A half-open range of output frames, encoded as one segment."""

    index: int
    start: int
    stop: int


@dataclass(frozen=True)
class FramePlan:
    """Who is rendered in one frame: nobody (None), or a person, alone in it or to be isolated.

    `digest` is of the frame's IUV, everybody in it included; hexadecimal.
    """

    person: Person | None
    alone: bool
    digest: str = ""


@dataclass(frozen=True)
class SeenFrame:
    """What one look at a driver's frame tells: who is in it, and a digest of its IUV."""

    people: People
    digest: str


@dataclass(frozen=True)
class DriverPlan:
    """What the engine needs to know of a driver.

    Attributes:
        first: the driver's frame that becomes output frame 0.
        frames: one entry for each output frame.
        window: the crop window, steady for all of them.
    """

    first: int
    frames: tuple[FramePlan, ...]
    window: Window
    frame_rate: Fraction

    @property
    def chunks(self) -> list[Chunk]:
        starts = range(0, len(self.frames), CHUNK_FRAMES)
        return [
            Chunk(index, start, min(start + CHUNK_FRAMES, len(self.frames)))
            for index, start in enumerate(starts)
        ]


def frame_range(frames: tuple[int | None, int | None], count: int, where: str) -> range:
    """The driver's frames that a run uses. Raises: InputError if it has none of them."""
    start, stop = frames[0] or 0, count if frames[1] is None else frames[1]
    if not 0 <= start < stop <= count:
        raise InputError(
            f"frames {start}:{stop} asked for, but {where} has {count}: 0:{count} at most"
        )
    return range(start, stop)


def scan_people(
    reader: IuvReader, frames: range, workers: int, done: Callable[[int], None]
) -> list[SeenFrame]:
    """Everybody in each frame, decoded in parallel; nothing but boxes and digests is kept."""

    def scan(start: int) -> list[SeenFrame]:
        block = range(start, min(start + SCAN_FRAMES, frames.stop))
        found = [
            SeenFrame(find_people(iuv), digest_of_iuv(iuv))
            for iuv in reader.read(block.start, block.stop)
        ]
        done(len(found))
        return found

    starts = range(frames.start, frames.stop, SCAN_FRAMES)
    with ThreadPoolExecutor(workers) as pool:
        try:
            return [seen for block in pool.map(scan, starts) for seen in block]
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def plan_path(
    seen: list[SeenFrame],
    *,
    chosen: range,
    frame_rate: Fraction,
    person: str,
    where: str,
    where_first: str,
) -> DriverPlan:
    """Follow the chosen person through the driver and lay the window around the whole path.

    Args:
        chosen: the driver's frames that were seen.
        where, where_first: the driver and the first of those frames, for messages.
    Raises: InputError if the first frame, or every frame, is empty.
    """
    people = [frame.people for frame in seen]
    inhabited = next((i for i, found in enumerate(people) if found.persons), None)
    if inhabited is None:
        raise InputError(f"{where}: no person in any of the frames {chosen.start}:{chosen.stop}")
    if inhabited > 0:
        raise InputError(
            f"{where_first}: no person in the first frame; start with"
            f" --frames {chosen.start + inhabited}:{chosen.stop}"
        )
    first = choose_person(people[0], person, where_first)
    path = follow(people, first)
    plans = tuple(
        FramePlan(
            who,
            alone=who is not None and len(who.regions) == frame.people.region_count,
            digest=frame.digest,
        )
        for who, frame in zip(path, seen, strict=True)
    )
    return DriverPlan(chosen.start, plans, plan_window(path), frame_rate)


def empty_stretches(plan: DriverPlan) -> Iterator[tuple[int, int]]:
    """Half-open ranges of driver frames in which the person cannot be seen."""
    start = None
    for index, frame in enumerate((*plan.frames, FramePlan(plan.frames[0].person, True))):
        if frame.person is None and start is None:
            start = index
        elif frame.person is not None and start is not None:
            yield plan.first + start, plan.first + index
            start = None
