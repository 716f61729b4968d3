"""A repair from options to a finished file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import get_args

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_convert import ConvertOptions, open_source
from motion_transfer.media.iuv_writing import write_iuv
from motion_transfer.repair.flicker import Flicker, FlickerMeter
from motion_transfer.repair.gaps import FillGaps, fill_gaps
from motion_transfer.repair.smoothing import smooth
from motion_transfer.repair.speckles import remove_speckles

Frame = UInt8[np.ndarray, "H W 3"]


@dataclass(frozen=True, kw_only=True)
class RepairOptions(ConvertOptions):
    """What to repair, and how.

    Attributes:
        fill_gaps: fill frames without anybody: `hold` or `interpolate`; None: leave them.
        speckle: remove regions of one part smaller than that many pixels; 0: none.
        smooth: steady part borders and U, V over time.
    """

    fill_gaps: FillGaps | None = None
    speckle: int = 0
    smooth: bool = False

    def __post_init__(self) -> None:
        if self.fill_gaps not in (None, *get_args(FillGaps)):
            raise InputError(
                f"fill-gaps {self.fill_gaps!r}; supported are {', '.join(get_args(FillGaps))}"
            )
        if self.speckle < 0:
            raise InputError(f"speckle {self.speckle}; it is a number of pixels, 0 or more")
        if not (self.fill_gaps or self.speckle or self.smooth):
            raise InputError(
                "nothing to repair: add --fill-gaps hold or interpolate, --speckle 20, or --smooth"
            )


@dataclass(frozen=True)
class RepairReport:
    """What a repair changed."""

    before: Flicker
    after: Flicker
    notes: tuple[str, ...]


def repair(frames: Iterable[Frame], options: RepairOptions) -> Iterator[Frame]:
    """The frames, repaired: speckles, then gaps, then smoothing. A few are kept at a time."""
    if options.speckle:
        frames = map(partial(remove_speckles, smallest_px=options.speckle), frames)
    if options.fill_gaps:
        frames = fill_gaps(frames, options.fill_gaps)
    return iter(smooth(frames) if options.smooth else frames)


def repair_iuv(options: RepairOptions, done: Callable[[int], object] = int) -> RepairReport:
    """Repair a driver of any length and write it.

    Args:
        done: called with 1 after each frame.
    Raises: InputError and its kinds; nothing half-written stays behind.
    """
    reader, settings, notes = open_source(options)
    before, after = FlickerMeter(), FlickerMeter()
    frames = before.watch(reader.read(0, settings.frame_count))
    write_iuv(after.watch(repair(frames, options)), options.output, settings, done)
    return RepairReport(before.result, after.result, tuple(notes))
