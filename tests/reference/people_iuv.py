"""The exact IUV, in NumPy and one step at a time."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.people.figure.body import Faces, Points
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.charts import BodyCharts
from motion_transfer.people.figure.rasterise import Triangles, rasterise, triangle_ids


def reference_iuv(
    points: Points, faces: Faces, charts: BodyCharts, camera: Camera
) -> UInt8[np.ndarray, "H W 3"]:
    """As `render_iuv`."""
    screen = camera.project(points)
    face = triangle_ids(rasterise(screen, Triangles(faces), camera.width, camera.height))
    pixel = np.flatnonzero(face >= 0)
    face = face[pixel]
    weights = barycentric(screen[faces[face]], pixel, camera.width)
    chart = np.einsum("pk,pkc->pc", weights, charts.uv[face])
    iuv = np.zeros((camera.height * camera.width, 3), np.uint8)
    iuv[pixel, 0] = charts.part[face]
    iuv[pixel, 1:] = np.rint(np.clip(chart, 0, 1) * 255)
    return iuv.reshape(camera.height, camera.width, 3)


def barycentric(
    corners: Float32[np.ndarray, "P 3 3"], pixel: np.ndarray, width: int
) -> Float32[np.ndarray, "P 3"]:
    """Where pixel centres lie in their triangles, seen in perspective.

    Args:
        corners: each pixel's triangle on the picture plane: three corners of x, y, depth.
        pixel: indices, row by row, in a picture of that width.
    """
    centre = np.stack([pixel % width + 0.5, pixel // width + 0.5], 1).astype(np.float32)
    (a, b, c), (za, zb, zc) = corners[..., :2].transpose(1, 0, 2), corners[..., 2].T
    ab, ac, ap = b - a, c - a, centre - a
    area = ab[:, 0] * ac[:, 1] - ac[:, 0] * ab[:, 1]
    wb = (ap[:, 0] * ac[:, 1] - ac[:, 0] * ap[:, 1]) / area
    wc = (ab[:, 0] * ap[:, 1] - ap[:, 0] * ab[:, 1]) / area
    weights = np.stack([(1 - wb - wc) / za, wb / zb, wc / zc], 1)
    return weights / weights.sum(1, keepdims=True)
