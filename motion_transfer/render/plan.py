"""Before any frame is rendered: who is followed, where the window lies, how the frames are cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Protocol

import numpy as np
from jaxtyping import UInt8
from xxhash import xxh3_128_hexdigest

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_stream import IuvReader, Missing
from motion_transfer.media.stream import IuvStream
from motion_transfer.render.missing import (
    FramePlan,
    hold_frames,
    list_stretches,
    missing_stretches,
)
from motion_transfer.render.person import (
    People,
    Person,
    choose_person,
    find_people,
    follow,
    take_as_one,
)
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
    """Of a frame's content, hexadecimal: tells changes by accident, which take no cryptography."""
    return xxh3_128_hexdigest(np.ascontiguousarray(iuv).data)


@dataclass(frozen=True)
class Chunk:
    """A half-open range of output frames, encoded as one segment."""

    index: int
    start: int
    stop: int


@dataclass(frozen=True)
class SeenFrame:
    """What one look at a driver's frame tells: who is in it, and a digest of its IUV."""

    people: People
    digest: str


@dataclass(frozen=True)
class Shot:
    """A half-open range of output frames, and the crop window that is steady in it."""

    start: int
    stop: int
    window: Window


@dataclass(frozen=True)
class DriverPlan:
    """What the engine needs to know of a driver.

    Attributes:
        first: the driver's frame that becomes output frame 0.
        frames: one entry for each output frame.
        shots: one after the other, they cover the frames.
    """

    first: int
    frames: tuple[FramePlan, ...]
    shots: tuple[Shot, ...]
    frame_rate: Fraction

    def shots_in(self, chunk: Chunk) -> Iterator[Shot]:
        """The pieces of shots that a chunk shows."""
        for shot in self.shots:
            start, stop = max(shot.start, chunk.start), min(shot.stop, chunk.stop)
            if start < stop:
                yield Shot(start, stop, shot.window)

    @property
    def largest_side(self) -> int:
        """Of the windows, px."""
        return max(shot.window.side for shot in self.shots)

    @property
    def chunks(self) -> list[Chunk]:
        starts = range(0, len(self.frames), CHUNK_FRAMES)
        return [
            Chunk(index, start, min(start + CHUNK_FRAMES, len(self.frames)))
            for index, start in enumerate(starts)
        ]

    @property
    def missing(self) -> list[tuple[int, int]]:
        """Half-open ranges of driver frames in which the person was not found."""
        return missing_stretches(self.frames, self.first)


def frame_range(frames: tuple[int | None, int | None], count: int, where: str) -> range:
    """The driver's frames that a run uses. Raises: InputError if it has none of them."""
    start, stop = frames[0] or 0, count if frames[1] is None else frames[1]
    if not 0 <= start < stop <= count:
        raise InputError(
            f"frames {start}:{stop} asked for, but {where} has {count}: 0:{count} at most"
        )
    return range(start, stop)


def scan_people(
    reader: IuvReader,
    frames: range,
    workers: int,
    done: Callable[[int], None],
    *,
    one_person: bool = False,
) -> list[SeenFrame]:
    """Everybody in each frame, decoded in parallel; nothing but boxes and digests is kept.

    Args:
        one_person: whatever is in a frame belongs to one person, as whoever made it says.
    """
    find = take_as_one if one_person else find_people

    def scan(start: int) -> list[SeenFrame]:
        block = range(start, min(start + SCAN_FRAMES, frames.stop))
        found = [
            SeenFrame(find(iuv), digest_of_iuv(iuv)) for iuv in reader.read(block.start, block.stop)
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
    person: str | None,
    where: str,
    where_first: str,
    where_found: str,
    missing: Missing | None = None,
    cuts: Sequence[int] = (),
    window: Window | None = None,
) -> DriverPlan:
    """Follow the chosen person through the driver and lay a window around the path in each shot.

    Args:
        chosen: the driver's frames that were seen.
        person: whom to follow, see `choose_person`; None: whoever is there is the one.
        where, where_first, where_found: the driver, the first of those frames, and the first of
            them with somebody, for messages.
        missing: what becomes of frames in which the person is not found: `fail`, `hold` (the frame
            before is repeated; at the start, the first one with somebody) or `background`; None:
            `background`, but somebody has to be in the first frame.
        cuts: the driver's frames with which shots begin, in order. In a later shot the person is
            chosen anew; whom the choice does not find there, the largest replaces.
        window: of every shot; None: one around the path in each.
    Raises: InputError if nobody is in any frame, or in one where `missing` asks for somebody.
    """
    people = [frame.people for frame in seen]
    inhabited = next((i for i, found in enumerate(people) if found.persons), None)
    if inhabited is None:
        raise InputError(f"{where}: no person in any of the frames {chosen.start}:{chosen.stop}")
    if inhabited > 0 and missing is None:
        raise InputError(
            f"{where_first}: no person in the first frame; start with"
            f" --frames {chosen.start + inhabited}:{chosen.stop}, or add --missing hold or"
            " --missing background"
        )
    ends = [0, *(cut - chosen.start for cut in cuts if chosen.start < cut < chosen.stop)]
    ranges = list(pairwise([*ends, len(people)]))
    path: list[Person | None] = []
    for start, stop in ranges:
        path += _path_in_shot(people[start:stop], person, where_found, strict=not any(path))
    plans = tuple(
        FramePlan(
            who,
            alone=who is not None and len(who.regions) == frame.people.region_count,
            digest=frame.digest,
        )
        for who, frame in zip(path, seen, strict=True)
    )
    stretches = missing_stretches(plans, chosen.start)
    if missing == "fail" and stretches:
        raise InputError(
            f"{where}: nobody at {list_stretches(stretches, chosen.start, frame_rate)}; choose"
            " other --frames, or add --missing hold or --missing background"
        )
    if missing == "hold":
        plans = hold_frames(plans, chosen.start)
    if window is not None:
        shots = tuple(Shot(start, stop, window) for start, stop in ranges)
    else:
        shots = _lay_windows(plans, ranges)
    return DriverPlan(chosen.start, plans, shots, frame_rate)


def _path_in_shot(
    people: Sequence[People], person: str | None, where: str, *, strict: bool
) -> list[Person | None]:
    """The chosen person in every frame of a shot; `strict`: nobody else will do."""
    if person is None:
        return [frame.persons[0] if frame.persons else None for frame in people]
    found = next((i for i, frame in enumerate(people) if frame.persons), None)
    if found is None:
        return [None] * len(people)
    try:
        first = choose_person(people[found], person, where)
    except InputError:
        if strict:
            raise
        first = people[found].persons[0]
    return [None] * found + follow(people[found:], first)


def _lay_windows(plans: Sequence[FramePlan], ranges: Sequence[tuple[int, int]]) -> tuple[Shot, ...]:
    """A window for each shot; one without anybody is drawn in its neighbour's."""
    windows = [
        plan_window(path) if any(path := [plan.person for plan in plans[start:stop]]) else None
        for start, stop in ranges
    ]
    last = next(window for window in windows if window is not None)
    shots = []
    for (start, stop), window in zip(ranges, windows, strict=True):
        last = window or last
        shots.append(Shot(start, stop, last))
    return tuple(shots)
