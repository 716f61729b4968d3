"""Triangles to pixels, on the CPU, with a depth buffer.

Kernels are compiled by `warp` on first use (seconds, then kept on disk).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp
from jaxtyping import Float32, Int32, UInt8, UInt64

from motion_transfer.people.figure.body import Faces, Points
from motion_transfer.people.figure.raster_kernels import fill

EMPTY = np.uint64(0xFFFFFFFFFFFFFFFF)
"""A pixel that no triangle covers; larger than any depth, so that the nearest wins over it."""


@dataclass(frozen=True)
class Triangles:
    """What is drawn, but for where it lies.

    Attributes:
        keep: Of each vertex; fragments where its interpolation is < 0 are left out. None: all stay.
        cull: Of each triangle: 1 leaves it out when it is seen from behind. None: all of them.
    """

    faces: Faces
    keep: Float32[np.ndarray, " V"] | None = None
    cull: UInt8[np.ndarray, " F"] | None = None

    @classmethod
    def two_sided(cls, faces: Faces, keep: Float32[np.ndarray, " V"] | None = None) -> Triangles:
        """Make triangles that are seen from both sides."""
        return cls(np.ascontiguousarray(faces), keep, np.zeros(len(faces), np.uint8))

    @cached_property
    def arrays(self) -> tuple[wp.array, wp.array, wp.array]:
        """Faces, keep and cull for kernels, sharing NumPy's memory."""
        vertices = int(self.faces.max()) + 1 if len(self.faces) else 0
        keep = np.ones(vertices, np.float32) if self.keep is None else self.keep
        cull = np.ones(len(self.faces), np.uint8) if self.cull is None else self.cull
        return (
            share_array(self.faces, wp.vec3i),
            share_array(keep, wp.float32),
            share_array(cull, wp.uint8),
        )


def rasterise(
    screen: Points, triangles: Triangles, width: int, height: int
) -> UInt64[np.ndarray, " H*W"]:
    """Find which triangle each pixel centre sees first.

    Args:
        screen: Vertices: pixel x, pixel y, depth (> 0 in front of the camera).
    Returns: H * W values, row by row: the bits of the float32 depth above 32 bits of the triangle's
        number; all ones where nothing is seen. `triangle_ids` and `depths` take them apart.
    """
    nearest = wp.full(width * height, wp.uint64(int(EMPTY)), dtype=wp.uint64, device="cpu")
    inputs = [share_array(screen, wp.vec3), *triangles.arrays, width, height]
    wp.launch(fill, len(triangles.faces), inputs=inputs, outputs=[nearest], device="cpu")
    return nearest.numpy()


def share_array(array: np.ndarray, dtype: type) -> wp.array:
    """Wrap NumPy's own memory for warp; the caller keeps it alive while kernels run."""
    return wp.array(np.ascontiguousarray(array), dtype=dtype, device="cpu", copy=False)


def triangle_ids(nearest: UInt64[np.ndarray, " N"]) -> Int32[np.ndarray, " N"]:
    """Take out the triangle's number at each pixel, -1 where nothing is seen."""
    return nearest.astype(np.uint32).view(np.int32)


def depths(nearest: UInt64[np.ndarray, " N"]) -> Float32[np.ndarray, " N"]:
    """Take out the depth at each pixel, NaN where nothing is seen."""
    return (nearest >> np.uint64(32)).astype(np.uint32).view(np.float32)
