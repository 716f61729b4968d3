"""Slow, obvious versions of the texture and the sampler: one pixel, quad, point at a time.

They are the specification: the fast versions must equal them in values and in gradients. The
numbers are written out again here on purpose, so that changing them in one place only is noticed.
"""

from __future__ import annotations

import math
from collections import defaultdict

import torch
from torch import Tensor

MAX_CHART_STEP = 0.15 * 255
MAX_STRETCH = 1 / 16
SAMPLES_PER_TEXEL = 3.0
MAX_ENTRY_STEP = 0.03
SQUARES = (7, 3)
MAX_SPREAD = 0.03


def extract_texture_loops(
    image: Tensor, iuv: Tensor, charts: Tensor, size: int
) -> tuple[Tensor, Tensor]:
    """B x C x H x W pixels to B x C x T x T texel means and B x 1 x T x T visibility."""
    batch, channels, height, width = image.shape
    texture = torch.zeros(batch, channels, size, size, dtype=image.dtype)
    visibility = torch.zeros(batch, 1, size, size, dtype=image.dtype)
    for b in range(batch):
        pixels: dict[tuple[int, int], list[Tensor]] = defaultdict(list)
        points: dict[tuple[int, int], list[Tensor]] = defaultdict(list)
        for y in range(height):
            for x in range(width):
                if iuv[b, 0, y, x] > 0:
                    place = smooth_place(iuv[b], charts, y, x)
                    pixels[_texel(place, size)].append(image[b, :, y, x])
        for y in range(height - 1):
            for x in range(width - 1):
                for texel, colour in _points_of_quad(image[b], iuv[b], charts, size, y, x):
                    points[texel].append(colour)
        for row in range(size):
            for column in range(size):
                landed = pixels.get((row, column)) or points.get((row, column))
                if landed:
                    texture[b, :, row, column] = sum(landed[1:], landed[0]) / len(landed)
                    visibility[b, 0, row, column] = 1
    return texture, visibility


def sample_features_loops(feature_map: Tensor, iuv: Tensor, charts: Tensor) -> Tensor:
    """Bilinear look-up by hand, constant beyond the outermost texel centres, 0 on background."""
    batch, _, height, width = iuv.shape
    maps, channels, rows, columns = feature_map.shape
    out = torch.zeros(batch, channels, height, width, dtype=feature_map.dtype)
    for b in range(batch):
        texels = feature_map[b if maps > 1 else 0]
        for y in range(height):
            for x in range(width):
                if iuv[b, 0, y, x] == 0:
                    continue
                across, down = smooth_place(iuv[b], charts, y, x)
                left, right, to_right = _between_centres(across, columns)
                top, bottom, to_bottom = _between_centres(down, rows)
                out[b, :, y, x] = (
                    texels[:, top, left] * (1 - to_bottom) * (1 - to_right)
                    + texels[:, top, right] * (1 - to_bottom) * to_right
                    + texels[:, bottom, left] * to_bottom * (1 - to_right)
                    + texels[:, bottom, right] * to_bottom * to_right
                )
    return out


def smooth_place(iuv: Tensor, charts: Tensor, y: int, x: int) -> tuple[float, float]:
    """Where a pixel lies: the mean of the largest square of one part and without a tear."""
    part = int(iuv[0, y, x])
    for side in SQUARES:
        reach = side // 2
        rows, columns = (range(at - reach, at + reach + 1) for at in (y, x))
        if min(rows[0], columns[0]) < 0:
            continue
        if rows[-1] >= iuv.shape[1] or columns[-1] >= iuv.shape[2]:
            continue
        around = [iuv[:, row, column].tolist() for row in rows for column in columns]
        if any(other != part for other, _, _ in around):
            continue
        across, down = zip(*(_place(charts, *pixel) for pixel in around), strict=True)
        if max(max(axis) - min(axis) for axis in (across, down)) <= MAX_SPREAD:
            return sum(across) / len(around), sum(down) / len(around)
    return _place(charts, *iuv[:, y, x].tolist())


def _points_of_quad(
    image: Tensor, iuv: Tensor, charts: Tensor, size: int, y: int, x: int
) -> list[tuple[tuple[int, int], Tensor]]:
    """Texel and colour of the points that fill between four neighbouring pixel centres."""
    corners = [(y, x), (y, x + 1), (y + 1, x), (y + 1, x + 1)]
    parts, us, vs = zip(*(iuv[:, row, column].tolist() for row, column in corners), strict=True)
    if parts[0] == 0 or len(set(parts)) > 1:
        return []
    if max(us) - min(us) > MAX_CHART_STEP or max(vs) - min(vs) > MAX_CHART_STEP:
        return []
    entries = [_place(charts, *corner) for corner in zip(parts, us, vs, strict=True)]
    places = [smooth_place(iuv, charts, row, column) for row, column in corners]
    stretch = max(max(axis) - min(axis) for axis in zip(*places, strict=True))
    if stretch > MAX_STRETCH or stretch * size <= 1:
        return []
    steps = 4
    while steps < stretch * size * SAMPLES_PER_TEXEL:
        steps *= 2
    points = []
    for i in range(steps):
        for j in range(steps):
            down, right = (i + 0.5) / steps, (j + 0.5) / steps
            weights = [
                (1 - down) * (1 - right),
                (1 - down) * right,
                down * (1 - right),
                down * right,
            ]
            u = sum(w * u for w, u in zip(weights, us, strict=True))
            v = sum(w * v for w, v in zip(weights, vs, strict=True))
            colour = torch.zeros_like(image[:, y, x])
            for weight, (row, column) in zip(weights, corners, strict=True):
                colour = colour + weight * image[:, row, column]
            across, down = _place_between(charts, parts[0], u, v)
            for weight, (from_x, from_y), (to_x, to_y) in zip(
                weights, entries, places, strict=True
            ):
                across += weight * (to_x - from_x)
                down += weight * (to_y - from_y)
            points.append((_texel((across, down), size), colour))
    return points


def _place_between(charts: Tensor, part: int, u: float, v: float) -> tuple[float, float]:
    """The place of a U and V between entries: bilinear, or the nearest entry's across a seam."""
    left, top = (min(math.floor(value), 254) for value in (u, v))
    corners = [_place(charts, part, left + x, top + y) for y in (0, 1) for x in (0, 1)]
    if max(max(axis) - min(axis) for axis in zip(*corners, strict=True)) > MAX_ENTRY_STEP:
        return _place(charts, part, round(u), round(v))
    right, down = u - left, v - top
    weights = [(1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right]
    x, y = (
        sum(w * value for w, value in zip(weights, axis, strict=True))
        for axis in zip(*corners, strict=True)
    )
    return x, y


def _place(charts: Tensor, part: int, u: int, v: int) -> tuple[float, float]:
    x, y = charts[part - 1, v, u].tolist()
    return x, y


def _texel(place: tuple[float, float], size: int) -> tuple[int, int]:
    """(row, column) of the texel around a place."""
    column, row = (min(math.floor(axis * size), size - 1) for axis in place)
    return row, column


def _between_centres(place: float, length: int) -> tuple[int, int, float]:
    """The two texels whose centres a place lies between, and how far it is on the way."""
    position = min(max(place * length - 0.5, 0.0), length - 1.0)
    first = math.floor(position)
    return first, min(first + 1, length - 1), position - first
