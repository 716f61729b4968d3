"""Small pictures for the tiles of the page: people, motions and backgrounds."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import cv2
import numpy as np

from motion_transfer.drawing.backgrounds import Frame, fit_picture, make_background
from motion_transfer.drawing.canvas import colour_iuv, show_alpha
from motion_transfer.drawing.person import bounding_box
from motion_transfer.drawing.source import Source
from motion_transfer.errors import InputError
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.option import parse_background
from motion_transfer.people import is_motion
from motion_transfer.render.backdrop import open_background
from motion_transfer.render.options import RenderOptions

LONGEST_SIDE = 240  # px: three times a tile of the page, for dense screens and tall photos
BACKGROUND_SIZE = (90, 120)  # height and width, px
MOTION_SIZE = (160, 120)
AROUND_PERSON = 0.08  # of the tile's height, left free above and below the figure
WHITE = (255, 255, 255)


def shrink(picture: Frame) -> Frame:
    """Make a picture of a person as small as a tile."""
    scale = min(1, LONGEST_SIDE / max(picture.shape[:2]))
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def draw_motion(path: Path) -> Frame:
    """Draw a motion: whom the middle frame of IUV shows, coloured by part, or a first picture.

    Those of the extra `people` would take seconds; for each there is a picture in the program.
    Raises: InputError if it cannot be read, or is a motion without a picture, as a BVH file is.
    """
    if is_motion(path):
        name = str(path).partition(":")[2]
        drawn = files("motion_transfer.preview") / "motions" / f"{name}.png"
        if drawn.is_file():
            return read_photo(Path(str(drawn)), "picture of a motion").rgb
        raise InputError(f"there is no picture of {path}")
    if tell_kind(path) == "pictures":
        return fit_picture(next(open_pictures(path).read()), MOTION_SIZE, "cover")
    reader = open_reader(open_stream(path, missing="background"))
    middle = reader.stream.frame_count // 2
    return draw_figure(next(reader.read(middle, middle + 1)))


def draw_figure(iuv: Frame) -> Frame:
    """Draw everybody in an IUV frame, coloured by part, as large as a tile."""
    box = bounding_box(iuv)
    height, width = MOTION_SIZE
    # the window that has the tile's shape, with the figure in its middle
    high = max(box.bottom - box.top, (box.right - box.left) * height / width, 1)
    high *= 1 + 2 * AROUND_PERSON
    scale = height / high
    moved = (
        width / 2 - scale * (box.left + box.right) / 2,
        height / 2 - scale * (box.top + box.bottom) / 2,
    )
    matrix = np.array([[scale, 0, moved[0]], [0, scale, moved[1]]])
    return cv2.warpAffine(
        colour_iuv(iuv), matrix, (width, height), flags=cv2.INTER_AREA, borderValue=WHITE
    )


def draw_background(options: RenderOptions, source: Source | None) -> Frame:
    """Draw a background. Raises: InputError if it cannot be read."""
    if options.transparent:
        return show_alpha(np.zeros((*BACKGROUND_SIZE, 4), np.uint8))
    path = options.background_file
    if options.background == "driver":
        path = options.driver
    if path is not None:
        return fit_picture(next(open_background(path).read()), BACKGROUND_SIZE, "cover")
    if options.background == "photo":
        if source is None:
            raise InputError("the photo is being read; try again in a moment")
        return make_background("photo", BACKGROUND_SIZE, source, in_place=False)
    return np.full((*BACKGROUND_SIZE, 3), parse_background(options.background), np.uint8)
