"""Parts of the body that are tubes, unrolled: rows are ways around them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float32, Int64

from motion_transfer.drawing.textures import lay_out_body

CELL_METRES = 0.005  # about a texel of the layout
STEEP = 3  # a cell without a texel takes one beside it rather than one above or below
TORSO, THIGHS = (1, 2), ((7, 9), (8, 10))  # sleeves are too narrow: their edges are all they show
SHOULDER_METRES = 0.2  # above the layout's origin a torso is no tube any more


@dataclass(frozen=True)
class Tube:
    """A torso or thigh, unrolled: each row a way around it.

    Attributes:
        cells: The texel that is nearest to each cell, H x A; columns go around.
        texels: Those of the tube.
        rows, columns: The cells that they lie in.
    """

    cells: Int64[np.ndarray, "H A"]
    texels: Int64[np.ndarray, " N"]
    rows: Int64[np.ndarray, " N"]
    columns: Int64[np.ndarray, " N"]


@lru_cache(maxsize=2)
def unroll_body(size: int) -> list[Tube]:
    """Unroll torso and thighs of a texture of that side."""
    part, position = lay_out_body(size)
    torso = np.isin(part, TORSO) & (position[1] < SHOULDER_METRES)
    thighs = [np.isin(part, parts) for parts in THIGHS]
    return [_unroll(np.flatnonzero(own), position) for own in (torso, *thighs)]


def go_around(
    position: Float32[np.ndarray, "3 N"],
) -> tuple[Int64[np.ndarray, " N"], Float32[np.ndarray, " N"], float]:
    """Find the place of points on an upright tube.

    Args:
        position: See `UVTables.position`, metres.
    Returns: Their rows, CELL_METRES high, from the lowest one up; the way around, 0 to 1, from the
        front by the left side; and the tube's radius, metres.
    """
    x, y, z = position
    rows = ((y - y.min()) / CELL_METRES).astype(np.int64)
    across = np.stack([x, z])
    low, high = (np.full((2, rows.max() + 1), sign * np.inf) for sign in (1, -1))
    np.minimum.at(low.T, rows, across.T)
    np.maximum.at(high.T, rows, across.T)
    sides = across - (low[:, rows] + high[:, rows]) / 2
    return rows, np.arctan2(*sides) / (2 * np.pi) % 1, float(np.median(np.hypot(*sides)))


def _unroll(texels: Int64[np.ndarray, " N"], position: Float32[np.ndarray, "3 M"]) -> Tube:
    rows, turns, radius = go_around(position[:, texels])
    width = round(2 * np.pi * radius / CELL_METRES)
    columns = (turns * width).astype(np.int64) % width
    cells = np.full((rows.max() + 1, width), -1)
    cells[rows, columns] = texels
    around = np.tile(np.repeat(cells, STEEP, axis=0), 3)
    empty = (around < 0).astype(np.uint8)
    of_a_pixel = cv2.DIST_LABEL_PIXEL
    _, labels = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=of_a_pixel)
    label = labels.astype(np.int64)
    named = np.zeros(label.max() + 1, np.int64)
    named[label[empty == 0]] = around[empty == 0]
    nearest = named[label][STEEP // 2 :: STEEP, width : 2 * width]
    return Tube(nearest, texels, rows, columns)
