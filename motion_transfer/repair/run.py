"""A repair from options to a finished file, and how much the sequence flickers before and after.

Flicker is two numbers that motion hardly touches.

Over every three consecutive frames a, b, c that show somebody:

- *part flicker*: of the pixels where any of the three shows somebody, the share whose part is one
  in a and in c, and another in b. A moving edge is one part before and another after, and does not
  count; only what comes and goes within a frame does.
- *UV flicker*: over the pixels with one part in all three, the mean of |b - (a + c) / 2| in U and
  V, in levels of 255. Where U and V change steadily it is 0.

A limb that is thinner than its way in a frame counts as well: compare numbers of the same motion.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import get_args

import cv2
import numpy as np

from motion_transfer.drawing.person import bounding_box
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.blends import look_for_blends, mend_blends
from motion_transfer.media.iuv.convert import ConvertOptions, open_source
from motion_transfer.media.iuv.writing import write_iuv
from motion_transfer.media.nearest import take_nearest
from motion_transfer.repair.gaps import FillGaps, Frame, fill_gaps
from motion_transfer.repair.smoothing import smooth


@dataclass(frozen=True)
class Flicker:
    """The measure of one sequence.

    Attributes:
        parts: The share of pixels, 0..1; 0 where no three frames follow.
        uv: The mean, in levels of 255; 0 likewise.
        empty_frames: How many show nobody, of frame_count.
    """

    parts: float
    uv: float
    empty_frames: int
    frame_count: int


class FlickerMeter:
    """Watches frames go by, and keeps three of them."""

    def __init__(self) -> None:
        self._last: deque[Frame] = deque(maxlen=3)
        self._blinking = self._occupied = self._steady = 0
        self._uv = 0.0
        self._empty = self._count = 0

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Pass frames on unchanged, each measured."""
        for frame in frames:
            self.add(frame)
            yield frame

    def add(self, frame: Frame) -> None:
        """Take the next frame into account."""
        self._count += 1
        if not frame[..., 0].any():
            self._empty += 1  # and motion is not followed across it
            self._last.clear()
            return
        self._last.append(frame)
        if len(self._last) < 3:
            return
        a, b, c = self._last
        box = bounding_box(a | b | c).slices  # where any of them shows somebody
        a, b, c = a[box], b[box], c[box]
        ends_agree = a[..., 0] == c[..., 0]
        self._blinking += int((ends_agree & (b[..., 0] != a[..., 0])).sum())
        self._occupied += int(((a[..., 0] | b[..., 0] | c[..., 0]) > 0).sum())
        steady = ends_agree & (b[..., 0] == a[..., 0]) & (b[..., 0] > 0)
        ends = a[steady][:, 1:].astype(np.int16) + c[steady][:, 1:]
        # twice the difference from the mean, in both of U and V
        self._uv += float(np.abs(2 * b[steady][:, 1:].astype(np.int16) - ends).sum()) / 4
        self._steady += int(steady.sum())

    @property
    def result(self) -> Flicker:
        """The measure of all frames so far."""
        return Flicker(
            parts=self._blinking / max(1, self._occupied),
            uv=self._uv / max(1, self._steady),
            empty_frames=self._empty,
            frame_count=self._count,
        )


@dataclass(frozen=True, kw_only=True)
class RepairOptions(ConvertOptions):
    """What to repair, and how.

    Attributes:
        fill_gaps: How to fill frames without anybody: `hold` or `interpolate`; None: not at all.
        speckle: Regions of one part of fewer pixels are removed; 0: none.
        smooth: Whether to steady part borders and U, V over time.

    IUV that interpolation has blended is mended whatever they say.
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


@dataclass(frozen=True)
class RepairReport:
    """What a repair changed."""

    before: Flicker
    after: Flicker
    notes: tuple[str, ...]


def repair(
    frames: Iterable[Frame], options: RepairOptions, *, blended: bool = False
) -> Iterator[Frame]:
    """Mend blends, remove speckles, then fill gaps, then smooth; a few frames are kept at a time.

    Args:
        blended: Whether there are blends.
    """
    if blended:
        frames = map(mend_blends, frames)
    # speckles first: a frame of nothing else is a gap, and no gap is to be filled with them
    if options.speckle:
        frames = map(partial(remove_speckles, smallest_px=options.speckle), frames)
    if options.fill_gaps:
        frames = fill_gaps(frames, options.fill_gaps)
    return iter(smooth(frames) if options.smooth else frames)


def repair_iuv(options: RepairOptions, done: Callable[[int], object] = int) -> RepairReport:
    """Repair a driver of any length and write it.

    Args:
        done: Called with 1 after each frame.
    Raises: InputError and its kinds, also if there is nothing to repair; nothing half-written
        stays behind.
    """
    source = open_source(options)
    blends = look_for_blends(source.reader, range(source.settings.frame_count))
    notes = list(source.notes)
    if blends.found:
        notes.append(
            f"{options.source} was resized with interpolation, or smoothed: the {blends.share:.0%}"
            " of the body's pixels that have a part found nowhere near take the nearest other pixel"
        )
    elif not (options.fill_gaps or options.speckle or options.smooth):
        raise InputError(
            f"nothing to repair: {options.source} is not blended by interpolation; for more, add"
            " --fill-gaps hold or interpolate, --speckle 20, or --smooth"
        )
    before, after = FlickerMeter(), FlickerMeter()
    repaired = repair(before.watch(source.frames()), options, blended=blends.found)
    write_iuv(after.watch(repaired), options.output, source.settings, done)
    return RepairReport(before.result, after.result, tuple(notes))


def remove_speckles(iuv: Frame, smallest_px: int) -> Frame:
    """Remove connected regions of one part, and holes, of fewer pixels than that.

    Each of their pixels takes (I, U, V) of the nearest pixel outside them, so that no part appears
    that was not next to it. Regions connect over corners.
    """
    part = np.ascontiguousarray(iuv[..., 0])
    speckles = np.zeros(part.shape, bool)
    for index in np.unique(part):
        mask = cv2.inRange(part, int(index), int(index))
        x, y, width, height = cv2.boundingRect(mask)
        box = np.s_[y : y + height, x : x + width]
        _, labels, stats, _ = cv2.connectedComponentsWithStats(mask[box], connectivity=8)
        small = stats[:, cv2.CC_STAT_AREA] < smallest_px
        small[0] = False  # what is not of this part
        speckles[box] |= small[np.asarray(labels, np.int32)]
    return take_nearest(iuv, speckles) if speckles.any() else iuv
