"""IUV that was resized, or otherwise drawn, as if it were a photo: found, and mended.

Interpolation makes of two pixels one in between. Between part 2 and part 16 that is part 9, a leg
in the middle of a shirt, at a place that U and V invent; between a part and the background it is
every part below. Such rims run along all borders of parts, as wide as one pixel of the original.

- A pixel is *supported* if its part is solid, which is a block of 2 x 2 px, at most 2 px away.
- An unsupported pixel is a *blend* if I, U and V lie on one straight line between two opposite
  pixels around it. In sound IUV a thin finger is unsupported as well, but U and V start anew at
  each border of a part, so that all three hardly ever fit.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from motion_transfer.media.iuv.stream import IuvReader
from motion_transfer.media.nearest import take_nearest

REACH_PX = 2  # how far a solid block of the part may be, and how far the ends of a blend are
BLEND_LEVELS = 8  # of 255: U and V change within a part, too, so that no line is quite straight

BLENDED_SHARE = 0.04
"""Blends among the body's pixels that lie at a border of a part; sound IUV stays below it.

Measured on DensePose's, rendered and estimated IUV, people of 20 to 1000 px, alone and in a crowd.
As it was, and resized 0.1 to 4 times by nearest neighbour: at most 0.028. Resized 0.3 to 4 times by
bilinear, bicubic, area and Lanczos interpolation: at least 0.061. Behind JPEG: at least 0.18.
"""

FEWEST_BORDER_PIXELS = 100  # with fewer, a few pixels more or less would decide
LOOKED_AT = 8
"""How many frames are looked at: resizing spoils all of them alike."""

Iuv = UInt8[np.ndarray, "H W 3"]
Places = tuple[np.ndarray, np.ndarray]
"""Rows and columns of pixels."""


class BlendMeter:
    """Sums up over frames how much of the body is unsupported, and of its borders blended."""

    def __init__(self) -> None:
        self._body = self._unsupported = self._border = self._blended = 0

    def add(self, iuv: Iuv) -> None:
        """Take one frame (I, U, V) into account."""
        x, y, width, height = cv2.boundingRect(np.ascontiguousarray(iuv[..., 0]))
        if not width:
            return
        iuv = iuv[y : y + height, x : x + width]
        part = np.ascontiguousarray(iuv[..., 0])
        framed = np.pad(part, 1)  # where the body ends, its border is
        cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        changes = cv2.morphologyEx(framed, cv2.MORPH_GRADIENT, cross)[1:-1, 1:-1]
        places = _unsupported(part)
        self._body += int(np.count_nonzero(part))
        self._border += int(np.count_nonzero((changes > 0) & (part > 0)))
        self._unsupported += len(places[0])
        self._blended += int(_are_blends(iuv, places).sum())

    @property
    def found(self) -> bool:
        """Whether the frames so far were blended."""
        enough = self._border >= FEWEST_BORDER_PIXELS
        return enough and self._blended > BLENDED_SHARE * self._border

    @property
    def share(self) -> float:
        """The share of the body's pixels that have a part found nowhere near, 0..1."""
        return self._unsupported / max(1, self._body)

    def warn(self, what: str) -> str | None:
        """Say in a sentence what is wrong with `what`, and what to do; None if nothing is."""
        if not self.found:
            return None
        return (
            f"{what} was resized with interpolation, or smoothed: {self.share:.0%} of the body's"
            " pixels have a part that is found nowhere near, blends of those around them; resize by"
            " nearest neighbour instead, or mend it with `mt iuv repair`"
        )


def look_for_blends(reader: IuvReader, frames: range) -> BlendMeter:
    """Measure some of the frames, evenly spread. Raises: IuvFileError naming a broken frame."""
    meter = BlendMeter()
    for index in np.linspace(0, len(frames) - 1, min(LOOKED_AT, len(frames))).astype(int):
        for iuv in reader.read(frames[index], frames[index] + 1):
            meter.add(iuv)
    return meter


def mend_blends(iuv: Iuv) -> Iuv:
    """Replace unsupported pixels by the nearest others, background included.

    So the middle of a rim becomes the border. U and V that were left in the background go.
    """
    wrong = np.zeros(iuv.shape[:2], bool)
    wrong[_unsupported(np.ascontiguousarray(iuv[..., 0]))] = True
    mended = take_nearest(iuv, wrong)
    return mended * (mended[..., :1] > 0)


def _unsupported(part: UInt8[np.ndarray, "H W"]) -> Places:
    """Find the body's pixels whose part is solid nowhere near."""
    block = np.ones((2, 2), np.uint8)
    # a block is known by its pixel at the top left; those of its pixels lie up and left of them
    same = cv2.erode(part, block, anchor=(0, 0)) == cv2.dilate(part, block, anchor=(0, 0))
    solid = cv2.dilate(same.astype(np.uint8), block, anchor=(1, 1))
    rows, columns = np.nonzero((part > 0) & (solid == 0))
    blocks = np.pad(part * solid, REACH_PX)
    own, supported = part[rows, columns], np.zeros(len(rows), bool)
    for down in range(2 * REACH_PX + 1):
        for right in range(2 * REACH_PX + 1):
            supported |= blocks[rows + down, columns + right] == own
    return rows[~supported], columns[~supported]


def _are_blends(iuv: Iuv, places: Places) -> Bool[np.ndarray, " N"]:
    """Tell which pixels lie between two opposite pixels around them, in I, U and V alike."""
    rows, columns = (index + REACH_PX for index in places)
    around = np.pad(iuv, ((REACH_PX, REACH_PX), (REACH_PX, REACH_PX), (0, 0)))
    own = around[rows, columns].astype(np.float32)
    blended = np.zeros(len(rows), bool)
    for step in range(1, REACH_PX + 1):
        for down, right in ((0, step), (step, 0), (step, step), (step, -step)):
            start = around[rows + down, columns + right].astype(np.float32)
            end = around[rows - down, columns - right].astype(np.float32)
            blended |= _lie_between(own, start, end)
    return blended


def _lie_between(
    own: Float32[np.ndarray, "N 3"],
    start: Float32[np.ndarray, "N 3"],
    end: Float32[np.ndarray, "N 3"],
) -> Bool[np.ndarray, " N"]:
    """Tell which (I, U, V) lie on the way from one to another, U and V as far along as I."""
    done, way = own - start, end - start
    between = done[:, 0] * (way[:, 0] - done[:, 0]) > 0
    parts = np.where(between, way[:, 0], 1)[:, None]
    off = np.abs(done[:, 1:] - way[:, 1:] * done[:, :1] / parts)
    # I is a whole number: half of one is so much of the way
    tolerance = BLEND_LEVELS + 0.5 * np.abs(way[:, 1:] / parts)
    return between & (off <= tolerance).all(1)
