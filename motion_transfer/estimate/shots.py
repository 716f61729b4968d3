"""Where one shot ends and the next begins.

A cut changes both where the colours are (a small picture) and which there are (a histogram), more
than the frames before it do, and for good: a flash is over after two frames. Dissolves and fades
are not found.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

SMALL = (32, 18)
"""Columns and rows at which frames are compared: neither noise nor small motion is seen there."""

BINS = 8
"""Of the histogram, for each of R, G and B."""

LEAST_CHANGE = 10.0
"""Of 255, mean over the small picture: less is a play of light."""

LEAST_RECOLOURING = 0.25
"""Share of the pixels that took a colour that was not there. Measured: between photos of different
places 0.4 and more; in pans of an eighth of the width a frame 0.12 at most."""

ABOVE_USUAL = 3.0
"""Times the mean recolouring of the frames before: in a wild motion every frame changes much."""

USUAL_FRAMES = 8
LONGEST_FLASH = 2

Frame = UInt8[np.ndarray, "H W 3"]


@dataclass(frozen=True)
class _Look:
    """A frame as it is compared."""

    small: Float32[np.ndarray, "h w 3"]
    histogram: Float32[np.ndarray, " bins"]

    @classmethod
    def of(cls, frame: Frame) -> _Look:
        small = cv2.resize(frame, SMALL, interpolation=cv2.INTER_AREA)
        codes = (small.astype(np.int32) * BINS // 256) @ np.array([BINS * BINS, BINS, 1])
        counts = np.bincount(codes.reshape(-1), minlength=BINS**3).astype(np.float32)
        # neighbouring bins share: a little more light is no other colour
        cube = cv2.blur(counts.reshape(BINS, BINS, BINS), (3, 3), borderType=cv2.BORDER_CONSTANT)
        return cls(small.astype(np.float32), (cube / max(cube.sum(), 1e-6)).reshape(-1))

    def change(self, other: _Look) -> float:
        return float(np.abs(self.small - other.small).mean())

    def recolouring(self, other: _Look) -> float:
        return float(np.abs(self.histogram - other.histogram).sum() / 2)


def mark_shots(frames: Iterable[Frame]) -> Iterator[tuple[Frame, bool]]:
    """Each frame, and whether it begins a shot; the first one does. Looks two frames ahead."""
    before: _Look | None = None
    usual: deque[float] = deque(maxlen=USUAL_FRAMES)
    for frame, look, later in _with_later(frames):
        if before is None:
            yield frame, True
            before = look
            continue
        differs = _is_cut(look, before, usual)
        begins = differs and all(_is_cut(other, before, usual) for other in later)
        yield frame, begins
        if begins:
            usual.clear()
        elif differs:
            continue  # a flash: what follows is compared with the frame before it
        else:
            usual.append(look.recolouring(before))
        before = look


def _is_cut(look: _Look, before: _Look, usual: Sequence[float]) -> bool:
    limit = max(LEAST_RECOLOURING, ABOVE_USUAL * sum(usual) / max(1, len(usual)))
    return look.change(before) > LEAST_CHANGE and look.recolouring(before) > limit


def _with_later(frames: Iterable[Frame]) -> Iterator[tuple[Frame, _Look, list[_Look]]]:
    """Each frame with its look and the looks of the frames after it, as many as a flash has."""
    waiting: deque[tuple[Frame, _Look]] = deque()
    for frame in frames:
        waiting.append((frame, _Look.of(frame)))
        if len(waiting) > LONGEST_FLASH:
            first = waiting.popleft()
            yield *first, [look for _, look in waiting]
    while waiting:
        first = waiting.popleft()
        yield *first, [look for _, look in waiting]
