"""Charted triangles to an IUV image, with depth, in NumPy: some thousands in milliseconds."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float32, Int64, UInt8

from motion_transfer.drawing.person import Box

LEAST_AREA = 1e-6  # px², twice a triangle's; smaller ones are seen from their edge


def draw_charts(
    points: Float32[np.ndarray, "V 3"],
    faces: Int64[np.ndarray, "F 3"],
    part: UInt8[np.ndarray, " F"],
    uv: UInt8[np.ndarray, "F 3 2"],
    box: Box,
) -> UInt8[np.ndarray, "h w 3"]:
    """Draw what pixel centres of a box see of triangles; 0 where none is.

    Args:
        points: X and y in frame pixels, depth larger farther away.
        faces: Clockwise in the picture where they are seen from outside; others are left out.
        part, uv: Of each triangle, and of its corners.
    """
    drawn = np.zeros((box.height, box.width, 3), np.uint8)
    flat = points[:, :2] - np.array([box.left + 0.5, box.top + 0.5], np.float32)  # pixels: whole
    x, y = (np.ascontiguousarray(flat[:, axis])[faces.T] for axis in (0, 1))
    # the share of a corner grows from the side across, which is its own line of the picture
    dx, dy = (np.stack([c[2] - c[1], c[0] - c[2], c[1] - c[0]]) for c in (x, y))
    area = dx[1] * dy[2] - dy[1] * dx[2]
    left, top = (np.ceil(c.min(0)).clip(0).astype(np.int64) for c in (x, y))
    width, height = (
        (np.floor(c.max(0)).clip(max=most - 1).astype(np.int64) - first + 1).clip(0)
        for c, first, most in ((x, left, box.width), (y, top, box.height))
    )
    shown = np.flatnonzero((area > LEAST_AREA) & (width > 0) & (height > 0))
    # rows of triangles' own boxes, then their pixels: one number each
    line, row = _count_up(height[shown])
    which, column = _count_up(width[shown[line]])
    triangle = shown[line[which]]
    px, py = (left[triangle] + column).astype(np.int32), (top[shown[line]] + row)[which]
    shares: list[np.ndarray] = []
    for corner in range(3):
        across, other = -dy[corner] / area.clip(LEAST_AREA), (corner + 1) % 3
        down = dx[corner] / area.clip(LEAST_AREA)
        start = -across * x[other] - down * y[other]
        share = across[triangle] * px + down[triangle] * py + start[triangle]
        inside = share >= 0
        triangle, px, py = triangle[inside], px[inside], py[inside]
        shares = [each[inside] for each in (*shares, share)]
    depths = points[:, 2][faces.T]
    depth = sum(share * depths[corner, triangle] for corner, share in enumerate(shares))
    order = np.argsort(-depth, kind="stable")  # of those at one pixel the last one stays
    nearest = np.full((box.height, box.width), -1, np.int64)
    nearest[py[order], px[order]] = order
    covered: Bool[np.ndarray, "h w"] = nearest >= 0
    chosen = nearest[covered]
    drawn[covered, 0] = part[triangle[chosen]]
    places = uv[triangle[chosen]].astype(np.float32)
    mixed = sum(share[chosen, None] * places[:, corner] for corner, share in enumerate(shares))
    drawn[covered, 1:] = np.rint(mixed)
    return drawn


def _count_up(
    counts: Int64[np.ndarray, " N"],
) -> tuple[Int64[np.ndarray, " M"], Int64[np.ndarray, " M"]]:
    """List so many of each of N things: which it is, and the how many-th of it."""
    which = np.repeat(np.arange(len(counts)), counts)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
