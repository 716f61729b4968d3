"""Triangles to pixels, on the CPU, with a depth buffer.

Kernels are compiled by `warp` on first use (seconds, then kept on disk).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from jaxtyping import Float32, Int32, UInt64

from motion_transfer.people.body import Faces
from motion_transfer.people.extra import start_warp

start_warp()

EMPTY = np.uint64(0xFFFFFFFFFFFFFFFF)


@dataclass(frozen=True)
class Layer:
    """Triangles on the picture plane.

    Attributes:
        screen: V x 3: pixel x, pixel y, depth (> 0 in front of the camera).
        faces: triangles.
        keep: V, or None for everything: fragments where its interpolation is < 0 are left out.
        cull: leave out triangles seen from behind.
    """

    screen: Float32[np.ndarray, "V 3"]
    faces: Faces
    keep: Float32[np.ndarray, " V"] | None = None
    cull: bool = True


@wp.kernel(enable_backward=False)
def _fill(
    screen: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    keep: wp.array(dtype=wp.float32),
    cull: wp.int32,
    first_id: wp.int32,
    width: wp.int32,
    height: wp.int32,
    nearest: wp.array(dtype=wp.uint64),
):
    f = wp.tid()
    corners = faces[f]
    a, b, c = screen[corners[0]], screen[corners[1]], screen[corners[2]]
    if a[2] <= 0.0 or b[2] <= 0.0 or c[2] <= 0.0:
        return
    # twice the signed area; y points down, so outward (counter-clockwise) faces are negative
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    if area == 0.0 or (cull != 0 and area > 0.0):
        return
    ka, kb, kc = keep[corners[0]], keep[corners[1]], keep[corners[2]]
    if ka < 0.0 and kb < 0.0 and kc < 0.0:
        return
    x0 = wp.max(int(wp.ceil(wp.min(a[0], wp.min(b[0], c[0])) - 0.5)), 0)
    x1 = wp.min(int(wp.floor(wp.max(a[0], wp.max(b[0], c[0])) - 0.5)), width - 1)
    y0 = wp.max(int(wp.ceil(wp.min(a[1], wp.min(b[1], c[1])) - 0.5)), 0)
    y1 = wp.min(int(wp.floor(wp.max(a[1], wp.max(b[1], c[1])) - 0.5)), height - 1)
    ia, ib, ic = 1.0 / a[2], 1.0 / b[2], 1.0 / c[2]
    for y in range(y0, y1 + 1):
        py = float(y) + 0.5
        for x in range(x0, x1 + 1):
            px = float(x) + 0.5
            wb = ((px - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (py - a[1])) / area
            wc = ((b[0] - a[0]) * (py - a[1]) - (px - a[0]) * (b[1] - a[1])) / area
            wa = 1.0 - wb - wc
            if wa >= 0.0 and wb >= 0.0 and wc >= 0.0:
                if wa * ka + wb * kb + wc * kc >= 0.0:
                    z = 1.0 / (wa * ia + wb * ib + wc * ic)
                    # positive floats sort as their bits do: depth above, triangle below
                    bits = wp.uint64(wp.cast(z, wp.uint32))
                    packed = (bits << wp.uint64(32)) | wp.uint64(first_id + f)
                    wp.atomic_min(nearest, y * width + x, packed)


def rasterise(layers: Sequence[Layer], width: int, height: int) -> UInt64[np.ndarray, " H*W"]:
    """Which triangle each pixel centre sees first.

    Triangles are numbered through all layers in their order.

    Returns: H * W values, row by row: the bits of the float32 depth above 32 bits of the triangle's
    number; all ones where nothing is seen. `triangle_ids` and `depths` take them apart.
    """
    nearest = wp.full(width * height, wp.uint64(EMPTY), dtype=wp.uint64, device="cpu")
    first_id = 0
    for layer in layers:
        keep = np.ones(len(layer.screen), np.float32) if layer.keep is None else layer.keep
        inputs = [
            share_array(layer.screen, wp.vec3),
            share_array(layer.faces, wp.vec3i),
            share_array(keep, wp.float32),
            int(layer.cull),
            first_id,
            width,
            height,
        ]
        wp.launch(_fill, len(layer.faces), inputs=inputs, outputs=[nearest], device="cpu")
        first_id += len(layer.faces)
    return nearest.numpy()


def share_array(array: np.ndarray, dtype: type) -> wp.array:
    """A warp array over NumPy's own memory; the caller keeps that alive while kernels run."""
    return wp.array(np.ascontiguousarray(array), dtype=dtype, device="cpu", copy=False)


def triangle_ids(nearest: UInt64[np.ndarray, " N"]) -> Int32[np.ndarray, " N"]:
    """The triangle's number at each pixel, -1 where nothing is seen."""
    return nearest.astype(np.uint32).view(np.int32)


def depths(nearest: UInt64[np.ndarray, " N"]) -> Float32[np.ndarray, " N"]:
    """Depth at each pixel, NaN where nothing is seen."""
    return (nearest >> np.uint64(32)).astype(np.uint32).view(np.float32)
