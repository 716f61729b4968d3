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

SMALL = (32, 18)  # columns and rows compared: neither noise nor small motion is seen there
BINS = 8  # of the histogram, for each of R, G and B
LEAST_CHANGE = 10.0  # of 255, mean over the small picture; less is a play of light
ABOVE_USUAL = 3.0  # times the mean recolouring before: in a wild motion every frame changes much
USUAL_FRAMES = 8  # that the mean is taken over
LONGEST_FLASH = 2  # frames

LEAST_RECOLOURING = 0.25
"""Share of the pixels that took a colour that was not there. Measured: between photos of different
places 0.4 and more; in pans of an eighth of the width a frame 0.12 at most."""

Frame = UInt8[np.ndarray, "H W 3"]


def mark_shots(frames: Iterable[Frame]) -> Iterator[tuple[Frame, bool]]:
    """Tell with each frame whether it begins a shot; the first one does. Looks two frames ahead."""
    before: _Signature | None = None
    usual: deque[float] = deque(maxlen=USUAL_FRAMES)
    for frame, signature, later in _with_later(frames):
        if before is None:
            yield frame, True
            before = signature
            continue
        differs = _is_cut(signature, before, usual)
        begins = differs and all(_is_cut(other, before, usual) for other in later)
        yield frame, begins
        if begins:
            usual.clear()
        elif differs:
            continue  # a flash: what follows is compared with the frame before it
        else:
            usual.append(signature.recolouring(before))
        before = signature


@dataclass(frozen=True)
class _Signature:
    """A frame as it is compared."""

    small: Float32[np.ndarray, "h w 3"]
    histogram: Float32[np.ndarray, " bins"]

    @classmethod
    def of(cls, frame: Frame) -> _Signature:
        small = cv2.resize(frame, SMALL, interpolation=cv2.INTER_AREA)
        codes = (small.astype(np.int32) * BINS // 256) @ np.array([BINS * BINS, BINS, 1])
        counts = np.bincount(codes.reshape(-1), minlength=BINS**3).astype(np.float32)
        # neighbouring bins share: a little more light is no other colour
        cube = cv2.blur(counts.reshape(BINS, BINS, BINS), (3, 3), borderType=cv2.BORDER_CONSTANT)
        return cls(small.astype(np.float32), (cube / max(cube.sum(), 1e-6)).reshape(-1))

    def change(self, other: _Signature) -> float:
        return float(np.abs(self.small - other.small).mean())

    def recolouring(self, other: _Signature) -> float:
        return float(np.abs(self.histogram - other.histogram).sum() / 2)


def _is_cut(signature: _Signature, before: _Signature, usual: Sequence[float]) -> bool:
    limit = max(LEAST_RECOLOURING, ABOVE_USUAL * sum(usual) / max(1, len(usual)))
    return signature.change(before) > LEAST_CHANGE and signature.recolouring(before) > limit


def _with_later(frames: Iterable[Frame]) -> Iterator[tuple[Frame, _Signature, list[_Signature]]]:
    """Yield each frame, its signature, and those of as many frames after it as a flash has."""
    waiting: deque[tuple[Frame, _Signature]] = deque()
    for frame in frames:
        waiting.append((frame, _Signature.of(frame)))
        if len(waiting) > LONGEST_FLASH:
            first = waiting.popleft()
            yield *first, [signature for _, signature in waiting]
    while waiting:
        first = waiting.popleft()
        yield *first, [signature for _, signature in waiting]
