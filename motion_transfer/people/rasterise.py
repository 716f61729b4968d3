"""Triangles to pixels, on the CPU, with a depth buffer.

Kernels are compiled by `warp` on first use (seconds, then kept on disk).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp
from jaxtyping import Float32, Int32, UInt8, UInt64

from motion_transfer.people.body import Faces
from motion_transfer.people.extra import start_warp

start_warp()

EMPTY = np.uint64(0xFFFFFFFFFFFFFFFF)


@dataclass(frozen=True)
class Triangles:
    """What is drawn, but for where it lies.

    Attributes:
        faces: triangles.
        keep: of each vertex; fragments where its interpolation is < 0 are left out. None: all stay.
        cull: of each triangle: 1 leaves it out when it is seen from behind. None: all of them.
    """

    faces: Faces
    keep: Float32[np.ndarray, " V"] | None = None
    cull: UInt8[np.ndarray, " F"] | None = None

    @classmethod
    def two_sided(cls, faces: Faces, keep: Float32[np.ndarray, " V"] | None = None) -> Triangles:
        """Seen from both sides."""
        return cls(np.ascontiguousarray(faces), keep, np.zeros(len(faces), np.uint8))

    @cached_property
    def arrays(self) -> tuple[wp.array, wp.array, wp.array]:
        """The same for kernels, shared with NumPy."""
        vertices = int(self.faces.max()) + 1 if len(self.faces) else 0
        keep = np.ones(vertices, np.float32) if self.keep is None else self.keep
        cull = np.ones(len(self.faces), np.uint8) if self.cull is None else self.cull
        return (
            share_array(self.faces, wp.vec3i),
            share_array(keep, wp.float32),
            share_array(cull, wp.uint8),
        )


@wp.kernel(enable_backward=False)
def _fill(
    screen: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    keep: wp.array(dtype=wp.float32),
    cull: wp.array(dtype=wp.uint8),
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
    if area == 0.0 or (area > 0.0 and cull[f] != wp.uint8(0)):
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
                    packed = (bits << wp.uint64(32)) | wp.uint64(f)
                    wp.atomic_min(nearest, y * width + x, packed)


def rasterise(
    screen: Float32[np.ndarray, "V 3"], triangles: Triangles, width: int, height: int
) -> UInt64[np.ndarray, " H*W"]:
    """Which triangle each pixel centre sees first.

    Args:
        screen: vertices as pixel x, pixel y, depth (> 0 in front of the camera).
    Returns: H * W values, row by row: the bits of the float32 depth above 32 bits of the triangle's
        number; all ones where nothing is seen. `triangle_ids` and `depths` take them apart.
    """
    nearest = wp.full(width * height, wp.uint64(EMPTY), dtype=wp.uint64, device="cpu")
    inputs = [share_array(screen, wp.vec3), *triangles.arrays, width, height]
    wp.launch(_fill, len(triangles.faces), inputs=inputs, outputs=[nearest], device="cpu")
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
