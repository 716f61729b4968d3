"""From rendered crops to an output frame: people laid over a background, panels side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.backgrounds import Frame
from motion_transfer.drawing.light import cast_shadow, relight
from motion_transfer.drawing.renderers.interface import Renderer
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.window import Window
from motion_transfer.media.alpha import add_alpha

PART_COLOUR_STEP = 10  # 24 parts over 0..240, as DensePose draws them
CHECKER_PX, CHECKER_LEVELS = 16, (255, 204)  # as editors show that nothing is there

OUTLINE_BLUR_PX, OUTLINE_GAIN = 1.0, 2.2
"""Of a crop that is enlarged: how far its outline is blurred, and how much steeper it is then."""

FULL_STRENGTH = 0.5
"""A crop that is enlarged by this share of its size, or more, is smoothed so; by less, less so."""

SPILL = 0.1
"""Share with which a pixel's surroundings count in its colour: all of it where it has none."""

Rgba = UInt8[np.ndarray, "S S 4"]
Picture = UInt8[np.ndarray, "H W C"]
"""An output frame: RGB, or where the background is transparent, RGBA, not multiplied by alpha."""


@dataclass(frozen=True)
class Spot:
    """Where somebody is in an output frame, px.

    Attributes:
        window: Where the crop goes.
        ground: The row on which the person stands.
    """

    window: Window
    ground: int = 0


@dataclass(frozen=True)
class Figure:
    """Somebody in an output frame.

    Attributes:
        table: Changes the person's light, see `match_light`; None: it stays.
    """

    rgba: Rgba
    spot: Spot
    table: UInt8[np.ndarray, "1 256 3"] | None = None


def paste(frame: Picture, rgba: Rgba, window: Window) -> None:
    """Lay a crop over the frame, in place, where its window lies."""
    if len(rgba) != window.side:
        rgba = _scale(_go_on(rgba, window, frame.shape[:2]), window.side)
    lay_over(frame, rgba, window.x, window.y)


def _go_on(rgba: Rgba, window: Window, size: tuple[int, ...]) -> Rgba:
    """Let whoever the frame's border cuts off go on beyond it, as that border is no outline.

    Else scaling would mix the nothing beyond into the last row, through which a line of background
    shows.
    """
    inside: list[slice] = []
    beyond: list[int] = []  # above, below, left, right
    for start, length in ((window.y, size[0]), (window.x, size[1])):
        ends = np.clip([-start, length - start], 0, window.side) * len(rgba) / window.side
        first, last = math.ceil(ends[0]), math.floor(ends[1])  # pixels that lie in the frame
        inside.append(slice(first, last))
        beyond += [first, len(rgba) - last]
    shown = rgba[tuple(inside)]
    if not any(beyond) or not shown.size:
        return rgba
    above, below, left, right = beyond
    return cv2.copyMakeBorder(shown, above, below, left, right, cv2.BORDER_REPLICATE)


def lay_over(frame: Picture, rgba: UInt8[np.ndarray, "h w 4"], x: int, y: int) -> None:
    """Lay a picture over the frame, in place, its corner at (x, y); it may reach beyond."""
    top, left = max(0, -y), max(0, -x)
    over = rgba[top : max(0, frame.shape[0] - y), left : max(0, frame.shape[1] - x)]
    if not over.size:
        return
    y, x = y + top, x + left
    target = frame[y : y + over.shape[0], x : x + over.shape[1]]
    coverage = cv2.extractChannel(over, 3)
    left, top, width, height = cv2.boundingRect(coverage)
    if not width:
        return
    person = np.s_[top : top + height, left : left + width]
    over, target, coverage = over[person], target[person], coverage[person]
    colour = over if frame.shape[2] == 4 else cv2.cvtColor(over, cv2.COLOR_RGBA2RGB)
    # 0 becomes 255; `np.nonzero` of two axes takes nine times as long
    edge = np.divmod(np.flatnonzero(coverage - np.uint8(1) < 254), coverage.shape[1])
    if frame.shape[2] == 4:
        blend = _blend_rgba(over[edge], target[edge])
    else:
        weight = coverage[edge][:, None].astype(np.uint16)
        # + 127: rounds to the nearest level in whole numbers
        blend = (colour[edge] * weight + target[edge] * (255 - weight) + 127) // 255
    cv2.copyTo(colour, cv2.inRange(coverage, 255, 255), target)
    target[edge] = blend.astype(np.uint8)


def _blend_rgba(over: UInt8[np.ndarray, "N 4"], under: UInt8[np.ndarray, "N 4"]) -> np.ndarray:
    """Lay RGBA over RGBA, neither multiplied by alpha; `over` covers something everywhere.

    Source: Porter and Duff, "Compositing Digital Images" (SIGGRAPH 1984), their operator "over".
    """
    near, far = over.astype(np.float32), under.astype(np.float32)
    far_weight = far[:, 3:] * (1 - near[:, 3:] / 255)
    alpha = near[:, 3:] + far_weight
    colour = (near[:, :3] * near[:, 3:] + far[:, :3] * far_weight) / alpha
    return np.hstack([colour, alpha]).round()


def _scale(rgba: Rgba, side: int) -> Rgba:
    """Scale a crop; colours count by their coverage, as those of nobody mean nothing."""
    if len(rgba) < side:
        return _enlarge(rgba, side)
    weighted = cv2.cvtColor(rgba, cv2.COLOR_RGBA2mRGBA)
    scaled = cv2.resize(weighted, (side, side), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(scaled, cv2.COLOR_mRGBA2RGBA)


def _enlarge(rgba: Rgba, side: int) -> Rgba:
    """Enlarge a crop. Its outline has steps of a pixel, which would be as much larger: they go.

    The outline is blurred, and made as steep again as enlarging it had left it. Colours go on
    beyond it, since that moves it a little.
    """
    strength = min(1.0, (side / len(rgba) - 1) / FULL_STRENGTH)
    weighted = cv2.cvtColor(rgba, cv2.COLOR_RGBA2mRGBA)
    around = cv2.GaussianBlur(weighted, (0, 0), OUTLINE_BLUR_PX)
    colours, alpha, blurred = rgba[..., :3].copy(), rgba[..., 3], around[..., 3]
    edge = (alpha < 255) & (blurred > 0)
    mixed = weighted[edge].astype(np.float32) + SPILL * around[edge]
    colours[edge] = (mixed[:, :3] / mixed[:, 3:] * 255).clip(0, 255).round()
    outline = cv2.addWeighted(blurred, strength, alpha, 1 - strength, 0)
    levels = (np.arange(256) - 127.5) * (1 + (OUTLINE_GAIN - 1) * strength) + 127.5
    colours, outline = (
        cv2.resize(each, (side, side), interpolation=cv2.INTER_CUBIC) for each in (colours, outline)
    )
    return add_alpha(colours, cv2.LUT(outline, levels.clip(0, 255).round().astype(np.uint8)))


def show_alpha(picture: Picture) -> Frame:
    """Show a picture on a checkerboard where it is transparent."""
    if picture.shape[2] == 3:
        return picture
    rows, columns = np.indices(picture.shape[:2], np.uint16) // CHECKER_PX
    board = np.where((rows + columns) % 2, *map(np.uint8, CHECKER_LEVELS))
    frame = cv2.cvtColor(board, cv2.COLOR_GRAY2RGB)
    lay_over(frame, picture, 0, 0)
    return frame


def colour_iuv(iuv: UInt8[np.ndarray, "H W 3"]) -> Frame:
    """Colour an IUV image as DensePose does: the part as a hue, U and V as its shades."""
    part = cv2.applyColorMap(
        np.ascontiguousarray(iuv[..., 0]) * np.uint8(PART_COLOUR_STEP), cv2.COLORMAP_PARULA
    )
    shade = (iuv[..., 1:].astype(np.float32).mean(-1) / 255)[..., None] * 0.5 + 0.5
    return np.where(iuv[..., :1] > 0, part[..., ::-1] * shade, 255).astype(np.uint8)


class Comparison:
    """Source, target IUV and result side by side, all as high as the result."""

    def __init__(self, source: Source, height: int, width: int) -> None:
        photo = source.photo.rgb
        photo_width = max(2, round(photo.shape[1] * height / photo.shape[0] / 2) * 2)
        kind = cv2.INTER_AREA if height < photo.shape[0] else cv2.INTER_CUBIC
        self._blank = np.full((height, photo_width + 2 * width, 3), 255, np.uint8)
        self._blank[:, :photo_width] = cv2.resize(photo, (photo_width, height), interpolation=kind)
        self._panels = (photo_width, photo_width + width)
        self._panel = (height, width)
        self.size = (height, photo_width + 2 * width)

    def frame(self, iuv: UInt8[np.ndarray, "H W 3"], result: Frame) -> Frame:
        """Lay out one output frame; the result may be a pixel larger than the IUV, or another."""
        height, width = self._panel
        if not (0 <= height - iuv.shape[0] <= 1 and 0 <= width - iuv.shape[1] <= 1):
            scale = min(height / iuv.shape[0], width / iuv.shape[1])
            size = max(1, int(iuv.shape[1] * scale)), max(1, int(iuv.shape[0] * scale))
            iuv = cv2.resize(iuv, size, interpolation=cv2.INTER_NEAREST_EXACT)
        picture = self._blank.copy()
        for left, panel in zip(self._panels, (colour_iuv(iuv), result), strict=True):
            picture[: panel.shape[0], left : left + panel.shape[1]] = panel
        return picture


@dataclass(frozen=True)
class Canvas:
    """How people and a background become an output frame.

    Attributes:
        height, width: Of the result, px.
        transparent: Whether it has no background, and alpha instead.
        shadows: Whether people cast one.
        comparison: Adds source and IUV beside the result, if wanted.
    """

    height: int
    width: int
    transparent: bool = False
    shadows: bool = False
    comparison: Comparison | None = None

    @property
    def size(self) -> tuple[int, int]:
        """The output's (width, height), px."""
        height, width = self.comparison.size if self.comparison else (self.height, self.width)
        return width, height

    def lay_out(
        self,
        background: Frame | None,
        figures: Sequence[Figure],
        iuv: UInt8[np.ndarray, "H W 3"],
    ) -> Picture:
        """Make an output frame.

        Args:
            background: Of the canvas' height and width; None where it is transparent.
            figures: Whoever stands lower in the frame is nearer, and covers the others.
            iuv: What the comparison shows.
        """
        if background is None:
            frame = np.zeros((self.height, self.width, 4), np.uint8)
        else:
            frame = background.copy()
        for figure in sorted(figures, key=lambda figure: figure.spot.ground):
            if self.shadows:
                _lay_shadow(frame, figure)
            rgba = figure.rgba if figure.table is None else relight(figure.rgba, figure.table)
            paste(frame, rgba, figure.spot.window)
        return self.comparison.frame(iuv, frame) if self.comparison else frame


def _lay_shadow(frame: Picture, figure: Figure) -> None:
    window = figure.spot.window
    ground = (figure.spot.ground - window.y) / window.side
    shade = cast_shadow(cv2.extractChannel(figure.rgba, 3), ground)
    if shade is None:
        return
    left, top, width, height = cv2.boundingRect(shade)
    if not width:
        return
    scale = window.side / len(shade)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    black = np.zeros((*size[::-1], 4), np.uint8)
    black[..., 3] = cv2.resize(shade[top : top + height, left : left + width], size)
    x = window.x - window.side // 2 + round(left * scale)
    lay_over(frame, black, x, window.y + round(top * scale))


def draw_over(
    background: Frame, renderer: Renderer, iuv: UInt8[np.ndarray, "H W 3"], window: Window
) -> Frame:
    """Draw the person of a target IUV, whom a window holds, over a background of its size."""
    frame = background.copy()
    crop = window.cut(iuv, renderer.working_size(window.side))
    paste(frame, renderer.render(crop[None])[0], window)
    return frame
