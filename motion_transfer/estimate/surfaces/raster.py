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
    corners = points[faces]
    corners[..., :2] -= np.array([box.left + 0.5, box.top + 0.5], np.float32)  # pixels: whole
    flat = corners[..., :2]
    low = np.ceil(flat.min(1)).clip(0).astype(np.int64)
    high = np.floor(flat.max(1)).clip(max=(box.width - 1, box.height - 1)).astype(np.int64)
    size = high - low + 1
    # the share of a corner grows from the side across, which is its own line of the picture
    along = np.roll(flat, -2, axis=1) - np.roll(flat, -1, axis=1)
    area = along[:, 1, 0] * along[:, 2, 1] - along[:, 1, 1] * along[:, 2, 0]
    shown = np.flatnonzero((area > LEAST_AREA) & (size > 0).all(1))
    # every pixel of every triangle's own box, one row each
    counts = size[shown].prod(1)
    which = np.repeat(shown, counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(number, size[which, 0])
    x, y = column + low[which, 0], row + low[which, 1]
    normal = along[..., ::-1] * np.array([-1, 1], np.float32) / area.clip(LEAST_AREA)[:, None, None]
    offset = (normal * np.roll(flat, -1, axis=1)).sum(-1)
    shares = normal[which, :, 0] * x[:, None] + normal[which, :, 1] * y[:, None] - offset[which]
    inside = (shares >= 0).all(1)
    which, x, y, shares = which[inside], x[inside], y[inside], shares[inside].astype(np.float32)
    depth = np.einsum("nc,nc->n", shares, corners[which, :, 2])
    order = np.argsort(-depth, kind="stable")  # of those at one pixel the last one stays
    nearest = np.full((box.height, box.width), -1, np.int64)
    nearest[y[order], x[order]] = order
    covered: Bool[np.ndarray, "h w"] = nearest >= 0
    chosen = nearest[covered]
    drawn[covered, 0] = part[which[chosen]]
    places = np.einsum("nc,ncu->nu", shares[chosen], uv[which[chosen]].astype(np.float32))
    drawn[covered, 1:] = np.rint(places)
    return drawn
