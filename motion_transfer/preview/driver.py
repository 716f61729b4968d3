"""A driver that can be shown before it has been looked through, and what a run would draw of it.

At first the plan goes by a sample of the frames; when all are known, it is what a run has.
"""

from __future__ import annotations

import threading
import time
from bisect import bisect
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.person import People, Person, find_again
from motion_transfer.drawing.window import Window
from motion_transfer.errors import InputError
from motion_transfer.option import frame_range
from motion_transfer.preview.queue import ByteCache
from motion_transfer.render.composition import plan_run
from motion_transfer.render.driver import Driver
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.plan import (
    DriverPlan,
    FramePlan,
    SeenFrame,
    Shot,
    digest_of_iuv,
)

BLOCK_FRAMES = 16  # decoded in one go: half a second of playing
CACHED_BYTES = 256 * 2**20
"""How much is kept of decoded frames: to jump into a video is to decode from its last key frame."""

SAMPLED_FRAMES = 12
SAMPLE_SECONDS = 0.2
"""What a first plan goes by: whoever opens the page waits for it, and a jump within a long video
may take a second."""

NOBODY = SeenFrame(People((), 0), "")


@dataclass(eq=False)
class PreviewedDriver:
    """What is known of a driver so far; written by the thread that looks, read by any.

    Attributes:
        opened: The driver itself.
        seen: The frames that were looked at and could be read, by their index.
        broken: Why a frame cannot be read, by its index.
        most_people: How many there are in any frame so far.
    """

    opened: Driver
    seen: dict[int, SeenFrame] = field(default_factory=dict)
    broken: dict[int, str] = field(default_factory=dict)
    most_people: int = 0
    _decoded: ByteCache[np.ndarray] = field(
        default_factory=lambda: ByteCache(CACHED_BYTES, lambda frame: frame.nbytes)
    )

    @property
    def frame_count(self) -> int:
        return self.opened.frame_count

    @property
    def whole(self) -> bool:
        """Whether every frame was looked at."""
        return len({*self.seen, *self.broken}) == self.frame_count

    def read(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        """Read one frame's IUV, not to be written to. Raises: InputError naming a broken frame."""
        cached = self._decoded.get(index)
        if cached is not None:
            return cached
        # whoever asks for the next one, plays: decoding then goes on instead of beginning anew
        playing = self._decoded.get(index - 1) is not None
        stop = min(index + (BLOCK_FRAMES if playing else 1), self.frame_count)
        frames = self.opened.reader.read(index, stop)
        try:
            wanted = next(frames)
        except InputError as error:
            self.broken[index] = str(error)
            raise
        self._decoded.put(index, wanted)
        with suppress(InputError):  # whoever asks for those will hear of it
            for number, iuv in enumerate(frames, index + 1):
                self._decoded.put(number, iuv)
        return wanted

    def see(self, frames: Iterable[int]) -> None:
        """Look at single frames; broken ones are noted."""
        for index in frames:
            if index in self.seen or index in self.broken:
                continue
            with suppress(InputError):
                self._note(index, self.read(index))

    def see_all(self, stop: threading.Event, done: Callable[[int], object]) -> None:
        """Look at every frame in order, until it is done or `stop` is set.

        Args:
            done: Called as frames were looked at, with their number.
        Raises: InputError if the driver has changed meanwhile.
        """
        for start in range(0, self.frame_count, BLOCK_FRAMES):
            block = range(start, min(start + BLOCK_FRAMES, self.frame_count))
            if stop.is_set():
                return
            try:
                frames = self.opened.reader.read(block.start, block.stop)
                for index, iuv in enumerate(frames, start):
                    self._note(index, iuv)
            except InputError:  # one of them: the others can be read one by one
                self.see(block)
            done(len(block))
        self.opened.inputs.check()

    def _note(self, index: int, iuv: UInt8[np.ndarray, "H W 3"]) -> None:
        people = self.opened.people_in(iuv)
        self.most_people = max(self.most_people, len(people.persons))
        self._decoded.put(index, iuv)
        self.seen[index] = SeenFrame(people, digest_of_iuv(iuv))


@dataclass(frozen=True)
class FramePlans:
    """The plan of a run as far as it is known.

    Attributes:
        chosen: The driver's frames that a run would draw.
        known: Who is drawn in a frame, by its index in the driver; in order.
        shots: Ranges of driver frames, and the window of each.
        missing: Half-open ranges of driver frames in which the person was not found.
        plan: That of a run, of the driver's frames `planned`, in order.
        exact: Whether this is what a run would do; else it goes by a sample of the frames.
    """

    chosen: range
    known: Mapping[int, FramePlan]
    shots: tuple[Shot, ...]
    missing: tuple[tuple[int, int], ...]
    plan: DriverPlan
    planned: Sequence[int]
    exact: bool

    def place_in_plan(self, index: int) -> int:
        """Find the planned frame that is nearest before a driver's frame, or the first."""
        return max(0, bisect(self.planned, index) - 1)

    @property
    def largest_side(self) -> int:
        """The side of the largest window, px."""
        return max(shot.window.side for shot in self.shots)

    def window_at(self, index: int) -> Window:
        """Find the window of a frame; outside the chosen ones, that of the nearest shot."""
        starts = [shot.start for shot in self.shots]
        return self.shots[max(0, bisect(starts, index) - 1)].window

    def read(self, index: int, driver: PreviewedDriver) -> UInt8[np.ndarray, "H W 3"]:
        """Read the IUV that a frame shows, with only the followed person in it.

        A frame that is not planned (yet, or because it lies outside the chosen ones) shows whoever
        is most like the person in the nearest one that is. Raises: InputError if it is broken.
        """
        plan = self.known.get(index)
        shown = driver.read(index if plan is None or plan.held is None else plan.held)
        if plan is None:
            people = driver.opened.people_in(shown)
            person = find_again(people.persons, self._nearest_person(index))
            plan = FramePlan(person, person is not None and people.shows_only(person))
        return plan.isolate(shown)

    def _nearest_person(self, index: int) -> Person:
        plans = self.known.items()
        persons = {number: plan.person for number, plan in plans if plan.person is not None}
        return persons[min(persons, key=lambda number: abs(number - index))]


def plan_frames(driver: PreviewedDriver, options: RenderOptions) -> FramePlans:
    """Plan a run from what was seen of its driver. Raises: InputError, as a run would."""
    # what a run refuses is shown here, with the gaps marked
    options = replace(options, missing="hold" if options.missing == "hold" else "background")
    chosen = frame_range(options.frames, driver.frame_count, str(options.driver))
    if driver.whole:
        return _plan_exactly(driver, options, chosen)
    frames = _see_some(driver, chosen)
    if not frames:
        raise InputError(f"{options.driver}: none of the frames looked at can be read")
    scan = driver.opened.scan_of(chosen, [driver.seen[index] for index in frames])
    pictures = scan.pictures and replace(scan.pictures, cuts=())  # a sample is one shot
    plan = plan_run(options, replace(scan, chosen=range(len(frames)), pictures=pictures))
    known = dict(zip(frames, plan.frames, strict=True))
    return FramePlans(
        chosen,
        {index: entry for index, entry in known.items() if entry.held is None},
        (Shot(chosen.start, chosen.stop, plan.shots[0].window),),
        (),
        plan,
        frames,
        exact=False,
    )


def _see_some(driver: PreviewedDriver, chosen: range) -> list[int]:
    """Look at frames all over the chosen ones, as many as there is time for; list what was seen."""
    sample = np.linspace(chosen.start, chosen.stop - 1, min(SAMPLED_FRAMES, len(chosen)))
    frames = sorted({int(index) for index in sample.round()})
    end = time.monotonic() + SAMPLE_SECONDS
    # the first, the middle, the quarters, ...: the order of a number's digits read backwards
    for place in sorted(range(len(frames)), key=lambda place: f"{place:08b}"[::-1]):
        driver.see([frames[place]])
        if time.monotonic() > end and not driver.seen.keys().isdisjoint(frames):
            break
    return [index for index in frames if index in driver.seen]


def _plan_exactly(driver: PreviewedDriver, options: RenderOptions, chosen: range) -> FramePlans:
    seen = [driver.seen.get(index, NOBODY) for index in chosen]  # broken frames show nobody
    plan = plan_run(options, driver.opened.scan_of(chosen, seen))
    first = chosen.start
    shots = tuple(Shot(s.start + first, s.stop + first, s.window) for s in plan.shots)
    known = {
        index: entry
        for index, entry in zip(chosen, plan.frames, strict=True)
        if index not in driver.broken
    }
    missing = tuple(
        stretch for stretch in plan.missing if not all(i in driver.broken for i in range(*stretch))
    )
    return FramePlans(chosen, known, shots, missing, plan, chosen, exact=True)
