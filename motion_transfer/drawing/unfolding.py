"""A photo unfolded into UV space, for one picture and without torch, which takes a second to load.

These are the twins of `smooth_coordinates`, `extract_texture` and `unfold_clearance` in
`nhrr_core`, which batches, gradients and GPUs need, and which are the specification: tests hold
these to them. On a CPU these are two to three times as fast.

Convention: images have their channels last, maps have them first, and neither has a batch axis;
places are (x, y), along the first axis, in [0, 1] of the texture.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64, Shaped, UInt8, UInt16

from nhrr_core import load_uv_tables
from nhrr_core.config import CLEARANCE_SIZE, UNIT_TEXELS
from nhrr_core.uv_tables import (
    CHART_SIZE,
    MAX_CHART_STEP,
    MAX_ENTRY_STEP,
    MAX_SPREAD,
    MAX_STRETCH,
    SAMPLES_PER_TEXEL,
    SMOOTHED_OVER,
    WORD,
)

POINTS_AT_ONCE = 2**16
"""So many fit into a core's cache with all that is computed of them."""

CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))  # of a quad: down, right

CODE_WEIGHTS = np.array([CHART_SIZE**2, 1, CHART_SIZE], np.float32)
"""(I, U, V) to an entry behind one chart more; below 2**24, hence exact in float32."""


class Charts(NamedTuple):
    """The tables' charts as they are looked up fastest.

    Attributes:
        x, y: Where each entry lies in the texture, in the order of part, V, U.
        words: The same, times WORD, in pairs.
        torn: Whether a seam of the texture runs between an entry and the next ones.
    """

    x: Float32[np.ndarray, " L"]
    y: Float32[np.ndarray, " L"]
    words: UInt16[np.ndarray, "L 2"]
    torn: Bool[np.ndarray, " L"]


@cache
def _charts() -> Charts:
    axes = np.ascontiguousarray(np.moveaxis(load_uv_tables().charts, -1, 0))
    torn = np.zeros(axes.shape[1:], bool)
    for chart, own in zip(axes.swapaxes(0, 1), torn, strict=True):  # which a core's cache holds
        own[:-1, :-1] = (_spans(chart) > MAX_ENTRY_STEP).any(0)
    x, y = axes.reshape(2, -1)
    words = np.rint(np.column_stack([x, y]) * np.float32(WORD)).astype(np.uint16)
    return Charts(x, y, words, torn.reshape(-1))


def chart_entries(iuv: UInt8[np.ndarray, "*S 3"]) -> Int32[np.ndarray, "*S"]:
    """Tell each pixel's entry in the flat tables of charts; the background's is one of part 1."""
    entries = (iuv.astype(np.float32) @ CODE_WEIGHTS).astype(np.int32)
    np.subtract(entries, CHART_SIZE**2, out=entries, where=entries >= CHART_SIZE**2)
    return entries


def texture_coordinates(iuv: UInt8[np.ndarray, "... 3"]) -> Float32[np.ndarray, "2 ..."]:
    """Look up where each pixel lies in the texture; undefined where I is 0."""
    charts, entry = _charts(), chart_entries(iuv)
    return np.stack([charts.x.take(entry), charts.y.take(entry)])


def smooth_coordinates(iuv: UInt8[np.ndarray, "H W 3"]) -> Float32[np.ndarray, "2 H W"]:
    """Look up where each pixel lies, between levels of U and V, see `nhrr_core.smooth_coordinates`.

    Where I is 0, so is the place.
    """
    places = np.zeros((2, *iuv.shape[:2]), np.float32)
    left, top, width, height = cv2.boundingRect(np.ascontiguousarray(iuv[..., 0]))
    if not width:
        return places
    person = np.s_[top : top + height, left : left + width]
    part = np.ascontiguousarray(iuv[person][..., 0])
    words = cv2.split(_charts().words.take(chart_entries(iuv[person]), axis=0))
    fine = np.stack(words) / np.float32(WORD)
    for side in SMOOTHED_OVER:
        # beyond the person: no part is 0
        low, high = _extremes(part, side)
        alike = (low == high) & (part > 0)
        for axis in words:
            low, high = _extremes(axis, side)
            alike &= high - low <= MAX_SPREAD * WORD
        for own, axis in zip(fine, words, strict=True):
            total = cv2.boxFilter(axis, cv2.CV_32F, (side, side), normalize=False)
            np.divide(total, np.float32(side**2 * WORD), out=own, where=alike)
    places[:, *person] = fine * (part > 0)
    return places


def _extremes(
    plane: Shaped[np.ndarray, "H W"], side: int
) -> tuple[Shaped[np.ndarray, "H W"], Shaped[np.ndarray, "H W"]]:
    """The lowest and the highest value in the square around each pixel; 0 lies beyond the edge."""
    square = np.ones((side, side), np.uint8)
    low = cv2.erode(plane, square, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return low, cv2.dilate(plane, square)


def texel_index(place: Float32[np.ndarray, "2 ..."], size: int) -> Int64[np.ndarray, "*shape"]:
    """Tell the texel, row * size + column, that a place falls into."""
    column, row = (np.minimum((axis * size).astype(np.int64), size - 1) for axis in place)
    row *= size
    row += column
    return row


def find_positions(iuv: UInt8[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N 3"]:
    """Look up where pixels lie on the layout's body, metres, see `UVTables.position`."""
    positions = load_uv_tables().position
    texels = texel_index(texture_coordinates(iuv), len(positions))
    return positions.reshape(-1, 3)[texels]


def keep_parts(
    iuv: UInt8[np.ndarray, "H W 3"], parts: tuple[int, ...]
) -> UInt8[np.ndarray, "H W 3"]:
    """Turn every pixel of another part into background, (0, 0, 0)."""
    allowed = np.zeros(256, np.uint8)
    allowed[list(parts)] = 1
    return iuv * allowed[iuv[..., :1]]


def extract_texture(
    image: Float32[np.ndarray, "H W C"],
    iuv: UInt8[np.ndarray, "H W 3"],
    size: int,
    *,
    samples_per_texel: float = SAMPLES_PER_TEXEL,
) -> tuple[Float32[np.ndarray, "C T T"], Float32[np.ndarray, "1 T T"]]:
    """Unfold the visible pixels of a photo, see `nhrr_core.extract_texture`.

    Args:
        size: T, side of the texture in texels.
        samples_per_texel: How close points lie at least that fill a texture between pixels, along a
            side; with fewer than the default some texels are missed.
    Returns: The texture, 0 where unseen; and the visibility, 1 where seen and 0 elsewhere.
    """
    place, seen = smooth_coordinates(iuv), iuv[..., 0] > 0
    moved = place - texture_coordinates(iuv)
    total, count = np.zeros((image.shape[-1], size**2)), np.zeros(size**2, np.int64)
    _add(total, count, texel_index(place[:, seen], size), image[seen].T)
    unhit = count == 0  # what is interpolated only fills where no pixel landed
    for steps, row, column in _quads_by_steps(iuv, place, size, samples_per_texel):
        found = list(_fill_points(image, iuv, moved, row, column, steps, unhit, size))
        texels, colours = (np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True))
        _add(total, count, texels, colours)
    texture = (total / np.maximum(count, 1)).astype(np.float32)
    return texture.reshape(-1, size, size), (count > 0).astype(np.float32).reshape(1, size, size)


def _add(
    total: Float64[np.ndarray, "C L"],
    count: Int64[np.ndarray, " L"],
    index: Int64[np.ndarray, " N"],
    values: Float32[np.ndarray, "C N"],
) -> None:
    """Add values to the sums, and 1 each to the counts, that they belong to."""
    count += np.bincount(index, minlength=len(count))
    for own, channel in zip(total, values, strict=True):
        own += np.bincount(index, channel, minlength=len(count))


def _spans(values: Shaped[np.ndarray, "*C H W"]) -> Shaped[np.ndarray, "*C h w"]:
    """The range of values in each quad of four neighbours."""
    across = [extreme(values[..., :-1], values[..., 1:]) for extreme in (np.maximum, np.minimum)]
    highest, lowest = (
        extreme(each[..., :-1, :], each[..., 1:, :])
        for extreme, each in zip((np.maximum, np.minimum), across, strict=True)
    )
    return highest - lowest


def _quads_by_steps(
    iuv: UInt8[np.ndarray, "H W 3"],
    place: Float32[np.ndarray, "2 H W"],
    size: int,
    samples_per_texel: float,
) -> Iterator[tuple[int, Int64[np.ndarray, " Q"], Int64[np.ndarray, " Q"]]]:
    """Quads to fill, as row and column of their first corner, by points along a side."""
    part = iuv[..., 0]
    joined = (part[:-1, :-1] > 0) & (_spans(part) == 0)
    for channel in (1, 2):
        joined &= _spans(iuv[..., channel]) <= MAX_CHART_STEP * 255
    stretch = _spans(place).max(0)
    joined &= stretch <= MAX_STRETCH
    wanted = stretch * size * samples_per_texel
    low, steps = samples_per_texel, 4  # under one texel apart: none lies between
    while low < MAX_STRETCH * size * samples_per_texel:
        row, column = (joined & (wanted > low) & (wanted <= steps)).nonzero()
        if len(row):
            yield steps, row, column
        low, steps = steps, steps * 2


def _fill_points(
    image: Float32[np.ndarray, "H W C"],
    iuv: UInt8[np.ndarray, "H W 3"],
    moved: Float32[np.ndarray, "2 H W"],
    row: Int64[np.ndarray, " Q"],
    column: Int64[np.ndarray, " Q"],
    steps: int,
    unhit: Bool[np.ndarray, " L"],
    size: int,
) -> Iterator[tuple[Int64[np.ndarray, " N"], Float32[np.ndarray, "C N"]]]:
    """Texels and colours of steps x steps points spread evenly inside each quad.

    Those in texels that are hit, about half of them, are left out.

    Args:
        moved: How far from its entry in the table each pixel lies.
    """
    line = ((np.arange(steps) + 0.5) / steps).astype(np.float32)
    down, right = (axis.reshape(-1) for axis in np.meshgrid(line, line, indexing="ij"))
    weights = np.stack([a * b for a in (1 - down, down) for b in (1 - right, right)])
    at_once = max(1, POINTS_AT_ONCE // steps**2)
    for first in range(0, len(row), at_once):
        some = slice(first, first + at_once)
        corners = [(row[some] + below, column[some] + beside) for below, beside in CORNERS]
        part, u, v = (
            np.stack([iuv[corner] for corner in corners], -1).astype(np.float32).swapaxes(0, 1)
        )
        # multiples of a power of two, hence exact
        place = _place_between_entries(part[:, :1], u @ weights, v @ weights)
        place += np.stack([moved[:, *corner] for corner in corners], -1) @ weights
        texel = texel_index(place, size).reshape(-1)
        kept = unhit.take(texel).nonzero()[0]
        colours = np.stack([image[corner] for corner in corners], -1).swapaxes(0, 1)  # C x Q x 4
        yield texel.take(kept), np.stack([(each @ weights).take(kept) for each in colours])


def _place_between_entries(
    part: Float32[np.ndarray, "Q 1"],
    u: Float32[np.ndarray, "Q P"],
    v: Float32[np.ndarray, "Q P"],
) -> Float32[np.ndarray, "2 Q P"]:
    """Texture coordinates of fractional U and V: bilinear, and the nearest entry's across a seam.

    Entries are counted in float32, which holds their number exactly.
    """
    charts, chart = _charts(), (part - 1) * CHART_SIZE**2
    left, top = (np.minimum(np.floor(axis), CHART_SIZE - 2) for axis in (u, v))
    first = (chart + top * CHART_SIZE + left).astype(np.int64)
    right, down = u - left, v - top
    seam = charts.torn.take(first).nonzero()
    nearest = np.rint(v[seam]) * CHART_SIZE + np.rint(u[seam]) + chart[seam[0], 0]
    place = np.empty((2, *u.shape), np.float32)
    for number, axis in enumerate((charts.x, charts.y)):
        # entries further on are looked up from a later beginning
        a, b, c, d = (axis[y * CHART_SIZE + x :].take(first) for y, x in CORNERS)
        _move(a, b, right)
        _move(c, d, right)
        place[number] = _move(a, c, down)
        place[number][seam] = axis[nearest.astype(np.int64)]
    return place


def _move(
    start: Float32[np.ndarray, "Q P"],
    end: Float32[np.ndarray, "Q P"],
    share: Float32[np.ndarray, "Q P"],
) -> Float32[np.ndarray, "Q P"]:
    """Move from start to end by a share, in place: new memory would take most of the time."""
    end -= start
    end *= share
    start += end
    return start


def unfold_clearance(
    clearance: Float32[np.ndarray, "H W"],
    measured: Bool[np.ndarray, "H W"],
    iuv: UInt8[np.ndarray, "H W 3"],
) -> Float32[np.ndarray, "2 128 128"]:
    """Unfold a photo's clearance onto the body's surface, see `nhrr_core.unfold_clearance`."""
    in_units = clearance / np.float32(pixels_per_texel(iuv) * UNIT_TEXELS)
    own = iuv * measured[..., None]
    return np.concatenate(extract_texture(in_units[..., None], own, CLEARANCE_SIZE))


def pixels_per_texel(iuv: UInt8[np.ndarray, "H W 3"]) -> float:
    """Measure how large a body is in its image: the side of a texel of CLEARANCE_SIZE, px."""
    body = iuv[iuv[..., 0] > 0]
    hit = np.zeros(CLEARANCE_SIZE**2, bool)
    hit[texel_index(texture_coordinates(body), CLEARANCE_SIZE)] = True
    return (len(body) / np.count_nonzero(hit)) ** 0.5 if len(body) else 1.0
