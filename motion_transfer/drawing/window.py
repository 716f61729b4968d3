"""The crop window: one square around the person, steady for the whole driver."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.person import Box
from nhrr_core import ModelConfig

MARGIN = 0.08  # of the person's longer side, on each side at least: room for hair and clothes
SIDE_STEP, LEAST_SIDE = 8, 32
"""Windows have a side of a multiple of the first, px, which networks can draw without scaling it;
a larger step would have them draw more background."""

DRAWN_UNSCALED = (0.75, 2.5)
"""Windows of so many times its image size are drawn by a network without scaling them."""

TRAINED_UNSCALED = (0.75, 1.25)
"""It learns from those: up to here, the person of a window fits into an image."""

BEYOND_THE_PHOTO = (255, 255, 255)  # as the renderer's default background


@dataclass(frozen=True)
class Window:
    """A square in a frame, px; it may reach beyond the frame's edges."""

    x: int
    y: int
    side: int

    def visible(self, height: int, width: int) -> tuple[slice, slice, slice, slice]:
        """Tell the frame's rows and columns that lie in the window, then the window's own."""
        top, left = max(self.y, 0), max(self.x, 0)
        bottom, right = min(self.y + self.side, height), min(self.x + self.side, width)
        return (
            slice(top, bottom),
            slice(left, right),
            slice(top - self.y, bottom - self.y),
            slice(left - self.x, right - self.x),
        )

    def cut(self, iuv: UInt8[np.ndarray, "H W 3"], size: int) -> UInt8[np.ndarray, "S S 3"]:
        """Cut out the window at size x size px; nearest pixel, as parts cannot be averaged."""
        rows, columns, own_rows, own_columns = self.visible(*iuv.shape[:2])
        if (rows.stop - rows.start, columns.stop - columns.start) == (self.side, self.side):
            square = iuv[rows, columns]
        else:
            square = np.zeros((self.side, self.side, 3), np.uint8)
            square[own_rows, own_columns] = iuv[rows, columns]
        if size == self.side:
            return square
        return cv2.resize(square, (size, size), interpolation=cv2.INTER_NEAREST_EXACT)


def cut_picture(
    window: Window, picture: np.ndarray, size: int, fill: Sequence[int] | int
) -> UInt8[np.ndarray, "*shape"]:
    """Cut the window's content of a photo or alpha, at size x size.

    Args:
        fill: What is seen beyond the photo's edges.
    """
    rows, columns, own_rows, own_columns = window.visible(*picture.shape[:2])
    square = np.empty((window.side, window.side, *picture.shape[2:]), np.uint8)
    square[:] = fill
    square[own_rows, own_columns] = picture[rows, columns]
    if size == window.side:
        return square
    # for colours and alpha; IUV cannot be averaged, `Window.cut` is for that
    kind = cv2.INTER_AREA if size < window.side else cv2.INTER_CUBIC
    return cv2.resize(square, (size, size), interpolation=kind)


def plan_window(boxes: Iterable[Box | None]) -> Window:
    """Lay the smallest square, with a margin, that holds a person in every frame.

    Args:
        boxes: Of the person in each frame, None where nobody is; somebody is in one at least.
    """
    seen = [box for box in boxes if box is not None]
    left, top = min(box.left for box in seen), min(box.top for box in seen)
    right, bottom = max(box.right for box in seen), max(box.bottom for box in seen)
    longer = max(right - left, bottom - top)
    side = math.ceil(longer * (1 + 2 * MARGIN) / SIDE_STEP) * SIDE_STEP
    side = max(side, LEAST_SIDE)
    return Window(x=(left + right - side) // 2, y=(top + bottom - side) // 2, side=side)


def drawn_side(side: int, config: ModelConfig) -> int:
    """Decide the side, px, of the picture that a network makes of a window of some side, px.

    Small windows are enlarged to its image size, and very large ones shrunk to twice that; those
    between are drawn pixel for pixel, as scaling blurs pictures and tears IUV. Measured with `lite`
    (256): on 48 held-out pairs with windows of 226 to 292, perceptual distance 0.246, not 0.259; on
    photos with windows of about 544, from themselves, 0.50 on the person, not 0.57; and over a walk
    half the flicker.
    """
    size = config.image_size
    least, most = DRAWN_UNSCALED
    fits = side % SIDE_STEP == 0 and side % 2**config.down_blocks == 0
    if fits and least * size <= side <= most * size:
        return side
    return size if side <= TRAINED_UNSCALED[1] * size else 2 * size
