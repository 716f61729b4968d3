"""How much an IUV sequence flickers, in two numbers that motion hardly touches.

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
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

Frame = UInt8[np.ndarray, "H W 3"]


@dataclass(frozen=True)
class Flicker:
    """The measure of one sequence.

    Attributes:
        parts: share of pixels, 0..1. uv: levels of 255. Both 0 where no three frames follow.
        empty_frames: how many show nobody, of frame_count.
    """

    parts: float
    uv: float
    empty_frames: int
    frame_count: int


class FlickerMeter:
    """Watches frames go by; keeps three of them."""

    def __init__(self) -> None:
        self._last: deque[Frame] = deque(maxlen=3)
        self._blinking = self._occupied = self._steady = 0
        self._uv = 0.0
        self._empty = self._count = 0

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames, unchanged and each measured."""
        for frame in frames:
            self.add(frame)
            yield frame

    def add(self, frame: Frame) -> None:
        """Take the next frame into account."""
        self._count += 1
        if not frame[..., 0].any():
            self._empty += 1
            self._last.clear()
            return
        self._last.append(frame)
        if len(self._last) < 3:
            return
        box = _common_box(self._last)
        a, b, c = (frame[box] for frame in self._last)
        ends_agree = a[..., 0] == c[..., 0]
        self._blinking += int((ends_agree & (b[..., 0] != a[..., 0])).sum())
        self._occupied += int(((a[..., 0] | b[..., 0] | c[..., 0]) > 0).sum())
        steady = ends_agree & (b[..., 0] == a[..., 0]) & (b[..., 0] > 0)
        ends = a[steady][:, 1:].astype(np.int16) + c[steady][:, 1:]
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


def _common_box(frames: Iterable[Frame]) -> tuple[slice, slice]:
    """Rows and columns in which any of the frames shows somebody."""
    seen = np.logical_or.reduce([frame[..., 0] > 0 for frame in frames])
    rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
