"""From the network's logits to an IUV image at the frame's own resolution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int64, UInt8

from motion_transfer.drawing.person import Box

SMOOTHED_OVER = (3, 5, 7)
"""Sides of the squares of logits over which U and V are averaged. Measured: without it they are a
little farther from the truth, and straight stripes have waves of the logits' size."""

FINEST = 768
"""Larger windows are painted at this size, px, and enlarged: memory stays bounded, and 128 x 128
logits hold no finer borders."""


def paint_iuv(
    parts: Float32[np.ndarray, "25 n n"], uv: Float32[np.ndarray, "24 2 n n"], window: Box, box: Box
) -> UInt8[np.ndarray, "h w 3"]:
    """Paint IUV on a box of the frame, from what the network says of one person in a window.

    Parts are decided after enlarging their logits, so that borders are smooth; U and V are
    smoothed and interpolated within each part and never across a border. Where the box reaches
    beyond the window, nobody is.

    Args:
        parts, uv: As in `IuvLogits`.
    """
    painted = np.zeros((box.height, box.width, 3), np.uint8)
    size = min(window.width, FINEST)
    axis = _Axis.over(parts.shape[-1], size)
    likeliest = parts.argmax(0).astype(np.uint8)
    x, y, width, height = cv2.boundingRect(likeliest)
    rows, columns = axis.among(y - 1, height + 1), axis.among(x - 1, width + 1)
    down, across = axis.cut(rows), axis.cut(columns)
    if not (len(down.low) and len(across.low)):
        return painted
    (best,) = _enlarge([parts[0]], down, across)
    which = np.zeros(best.shape, np.uint8)
    places = [np.zeros(best.shape, np.float32) for _ in range(2)]
    top, left = down.low[0], across.low[0]
    likely = _may_win(parts[:, top : down.low[-1] + 2, left : across.low[-1] + 2])
    for part, where in enumerate(likely[1:], 1):
        x, y, width, height = cv2.boundingRect(where)
        here = down.among(top + y, height), across.among(left + x, width)
        planes = (parts[part], *_smooth(uv[part - 1], likeliest == part))
        logit, *own = _enlarge(planes, down.cut(here[0]), across.cut(here[1]))
        wins = logit > best[here]
        np.copyto(best[here], logit, where=wins)
        np.copyto(which[here], np.uint8(part), where=wins)
        for place, value in zip(places, own, strict=True):
            np.copyto(place[here], value, where=wins)
    # rounds, and keeps to 255
    levels = [cv2.convertScaleAbs(place.clip(min=0), alpha=255) for place in places]
    # the nearest painted pixel of each of the box's
    ways = (box.top, box.bottom, window.top, rows), (box.left, box.right, window.left, columns)
    (to_rows, from_rows), (to_columns, from_columns) = (
        _nearest(first, stop, start, size / window.width, span) for first, stop, start, span in ways
    )
    for channel, plane in enumerate((which, *levels)):
        painted[to_rows, to_columns, channel] = plane[from_rows].take(from_columns, axis=1)
    return painted


@dataclass(frozen=True)
class _Axis:
    """Pixels of an enlarged picture along one axis.

    Attributes:
        low: The small picture's pixel whose centre lies before each, or at it; never the last one.
        share: How far it is from there to the next one, 0..1.
    """

    low: Int64[np.ndarray, " N"]
    share: Float32[np.ndarray, " N"]

    @classmethod
    def over(cls, count: int, size: int) -> _Axis:
        """Lay `size` pixels over `count`, clamped at the edges."""
        place = ((np.arange(size) + 0.5) * (count / size) - 0.5).clip(0, count - 1)
        low = np.minimum(place.astype(np.int64), count - 2)
        return cls(low, (place - low).astype(np.float32))

    def among(self, first: int, count: int) -> slice:
        """Find those that lie between `first` and the `count` pixels behind it."""
        start, stop = np.searchsorted(self.low, [first, first + count])
        return slice(int(start), int(stop))

    def cut(self, span: slice) -> _Axis:
        """Take some of the pixels."""
        return _Axis(self.low[span], self.share[span])


def _may_win(logits: Float32[np.ndarray, "25 h w"]) -> UInt8[np.ndarray, "25 h-1 w-1"]:
    """Tell between which four pixels each part may have the highest logit: a bilinear sample lies
    between the lowest and the highest of them, and must not be below another part's lowest."""
    corners = [logits[:, y : y - 1 or None, x : x - 1 or None] for y in (0, 1) for x in (0, 1)]
    surely = np.minimum.reduce(corners).max(0)
    return (np.maximum.reduce(corners) >= surely).view(np.uint8)


def _smooth(
    uv: Float32[np.ndarray, "2 n n"], own: Bool[np.ndarray, "n n"]
) -> Float32[np.ndarray, "2 n n"]:
    """Average a part's U and V over the largest square around each logit that is all its own."""
    smoothed = uv.copy()
    for side in SMOOTHED_OVER:
        square = np.ones((side, side), np.uint8)
        inner = cv2.erode(own.view(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=0)
        if not inner.any():
            break
        for plane, given in zip(smoothed, uv, strict=True):
            np.copyto(plane, cv2.blur(given, (side, side)), where=inner > 0)
    return smoothed


def _enlarge(
    planes: Sequence[Float32[np.ndarray, "n n"]], down: _Axis, across: _Axis
) -> Float32[np.ndarray, "K H W"]:
    """Sample small pictures bilinearly at the pixels of two axes."""
    if not (len(down.low) and len(across.low)):
        return np.zeros((len(planes), len(down.low), len(across.low)), np.float32)
    top, end = down.low[0], down.low[-1] + 2
    near = np.stack([plane[top:end] for plane in planes])
    wide = _between(near, across.low, across.share, 2)
    return _between(wide, down.low - top, down.share[:, None], 1)


def _between(
    values: Float32[np.ndarray, "K h w"], low: Int64[np.ndarray, " N"], share: np.ndarray, axis: int
) -> Float32[np.ndarray, "K H W"]:
    first = values.take(low, axis)
    change = values.take(low + 1, axis)
    change -= first
    change *= share
    return np.add(first, change, out=change)


def _nearest(
    first: int, stop: int, start: int, scale: float, span: slice
) -> tuple[slice, Int64[np.ndarray, " N"]]:
    """Tell which of the pixels `first` to `stop` of a frame lie in a span of a picture that begins
    at `start`, a frame's pixel being `scale` of its; and where in the span."""
    place = np.floor((np.arange(first, stop) + 0.5 - start) * scale).astype(np.int64) - span.start
    begins, ends = np.searchsorted(place, [0, span.stop - span.start])
    return slice(int(begins), int(ends)), place[begins:ends]
