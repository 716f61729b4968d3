"""Frames of a driver in which nobody is found: what is shown there, and where they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from jaxtyping import UInt8

from motion_transfer.render.person import Person, isolate

LISTED_STRETCHES = 10


@dataclass(frozen=True)
class FramePlan:
    """Who is rendered in one frame: nobody (None), or a person, alone in it or to be isolated.

    Attributes:
        digest: of the IUV of the frame that is shown, everybody in it included; hexadecimal.
        held: the driver's frame that is shown because nobody was found in this one; else None.
    """

    person: Person | None
    alone: bool
    digest: str = ""
    held: int | None = None

    def isolate(self, iuv: UInt8[np.ndarray, "H W 3"]) -> UInt8[np.ndarray, "H W 3"]:
        """The IUV of the frame that is shown, with nobody but the person in it."""
        if self.alone:
            return iuv
        return np.zeros_like(iuv) if self.person is None else isolate(iuv, self.person)


def hold_frames(frames: Sequence[FramePlan], first: int) -> tuple[FramePlan, ...]:
    """Each frame without anybody shows the last one with somebody, or the first, if none was yet.

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
    """Half-open ranges of driver frames in which the person was not found."""
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
    """In which frames nobody was found and what is shown there; empty if there are none."""
    stretches = missing_stretches(frames, first)
    if not stretches:
        return ""
    count = sum(stop - start for start, stop in stretches)
    held = any(frame.held is not None for frame in frames)
    shown = "the frame before" if held else "background only"
    times = list_stretches(stretches, first, rate)
    return f"nobody found in {count} of {len(frames)} frames, {shown}: {times}"


def list_stretches(stretches: Sequence[tuple[int, int]], first: int, rate: Fraction) -> str:
    """Stretches as times in the output, with the driver's frames, the first ten of them."""
    listed = [
        f"{_clock((start - first) / rate)}-{_clock((stop - first) / rate)} (frames {start}:{stop})"
        for start, stop in stretches[:LISTED_STRETCHES]
    ]
    more = len(stretches) - len(listed)
    return ", ".join(listed) + (f" and {more} more" if more else "")


def _clock(seconds: Fraction) -> str:
    minutes, rest = divmod(float(seconds), 60)
    return f"{int(minutes)}:{rest:05.2f}"
