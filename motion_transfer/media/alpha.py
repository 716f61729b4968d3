"""Alpha and the colours under it: multiplied, divided, extended, laid on white.

Straight colours are as they are, premultiplied ones are multiplied by alpha. Under alpha 0 straight
colours mean nothing, and yet a codec mixes them into their neighbours', which are seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

Colours = UInt8[np.ndarray, "H W 3"]
Alpha = UInt8[np.ndarray, "H W"]
Rgba = UInt8[np.ndarray, "H W 4"]

OPAQUE = 255

ALPHA_MODE = "alpha_mode"
"""The key under which a file's metadata say `straight` or `premultiplied`, and under which FFmpeg
keeps a Matroska track's AlphaMode."""

BESIDE = "1"
"""Matroska's AlphaMode of a track whose alpha is a picture of its own beside each packet."""

LEVELS = 6
"""How often colours are halved to be extended, to cells of 64 px, as large as the largest block
that the codecs here transform at once."""

CELL_PX = 2**LEVELS


@dataclass(frozen=True)
class Picture:
    """A picture, and its opacity where it has one; the colours are straight."""

    rgb: Colours
    alpha: Alpha | None = None

    def on_white(self) -> Colours:
        """Lay the picture on paper: where it is transparent, white shows."""
        return self.rgb if self.alpha is None else lay_on_white(self.rgb, self.alpha)

    def rgba(self) -> Rgba:
        """Put colours and alpha together."""
        return add_alpha(self.rgb, self.alpha)


def premultiply(colours: Colours, alpha: Alpha) -> Colours:
    """Multiply by alpha, rounded to nearest; there are no ties."""
    return cv2.multiply(colours, cv2.merge([alpha] * 3), scale=1 / OPAQUE)


def unpremultiply(colours: Colours, alpha: Alpha) -> Colours:
    """Divide by alpha, rounded to nearest; 0 where alpha is 0."""
    return cv2.divide(colours, cv2.merge([alpha] * 3), scale=OPAQUE)


def lay_on_white(colours: Colours, alpha: Alpha) -> Colours:
    """Lay straight colours on paper: where they are transparent, white shows."""
    return cv2.add(premultiply(colours, alpha), cv2.merge([cv2.bitwise_not(alpha)] * 3))


def split_alpha(rgba: Rgba) -> tuple[Colours, Alpha]:
    """Take colours and alpha apart."""
    return cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB), cv2.extractChannel(rgba, 3)


def add_alpha(colours: Colours, alpha: Alpha | None = None) -> Rgba:
    """Put colours and alpha together; None: all is opaque."""
    rgba = cv2.cvtColor(colours, cv2.COLOR_RGB2RGBA)
    return rgba if alpha is None else cv2.insertChannel(alpha, rgba, 3)


def clear_colours(colours: Colours, alpha: Alpha) -> Colours:
    """Make colours black where alpha is 0: nothing takes less room where nothing is mixed."""
    return cv2.copyTo(colours, alpha)


def extend_colours(colours: Colours, alpha: Alpha) -> Colours:
    """Extend the colours of covered pixels into those under alpha 0, ever smoother.

    Colours are averaged, weighted by alpha, over cells of 2, 4, ... 64 px (push), and from the
    largest cells down each that has no colour of its own takes what lies around it (pull). Cells
    begin at the frame's corner, as those of a codec's colours do.

    Returns: Covered pixels as they are; black if there are none.
    """
    box = cv2.boundingRect(alpha)
    if not box[2] or cv2.countNonZero(alpha) == alpha.size:
        return colours if box[2] else np.zeros_like(colours)
    # whole cells around what is covered, and one more that colours run into
    height, width = alpha.shape
    left, top = (max(0, at // CELL_PX - 1) * CELL_PX for at in box[:2])
    right = (-(-(box[0] + box[2]) // CELL_PX) + 1) * CELL_PX
    bottom = (-(-(box[1] + box[3]) // CELL_PX) + 1) * CELL_PX
    near = np.s_[top : min(bottom, height), left : min(right, width)]
    extended = _fill(colours[near], alpha[near])
    rest = (top, height - near[0].stop, left, width - near[1].stop)
    return cv2.copyMakeBorder(extended, *rest, cv2.BORDER_REPLICATE)


def _fill(colours: Colours, alpha: Alpha) -> Colours:
    """Fill what is not covered by push and pull; the first pixel begins a cell."""
    height, width = alpha.shape
    beyond = (0, -height % CELL_PX, 0, -width % CELL_PX)
    padded = cv2.copyMakeBorder(alpha, *beyond, cv2.BORDER_CONSTANT, value=0)
    weight = padded.astype(np.float32)
    padded = cv2.copyMakeBorder(colours, *beyond, cv2.BORDER_REPLICATE)
    pushed = cv2.multiply(padded, cv2.merge([weight] * 3), dtype=cv2.CV_32F)
    cells: list[tuple[Float32[np.ndarray, "h w 3"], Float32[np.ndarray, "h w"]]] = []
    for _ in range(LEVELS):
        size = pushed.shape[1] // 2, pushed.shape[0] // 2
        pushed = cv2.resize(pushed, size, interpolation=cv2.INTER_AREA)
        weight = cv2.resize(weight, size, interpolation=cv2.INTER_AREA)
        cells.append((pushed, weight))
    pulled = np.empty_like(pushed)
    pulled[:] = pushed.sum((0, 1)) / weight.sum()  # the mean, for cells of the last level
    for pushed, weight in reversed(cells):
        size = weight.shape[1], weight.shape[0]
        pulled = cv2.resize(pulled, size, interpolation=cv2.INTER_LINEAR)
        own = cv2.divide(pushed, cv2.merge([weight] * 3))
        cv2.copyTo(own, (weight > 0).astype(np.uint8), pulled)
    filled = cv2.convertScaleAbs(pulled)  # rounds
    filled = cv2.resize(filled, (0, 0), fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    filled = np.ascontiguousarray(filled[:height, :width])
    return cv2.copyTo(colours, alpha, filled)
