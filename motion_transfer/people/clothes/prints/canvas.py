"""A transparent sheet that prints are drawn on.

Convention: x runs right, y down, both in units of the sheet's natural width; its natural height is
`aspect`. The sheet is fitted into the picture asked for, centred, and keeps its proportions.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from motion_transfer.people.clothes.fabrics.colours import Colour

_SHIFT = 4  # cv2 draws in sixteenths of a pixel

# Letters are drawn no higher than this and enlarged: a contour takes time with the fourth power.
_LETTER_PIXELS = 96

Points = Float[np.ndarray, "N 2"]
Box = tuple[float, float, float, float]
"""Left, top, right and bottom."""


class PrintCanvas:
    """RGBA multiplied by alpha, so that antialiased edges of any two inks blend rightly."""

    def __init__(self, width_px: int, height_px: int, aspect: float) -> None:
        # twice as fine as a small picture: cv2 places letters at whole pixels
        self._finer = 2 if max(width_px, height_px) <= 512 else 1
        self._size = (width_px, height_px)
        width, height = width_px * self._finer, height_px * self._finer
        self._unit = min(width, height / aspect)
        self._corner = np.array([width - self._unit, height - self._unit * aspect]) / 2
        self.aspect = aspect
        self._pixels: UInt8[np.ndarray, "h w 4"] = np.zeros((height, width, 4), np.uint8)

    def polygon(self, points: Points, ink: Colour | None) -> None:
        """Fill a closed outline; without an ink, make it transparent again."""
        fill = _bytes(ink) if ink else (0, 0, 0, 0)
        cv2.fillPoly(self._pixels, [self._at(points)], fill, cv2.LINE_AA, _SHIFT)

    def line(self, points: Points, width: float, ink: Colour) -> None:
        """Draw an open line with round ends."""
        thick = max(1, round(width * self._unit))
        corners = [self._at(points)]
        cv2.polylines(self._pixels, corners, False, _bytes(ink), thick, cv2.LINE_AA, _SHIFT)

    def disc(self, centre: tuple[float, float], radius: float, ink: Colour) -> None:
        """Fill a circle."""
        x, y = self._at(np.array([centre]))[0].tolist()
        across = round(radius * self._unit * (1 << _SHIFT))
        cv2.circle(self._pixels, (x, y), across, _bytes(ink), cv2.FILLED, cv2.LINE_AA, _SHIFT)

    def box(self, left: float, top: float, right: float, bottom: float, ink: Colour) -> None:
        """Fill a rectangle."""
        self.polygon(np.array([[left, top], [right, top], [right, bottom], [left, bottom]]), ink)

    def text(
        self,
        words: str,
        box: Box,
        font: int,
        weight: float,
        ink: Colour,
        edge: Colour | None = None,
    ) -> None:
        """Set a line of letters, as large as fits a box, centred.

        Args:
            font: One of cv2's, italic or not.
            weight: The strokes' thickness as a share of the letters' height.
            edge: Ink of a contour round the letters, or None.
        """
        left, top = (np.array(box[:2]) * self._unit + self._corner).tolist()
        right, bottom = (np.array(box[2:]) * self._unit + self._corner).tolist()
        letters = _letters(words, font, weight, min(bottom - top, _LETTER_PIXELS))
        border = 0
        if edge is not None:
            border = max(1, round(0.07 * letters.shape[0]))
            letters = np.pad(letters, border)
        scale = min((right - left) / letters.shape[1], (bottom - top) / letters.shape[0])
        wide, high = (max(1, int(side * scale)) for side in letters.shape[::-1])
        x, y = int((left + right - wide) / 2), int((top + bottom - high) / 2)
        place = (slice(max(0, y), y + high), slice(max(0, x), x + wide))
        if edge is not None:
            round_tip = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, [2 * border + 1] * 2)
            self._stamp(cv2.dilate(letters, round_tip), (wide, high), place, edge)
        self._stamp(letters, (wide, high), place, ink)

    def _stamp(
        self,
        cover: UInt8[np.ndarray, "h w"],
        size: tuple[int, int],
        place: tuple[slice, slice],
        ink: Colour,
    ) -> None:
        """Cover a place with ink where `cover`, brought to a size (width, height), is not 0."""
        beneath = self._pixels[place]
        method = cv2.INTER_AREA if size[0] < cover.shape[1] else cv2.INTER_LINEAR
        cover = cv2.resize(cover, size, interpolation=method)
        cover = cover[: beneath.shape[0], : beneath.shape[1]]  # letters may stand over the edge
        share = cv2.merge([cover] * 4).astype(np.float32) * np.float32(1 / 255)
        over = beneath + (np.array(_bytes(ink), np.float32) - beneath) * share
        self._pixels[place] = cv2.convertScaleAbs(over)

    def bend(self, rise: float) -> None:
        """Bend all that is drawn so far into an arc whose middle lies `rise` (above 0) higher."""
        height, width = self._pixels.shape[:2]
        depth = rise * self._unit
        radius = (self._unit**2 / 4 + depth**2) / (2 * depth)  # of the circle through three points
        x = np.arange(width, dtype=np.float32)[None] - np.float32((width - 1) / 2)
        # The middle of the letters' height keeps its length; the arc's feet stay where they are.
        y = np.float32(radius - depth / 2 + (height - 1) / 2) - np.arange(height, dtype=np.float32)
        y = y[:, None]
        from_x = np.arctan2(x, y) * np.float32(radius) + np.float32((width - 1) / 2)
        from_y = np.float32(radius + (height - 1) / 2) - np.sqrt(x * x + y * y)
        self._pixels = cv2.remap(
            self._pixels, from_x, from_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
        )

    def finish(self, spare: Colour) -> Float32[np.ndarray, "H W 4"]:
        """Finish the picture: sRGB not multiplied by alpha, then alpha; `spare` where it is 0."""
        pixels = self._pixels
        if self._finer > 1:
            pixels = cv2.resize(pixels, self._size, interpolation=cv2.INTER_AREA)
        alpha = pixels[..., 3].astype(np.float32)
        share = np.divide(1.0, alpha, out=np.zeros_like(alpha), where=alpha > 0)
        picture = pixels.astype(np.float32) * cv2.merge([share, share, share, share])
        picture[..., 3] = alpha / 255
        picture[alpha == 0] = (*spare, 0.0)
        return np.clip(picture, 0, 1, out=picture)

    def _at(self, points: Points) -> np.ndarray:
        # cv2 counts from the middle of the first pixel.
        place = points * self._unit + self._corner - 0.5
        return np.rint(place * (1 << _SHIFT)).astype(np.int32)


def _letters(words: str, font: int, weight: float, height: float) -> UInt8[np.ndarray, "h w"]:
    """Draw white letters on black, about `height` pixels high, cut out along their outermost ink.

    Versions of cv2 draw the same font differently and report sizes that do not hold it, so the
    ink itself is measured.
    """
    per_scale = max(1, cv2.getTextSize(words, font, 1.0, 1)[0][1])
    scale = max(0.5, height / per_scale)
    thick = max(1, round(weight * scale * per_scale))
    (wide, high), _ = cv2.getTextSize(words, font, scale, thick)
    margin = high + thick
    sheet = np.zeros((high + 2 * margin, int(1.2 * wide) + 2 * margin), np.uint8)
    cv2.putText(sheet, words, (margin, high + margin), font, scale, 255, thick, cv2.LINE_AA)
    x, y, columns, rows = cv2.boundingRect(sheet)
    return sheet[y : y + rows, x : x + columns]


def _bytes(ink: Colour) -> tuple[float, float, float, float]:
    red, green, blue = (round(value * 255) for value in ink)
    return (red, green, blue, 255)
