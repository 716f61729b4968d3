"""Who is shown in a frame, and in which window: by a sample at once, then as a run has it."""

from __future__ import annotations

import time
from bisect import bisect
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.preview.driver_look import DriverLook
from motion_transfer.render.missing import FramePlan
from motion_transfer.render.options import DEFAULT_RATE, RenderOptions
from motion_transfer.render.person import People, Person, follow
from motion_transfer.render.plan import DriverPlan, SeenFrame, Shot, frame_range, plan_path
from motion_transfer.render.prepare import given_window
from motion_transfer.render.window import Window

SAMPLED_FRAMES = 12
SAMPLE_SECONDS = 0.2
"""Whoever opens the page waits for it; a jump within a long video may take a second."""

NOBODY = SeenFrame(People((), 0), "")


@dataclass(frozen=True)
class FramePlans:
    """The plan of a run as far as it is known.

    Attributes:
        chosen: the driver's frames that a run would draw.
        known: by driver frame, who is drawn there; in order.
        shots: by driver frame, and the window of each.
        missing: half-open ranges of driver frames in which the person was not found.
        exact: this is what a run would do; else it goes by a sample of the frames.
    """

    chosen: range
    known: Mapping[int, FramePlan]
    shots: tuple[Shot, ...]
    missing: tuple[tuple[int, int], ...]
    exact: bool

    def window_at(self, index: int) -> Window:
        """The window of a frame; outside the chosen ones that of the nearest shot."""
        starts = [shot.start for shot in self.shots]
        return self.shots[max(0, bisect(starts, index) - 1)].window

    def frame(self, index: int, look: DriverLook) -> tuple[UInt8[np.ndarray, "H W 3"], FramePlan]:
        """The IUV that a frame shows, with only the followed person in it, and the plan for it.

        A frame that is not planned (yet, or because it lies outside the chosen ones) shows whoever
        is most like the person in the nearest one that is. Raises: InputError if it is broken.
        """
        plan = self.known.get(index)
        shown = look.read(index if plan is None or plan.held is None else plan.held)
        if plan is None:
            people = look.people_in(shown)
            person = follow([people], self._nearest_person(index))[0]
            alone = person is not None and len(person.regions) == people.region_count
            plan = FramePlan(person, alone)
        return plan.isolate(shown), plan

    def _nearest_person(self, index: int) -> Person:
        persons = ((number, plan.person) for number, plan in self.known.items())
        near = min(
            ((number, person) for number, person in persons if person is not None),
            key=lambda entry: abs(entry[0] - index),
        )
        return near[1]


def plan_frames(look: DriverLook, options: RenderOptions) -> FramePlans:
    """The plan from what has been looked at. Raises: InputError, as a run would."""
    chosen = frame_range(options.frames, look.frame_count, str(options.driver))
    if look.whole:
        return _plan_exactly(look, options, chosen)
    frames = _look_at_some(look, chosen)
    plan = _plan(look, options, [look.seen[index] for index in frames], range(len(frames)), ())
    known = dict(zip(frames, plan.frames, strict=True))
    return FramePlans(
        chosen,
        {index: entry for index, entry in known.items() if entry.held is None},
        (Shot(chosen.start, chosen.stop, plan.shots[0].window),),
        (),
        exact=False,
    )


def _look_at_some(look: DriverLook, chosen: range) -> list[int]:
    """Frames all over the chosen ones, as many as there is time for; at least one, if one can be
    read."""
    sample = np.linspace(chosen.start, chosen.stop - 1, min(SAMPLED_FRAMES, len(chosen)))
    frames = sorted({int(index) for index in sample.round()})
    end = time.monotonic() + SAMPLE_SECONDS
    # the first, the middle, the quarters, ...
    for place in sorted(range(len(frames)), key=lambda place: f"{place:08b}"[::-1]):
        look.look_at([frames[place]])
        if time.monotonic() > end and not look.seen.keys().isdisjoint(frames):
            break
    return [index for index in frames if index in look.seen]


def _plan_exactly(look: DriverLook, options: RenderOptions, chosen: range) -> FramePlans:
    seen = [look.seen.get(index, NOBODY) for index in chosen]
    cuts = look.pictures.cuts if look.pictures else ()
    plan = _plan(look, options, seen, chosen, cuts)
    first = chosen.start
    shots = tuple(Shot(s.start + first, s.stop + first, s.window) for s in plan.shots)
    known = {
        index: entry
        for index, entry in zip(chosen, plan.frames, strict=True)
        if index not in look.broken
    }
    missing = tuple(
        stretch for stretch in plan.missing if not all(i in look.broken for i in range(*stretch))
    )
    return FramePlans(chosen, known, shots, missing, exact=True)


def _plan(
    look: DriverLook,
    options: RenderOptions,
    seen: list[SeenFrame],
    chosen: range,
    cuts: tuple[int, ...],
) -> DriverPlan:
    if not seen:
        raise InputError(f"{options.driver}: none of the frames looked at can be read")
    return plan_path(
        seen,
        chosen=chosen,
        frame_rate=options.frame_rate or look.frame_rate or DEFAULT_RATE,
        person=None if look.pictures else options.driver_person,
        where=str(options.driver),
        where_first=f"frame {chosen.start} of {options.driver}",
        where_found=str(options.driver),
        # what a run refuses is shown here, with the gaps marked
        missing="hold" if options.missing == "hold" else "background",
        cuts=cuts,
        window=given_window(options),
    )
