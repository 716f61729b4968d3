"""From a rendered crop to an output frame: the background, the paste, panels side by side."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.person import disc, occupancy
from motion_transfer.drawing.renderers.interface import Renderer
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.window import Window
from motion_transfer.option import parse_colour

PERSON_GROWTH = 0.05  # of the person's height: hair and clothes reach beyond the IUV by about that
ALPHA_GROWTH = 0.02  # likewise, where alpha shows them: single hairs and their shadow
FAINT_ALPHA = 32  # of 255; less is noise of whoever made the alpha
PART_COLOUR_STEP = 10  # 24 parts over 0..240, as DensePose draws them

Frame = UInt8[np.ndarray, "H W 3"]


def make_background(
    background: str, size: tuple[int, int], source: Source, *, in_place: bool
) -> Frame:
    """Make a background of (height, width): one colour, or the source's photo.

    The photo covers the frame, centred, and loses its person, whose place is inpainted; with
    `in_place` (the driver is the source's own IUV) it stays as it is.
    """
    height, width = size
    colour = parse_colour(background)
    if colour is not None:
        return np.full((height, width, 3), colour, np.uint8)
    photo = source.photo.rgb
    if not in_place:
        photo = remove_person(photo, source.iuv, source.alpha)
    scale = max(height / photo.shape[0], width / photo.shape[1])
    covering = (
        max(width, round(photo.shape[1] * scale)),
        max(height, round(photo.shape[0] * scale)),
    )
    if covering != photo.shape[1::-1]:
        kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        photo = cv2.resize(photo, covering, interpolation=kind)
    top, left = (photo.shape[0] - height) // 2, (photo.shape[1] - width) // 2
    return np.ascontiguousarray(photo[top : top + height, left : left + width])


def remove_person(
    photo: Frame,
    iuv: UInt8[np.ndarray, "H W 3"],
    alpha: UInt8[np.ndarray, "H W"] | None = None,
) -> Frame:
    """Paint a photo's person over from around; alpha knows hair and clothes, too."""
    mask = occupancy(iuv)
    growth = PERSON_GROWTH
    if alpha is not None:
        mask, growth = mask | (alpha >= FAINT_ALPHA).astype(np.uint8), ALPHA_GROWTH
    rows = np.flatnonzero(mask.any(1))
    radius = max(2, (rows[-1] - rows[0] + 1) * growth)
    scale = min(1, 512 / max(photo.shape[:2]))  # the fill is smooth, and slow at full size
    small_size = (max(1, round(photo.shape[1] * scale)), max(1, round(photo.shape[0] * scale)))
    grown = cv2.dilate(mask, disc(radius))
    small = cv2.resize(photo, small_size, interpolation=cv2.INTER_AREA)
    small_mask = cv2.resize(grown, small_size, interpolation=cv2.INTER_AREA)
    small_mask = cv2.dilate(small_mask, np.ones((3, 3), np.uint8))
    filled = cv2.inpaint(small, small_mask, 5, cv2.INPAINT_TELEA)
    filled = cv2.resize(filled, photo.shape[1::-1], interpolation=cv2.INTER_CUBIC)
    return np.where(grown[..., None] > 0, filled, photo)


def paste(frame: Frame, rgba: UInt8[np.ndarray, "S S 4"], window: Window) -> None:
    """Lay a crop over the frame, in place, where its window lies."""
    if rgba.shape[0] != window.side:
        kind = cv2.INTER_AREA if rgba.shape[0] > window.side else cv2.INTER_CUBIC
        rgba = cv2.resize(rgba, (window.side, window.side), interpolation=kind)
    rows, columns, own_rows, own_columns = window.visible(*frame.shape[:2])
    over = rgba[own_rows, own_columns]
    target = frame[rows, columns]
    coverage = cv2.extractChannel(over, 3)
    left, top, width, height = cv2.boundingRect(coverage)
    if not width:
        return
    person = np.s_[top : top + height, left : left + width]
    over, target, coverage = over[person], target[person], coverage[person]
    colour = cv2.cvtColor(over, cv2.COLOR_RGBA2RGB)
    edge = np.nonzero(cv2.inRange(coverage, 1, 254))
    weight = coverage[edge][:, None].astype(np.uint16)
    # + 127: rounds to the nearest level in whole numbers
    blend = (colour[edge] * weight + target[edge] * (255 - weight) + 127) // 255
    cv2.copyTo(colour, cv2.inRange(coverage, 255, 255), target)
    target[edge] = blend.astype(np.uint8)


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
        self.size = (height, photo_width + 2 * width)

    def frame(self, iuv: UInt8[np.ndarray, "H W 3"], result: Frame) -> Frame:
        """Lay out one output frame; the result may be a pixel larger than the IUV."""
        picture = self._blank.copy()
        for left, panel in zip(self._panels, (colour_iuv(iuv), result), strict=True):
            picture[: panel.shape[0], left : left + panel.shape[1]] = panel
        return picture


@dataclass(frozen=True)
class Canvas:
    """An empty output, and how a rendered crop is laid into it.

    Attributes:
        background: An empty output frame, without the comparison's other panels.
        crop: Whether the output is the window itself, at the renderer's working size.
        comparison: Adds source and IUV beside the result, if wanted.
    """

    background: Frame
    crop: bool
    comparison: Comparison | None

    @property
    def size(self) -> tuple[int, int]:
        """The output's (width, height), px."""
        height, width = self.comparison.size if self.comparison else self.background.shape[:2]
        return width, height

    def lay_out(
        self, iuv: Frame, crop: Frame, rgba: UInt8[np.ndarray, "S S 4"], window: Window
    ) -> Frame:
        """Make an output frame from a target IUV, its crop, and what was rendered for the crop."""
        frame = self.background.copy()
        if self.crop:
            side = len(frame)  # of the largest shot's window; others are enlarged to it
            paste(frame, rgba, Window(0, 0, side))
            iuv = cv2.resize(crop, (side, side), interpolation=cv2.INTER_NEAREST_EXACT)
        else:
            paste(frame, rgba, window)
        return self.comparison.frame(iuv, frame) if self.comparison else frame

    def draw(self, renderer: Renderer, iuv: Frame, window: Window) -> Frame:
        """Draw one output frame of a target IUV, H x W x 3, whose person a window holds."""
        crop = window.cut(iuv, renderer.working_size(window.side))
        return self.lay_out(iuv, crop, renderer.render(crop[None])[0], window)
