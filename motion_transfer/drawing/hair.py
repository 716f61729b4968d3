"""Long hair: on the neck that it covers where no photo shows it, and beside the neck.

Hair beside a neck lies off the body, and a texture has no place for it: whoever turned around had
short hair, and from the front it was drawn in the colours of neck and shoulders. So where a photo
shows hair from the ears down, beside the jaw and farther, the hidden sides of neck and head get its
colour, as far down as it reaches, and so does what is drawn beside them.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int64, UInt8

from motion_transfer.drawing.person import COVERS, bounding_box, occupancy
from motion_transfer.drawing.source import Source, paint
from motion_transfer.drawing.textures import differ_in_any_light
from motion_transfer.drawing.unfolding import (
    find_positions,
    keep_parts,
    texel_index,
    texture_coordinates,
)
from motion_transfer.media.nearest import nearest_pixels
from nhrr_core import PART_GROUPS, load_uv_tables

SIZE = 256  # texels a side, those of the tables
HEAD_METRES = 0.27  # from the layout's shoulders to its crown
LOWEST, JAW, HIGHEST = 0.27, 0.36, 0.42  # metres: neck's base, and ears; see `UVTables.position`
ROW = 0.01  # metres
ROWS = round((HIGHEST - LOWEST) / ROW)
FEWEST_ROWS, GAP = 6, 2  # of hair, from the ears down; rows without any between them

NEAR_SHARE = 0.6  # of the head's height in the photo: hair farther from it is not looked at
OFF_PX = 1.5  # from the outline, where a pixel is body and backdrop
LEAST_METRES = 0.012  # off the body: less is no hair, or lies on what the texture shows
FEWEST_PIXELS = 30
SAME_HAIR, SHADES = 0.16, (0.5, 2.0)  # of 1, in the channel that differs most, in another light
MOSTLY = 0.6  # of the pixels of a row
SPREAD = 2.5  # rows: the standard deviation of a Gaussian over which colours are averaged

REACH, SOFT = 0.5, 0.025  # of the root of a head's area: hair beside it, and how softly it begins
BEHIND_METRES = 0.02  # forward: what is hidden farther in front is not behind hair
ASIDE_METRES = 0.03  # from the middle: what is farther in front is throat and chin
MIDDLE_METRES = 0.05  # from the nape, where hair of both sides meets


class Hair(NamedTuple):
    """Long hair beside a neck, by the body's side, the right one first, and row, see `Neck`.

    Attributes:
        colours: 0 to 1.
        hangs: Where it does.
    """

    colours: Float32[np.ndarray, "3 2 R"]
    hangs: Bool[np.ndarray, "2 R"]


def find_hair(source: Source) -> Hair | None:
    """Find the long hair of a person; None: it is short, or nothing tells.

    Only the first photo is looked at, as its pixels alone are at hand, and only if it is known
    where the person ends.
    """
    strands = _look_for_strands(source)
    hangs = None if strands is None else _measure_length(strands)
    if strands is None or hangs is None:
        return None
    return Hair(_average(strands, hangs), hangs)


def lay_hair(source: Source) -> Source:
    """Show long hair on the hidden neck of whoever has it; others pass as they are.

    What is painted counts as seen, as in `clothe_back`.
    """
    hair = find_hair(source)
    if hair is None:
        return source
    colours, hangs = hair
    neck = find_neck()
    own, others = (colours[:, side, neck.row] for side in (neck.side, 1 - neck.side))
    behind = neck.position[:, 2] < BEHIND_METRES
    both = hangs[0] & hangs[1]
    covered = hangs[neck.side, neck.row] & (both[neck.row] | (neck.off == 1))
    painted = np.zeros((SIZE, SIZE), bool)
    painted.reshape(-1)[neck.texels[covered & behind]] = True
    texture = np.zeros((3, SIZE, SIZE), np.float32)
    texture.reshape(3, -1)[:, neck.texels] = (own + (others - own) * (1 - neck.off) / 2) * 2 - 1
    return paint(source, texture, painted)


def colour_hair(
    picture: UInt8[np.ndarray, "S S 4"], iuv: UInt8[np.ndarray, "S S 3"], hair: Hair
) -> None:
    """Give what is drawn beside neck and lower head the colour of the hair that hangs there.

    Args:
        picture: What a network draws, changed in place; what it covers stays.
        iuv: What it was drawn for.
    """
    head = np.isin(iuv[..., 0], PART_GROUPS["head"])
    size = np.count_nonzero(head) ** 0.5
    head[head] = _is_low(find_positions(iuv[head]))
    box = bounding_box(iuv * head[..., None])
    if not box.area:
        return
    near = box.grown(round(size * REACH)).slices
    body = occupancy(iuv[near]) > 0
    beside = ~body & (picture[near][..., 3] > 0)
    outline = iuv[near].reshape(-1, 3)[nearest_pixels(body)[1][beside]]
    place = find_positions(outline)
    row, side = _row(place), (place[:, 0] > 0).astype(np.int64)
    own = np.isin(outline[:, 0], PART_GROUPS["head"]) & hair.hangs[side, row]
    own &= _is_low(place)
    own &= (np.abs(place[:, 0]) > ASIDE_METRES) | (place[:, 2] < BEHIND_METRES)  # not at the throat
    if not own.any():
        return
    covered = np.zeros(body.shape, np.float32)
    covered[beside] = own
    blur, every = (
        cv2.GaussianBlur(each, (0, 0), size * SOFT)[beside]
        for each in (covered, beside.astype(np.float32))
    )
    share = (blur / every)[:, None]
    drawn = picture[near][..., :3][beside].astype(np.float32)
    drawn += (hair.colours[:, side, row].T * 255 - drawn) * share
    picture[near][..., :3][beside] = np.rint(drawn).astype(np.uint8)


class Neck(NamedTuple):
    """Neck and lower head.

    Attributes:
        texels: Those of them.
        position: Of each of these, see `UVTables.position`.
        row: How far above LOWEST.
        side: 0 on the right, 1 on the left.
        off: How far from the middle, 1 from MIDDLE_METRES on.
    """

    texels: Int64[np.ndarray, " N"]
    position: Float32[np.ndarray, "N 3"]
    row: Int64[np.ndarray, " N"]
    side: Int64[np.ndarray, " N"]
    off: Float32[np.ndarray, " N"]


@cache
def find_neck() -> Neck:
    """Find the texels of neck and lower head in a texture of SIZE."""
    tables = load_uv_tables()
    height = tables.position[..., 1]
    own = np.isin(tables.part, PART_GROUPS["head"]) & (height > LOWEST) & (height < HIGHEST)
    position = tables.position[own]
    return Neck(
        np.flatnonzero(own),
        position,
        _row(position),
        (position[:, 0] > 0).astype(np.int64),
        (np.abs(position[:, 0]) / np.float32(MIDDLE_METRES)).clip(0, 1),
    )


class Strands(NamedTuple):
    """Pixels of hair beside neck and lower head.

    Attributes:
        rgb: Of each, 0 to 1.
        row, side: Where the body's outline next to it lies, see `Neck`.
        off: How far it is from the outline, metres.
        alike: Which have the colour of the hair beside the ears.
    """

    rgb: Float32[np.ndarray, "N 3"]
    row: Int64[np.ndarray, " N"]
    side: Int64[np.ndarray, " N"]
    off: Float32[np.ndarray, " N"]
    alike: Bool[np.ndarray, " N"]


def _look_for_strands(source: Source) -> Strands | None:
    """Find what a photo shows of the person beside neck and lower head; None if nothing."""
    alpha = source.photo.cutout if source.alpha is None else source.alpha
    box = bounding_box(keep_parts(source.iuv, PART_GROUPS["head"]))
    if alpha is None or not box.area:
        return None
    near = box.grown(round(box.height * NEAR_SHARE)).slices
    iuv = source.iuv[near]
    body = occupancy(iuv) > 0
    away, nearest = nearest_pixels(body)
    beyond = ~body & (alpha[near] >= COVERS) & (away > OFF_PX)
    outline = iuv.reshape(-1, 3)[nearest[beyond]]
    texel = texel_index(texture_coordinates(outline), SIZE)
    neck = np.zeros(SIZE**2, bool)
    neck[find_neck().texels] = True
    own = neck[texel] & np.isin(outline[:, 0], PART_GROUPS["head"])
    position = load_uv_tables().position.reshape(-1, 3)[texel[own]]
    rgb = source.photo.rgb[near][beyond][own] / np.float32(255)
    by_the_ears = position[:, 1] > JAW
    if np.count_nonzero(by_the_ears) < FEWEST_PIXELS:
        return None
    hair = np.median(rgb[by_the_ears], axis=0)
    alike = differ_in_any_light(rgb.T, hair[:, None], SHADES) < SAME_HAIR
    off = away[beyond][own] * np.float32(HEAD_METRES / box.height)
    side = (position[:, 0] > 0).astype(np.int64)
    return Strands(rgb, _row(position), side, off, alike)


def _measure_length(strands: Strands) -> Bool[np.ndarray, "2 R"] | None:
    """Tell the rows of each side that hair hangs beside, from the ears down; None: it is short."""
    place = strands.side * ROWS + strands.row
    furthest = np.zeros(2 * ROWS, np.float32)
    np.maximum.at(furthest, place, strands.off * strands.alike)
    hair, anything = (
        np.bincount(place, each, 2 * ROWS) for each in (strands.alike, strands.off**0)
    )
    told = ((furthest > LEAST_METRES) & (hair > MOSTLY * anything)).reshape(2, ROWS)
    # across gaps, from the ears down
    lowest = [ROWS, ROWS]
    for side, rows in enumerate(told):
        for row in np.flatnonzero(rows)[::-1]:
            if lowest[side] - row > GAP + 1:
                break
            lowest[side] = int(row)
    if min(lowest) > ROWS - FEWEST_ROWS:
        return None
    return np.arange(ROWS) >= np.array(lowest)[:, None]


def _average(strands: Strands, hangs: Bool[np.ndarray, "2 R"]) -> Float32[np.ndarray, "3 2 R"]:
    """Average hair over rows around; where a side shows none, it is the other's."""
    own = strands.alike & hangs[strands.side, strands.row]
    place = (strands.side * ROWS + strands.row)[own]
    sums = [
        np.bincount(place, each, 2 * ROWS) for each in (*strands.rgb[own].T, np.ones(len(place)))
    ]
    table = np.array(sums, np.float32).reshape(-1, ROWS)
    border = cv2.BORDER_CONSTANT
    spread = cv2.GaussianBlur(table, (0, 0), SPREAD, sigmaY=1e-3, borderType=border)
    spread = spread.reshape(4, 2, ROWS)
    spread += spread.sum(1, keepdims=True) * np.float32(1e-3)
    spread += spread.sum(2, keepdims=True) * np.float32(1e-6)
    return spread[:3] / spread[3:]


def _row(position: Float32[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
    return ((position[:, 1] - LOWEST) / ROW).astype(np.int64).clip(0, ROWS - 1)


def _is_low(position: Float32[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
    """Tell what belongs to the neck or, of a head, lies no higher than its ears."""
    return (position[:, 1] > LOWEST) & (position[:, 1] < HIGHEST)
