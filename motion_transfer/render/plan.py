"""Before any frame is rendered: who is followed, where the window lies, how the frames are cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Protocol

import numpy as np
from jaxtyping import UInt8
from xxhash import xxh3_128_hexdigest

from motion_transfer.drawing.person import (
    Follower,
    People,
    Person,
    find_people,
    isolate,
)
from motion_transfer.drawing.window import Window, plan_window
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import Missing
from motion_transfer.media.iuv.stream import IuvReader, IuvStream

CHUNK_FRAMES = 48
"""Cut points are multiples of this, whatever the number of workers: they decide the bytes."""

SCAN_FRAMES = 16  # a thread reads at a time: seeking in a video costs the decoding of several
LISTED_STRETCHES = 10


Find = Callable[[UInt8[np.ndarray, "H W 3"]], People]


class FrameReader(Protocol):
    """What is asked of a driver while it is rendered; an `IuvReader` is one."""

    @property
    def stream(self) -> IuvStream: ...

    def read(self, start: int, stop: int) -> Iterator[np.ndarray]:
        """Frames start..stop-1, H x W x 3 uint8, (I, U, V)."""
        ...


def digest_of_iuv(iuv: UInt8[np.ndarray, "H W 3"]) -> str:
    """Compute a digest of a frame, hexadecimal.

    It tells changes by accident, which take no cryptography.
    """
    return xxh3_128_hexdigest(np.ascontiguousarray(iuv).data)


@dataclass(frozen=True)
class FramePlan:
    """Who is rendered in one frame: nobody (None), or a person, alone in it or to be isolated.

    Attributes:
        digest: Of the IUV of the frame that is shown, everybody in it included; hexadecimal.
        held: The driver's frame that is shown because nobody was found in this one; else None.
    """

    person: Person | None
    alone: bool
    digest: str = ""
    held: int | None = None

    def isolate(self, iuv: UInt8[np.ndarray, "H W 3"]) -> UInt8[np.ndarray, "H W 3"]:
        """Leave nobody but the person in the IUV of the frame that is shown."""
        if self.alone:
            return iuv
        return np.zeros_like(iuv) if self.person is None else isolate(iuv, self.person)


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
        first: The driver's frame that becomes output frame 0.
        frames: One entry for each output frame.
        shots: One after the other, they cover the frames.
    """

    first: int
    frames: tuple[FramePlan, ...]
    shots: tuple[Shot, ...]
    frame_rate: Fraction

    def shots_in(self, chunk: Chunk) -> Iterator[Shot]:
        """List the pieces of shots that a chunk shows."""
        for shot in self.shots:
            start, stop = max(shot.start, chunk.start), min(shot.stop, chunk.stop)
            if start < stop:
                yield Shot(start, stop, shot.window)

    @property
    def largest_side(self) -> int:
        """The largest window's side, px."""
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
        """List half-open ranges of driver frames in which the person was not found."""
        return missing_stretches(self.frames, self.first)


def scan_people(
    reader: IuvReader,
    frames: range,
    workers: int,
    done: Callable[[int], None],
    *,
    find: Find = find_people,
    elsewhere: Callable[[range], list[SeenFrame] | None] = lambda _block: None,
) -> list[SeenFrame]:
    """Find everybody in each frame, decoded in parallel; only boxes and digests are kept.

    Args:
        workers: Threads.
        find: Finds the people of a frame.
        elsewhere: Has a stretch looked through by somebody else; None if nobody is there.
    """

    def scan(start: int) -> list[SeenFrame]:
        block = range(start, min(start + SCAN_FRAMES, frames.stop))
        found = elsewhere(block)
        if found is None:
            found = look_through(reader, block, find)
        done(len(found))
        return found

    starts = range(frames.start, frames.stop, SCAN_FRAMES)
    with ThreadPoolExecutor(workers) as pool:
        try:
            return [seen for block in pool.map(scan, starts) for seen in block]
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def look_through(reader: IuvReader, frames: range, find: Find) -> list[SeenFrame]:
    """Look once at each frame of a stretch. Raises: IuvFileError naming the broken frame."""
    return [
        SeenFrame(find(iuv), digest_of_iuv(iuv)) for iuv in reader.read(frames.start, frames.stop)
    ]


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
    path = _follow(people, [start for start, _ in ranges], person, where_found)
    plans = tuple(
        FramePlan(
            who,
            alone=who is not None and frame.people.shows_only(who),
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


def _follow(
    people: Sequence[People], shots: Sequence[int], person: str | None, where: str
) -> list[Person | None]:
    """Follow the chosen person; `shots` are the frames that shots begin with."""
    if person is None:
        return [frame.persons[0] if frame.persons else None for frame in people]
    follower = Follower[Person](person)
    path: list[Person | None] = []
    for index, frame in enumerate(people):
        if index in shots:
            follower.start_shot()
        path += follower.pick(frame.persons, where) or [None]
    return path


def _lay_windows(plans: Sequence[FramePlan], ranges: Sequence[tuple[int, int]]) -> tuple[Shot, ...]:
    """Lay a window for each shot; one without anybody is drawn in its neighbour's."""
    windows = [_window_of(plans[start:stop]) for start, stop in ranges]
    last = next(window for window in windows if window is not None)
    shots = []
    for (start, stop), window in zip(ranges, windows, strict=True):
        last = window or last
        shots.append(Shot(start, stop, last))
    return tuple(shots)


def _window_of(plans: Sequence[FramePlan]) -> Window | None:
    boxes = [plan.person.box for plan in plans if plan.person is not None]
    return plan_window(boxes) if boxes else None


def hold_frames(frames: Sequence[FramePlan], first: int) -> tuple[FramePlan, ...]:
    """Let frames without anybody show the last one with somebody, or the first if none was yet.

    Args:
        first: the driver's frame that `frames[0]` plans. Somebody is in at least one frame.
    """
    index = next(i for i, frame in enumerate(frames) if frame.person is not None)
    held = []
    for number, frame in enumerate(frames):
        if frame.person is not None:
            index = number
        empty = frame.person is None
        held.append(replace(frames[index], held=first + index) if empty else frame)
    return tuple(held)


def missing_stretches(frames: Sequence[FramePlan], first: int) -> list[tuple[int, int]]:
    """List half-open ranges of driver frames in which the person was not found."""
    stretches: list[tuple[int, int]] = []
    for number, frame in enumerate(frames, first):
        if frame.person is not None and frame.held is None:
            continue
        if stretches and stretches[-1][1] == number:
            stretches[-1] = (stretches[-1][0], number + 1)
        else:
            stretches.append((number, number + 1))
    return stretches


def describe_missing(frames: Sequence[FramePlan], first: int, rate: Fraction) -> str:
    """Say in which frames nobody was found and what is shown there; empty if there are none."""
    stretches = missing_stretches(frames, first)
    if not stretches:
        return ""
    count = sum(stop - start for start, stop in stretches)
    held = any(frame.held is not None for frame in frames)
    shown = "the frame before" if held else "background only"
    times = list_stretches(stretches, first, rate)
    return f"nobody found in {count} of {len(frames)} frames, {shown}: {times}"


def list_stretches(stretches: Sequence[tuple[int, int]], first: int, rate: Fraction) -> str:
    """List stretches as times in the output, with the driver's frames; the first ten of them."""
    listed = [
        f"{_clock((start - first) / rate)}-{_clock((stop - first) / rate)} (frames {start}:{stop})"
        for start, stop in stretches[:LISTED_STRETCHES]
    ]
    more = len(stretches) - len(listed)
    return ", ".join(listed) + (f" and {more} more" if more else "")


def _clock(seconds: Fraction) -> str:
    minutes, rest = divmod(float(seconds), 60)
    return f"{int(minutes)}:{rest:05.2f}"
