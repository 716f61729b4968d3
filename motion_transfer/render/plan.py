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
from motion_transfer.media.iuv_stream import IuvReader, Missing
from motion_transfer.media.stream import IuvStream
from motion_transfer.render.missing import (
    FramePlan,
    hold_frames,
    list_stretches,
    missing_stretches,
)
from motion_transfer.render.person import People, choose_person, find_people, follow
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
    where_found: str,
    missing: Missing | None = None,
) -> DriverPlan:
    """Follow the chosen person through the driver and lay the window around the whole path.

    Args:
        chosen: the driver's frames that were seen.
        where, where_first, where_found: the driver, the first of those frames, and the first of
            them with somebody, for messages.
        missing: what becomes of frames in which the person is not found: `fail`, `hold` (the frame
            before is repeated; at the start, the first one with somebody) or `background`; None:
            `background`, but somebody has to be in the first frame.
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
    first = choose_person(people[inhabited], person, where_found)
    path = [None] * inhabited + follow(people[inhabited:], first)
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
    return DriverPlan(chosen.start, plans, plan_window(path), frame_rate)
