"""The exact IUV of a posed body: what DensePose would say if it made no mistakes."""

from __future__ import annotations

import numpy as np
import warp as wp
from jaxtyping import UInt8

from motion_transfer.people.figure.body import Faces, Points
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.charts import BodyCharts
from motion_transfer.people.figure.raster_kernels import draw_charts
from motion_transfer.people.figure.rasterise import Triangles, rasterise, share_array


def render_iuv(
    points: Points, faces: Faces, charts: BodyCharts, camera: Camera
) -> UInt8[np.ndarray, "H W 3"]:
    """Draw the bare body's charts; clothes and hair are not there, as DensePose sees through them.

    Args:
        points: of the posed skin.
        charts: of each of the faces.
    Returns: (I, U, V) at pixel centres; 0 where nobody is.
    """
    screen = camera.project(points)
    triangles = Triangles(faces)
    nearest = rasterise(screen, triangles, camera.width, camera.height)
    iuv = np.zeros((camera.height * camera.width, 3), np.uint8)
    inputs = [
        share_array(nearest, wp.uint64),
        share_array(screen, wp.vec3),
        triangles.arrays[0],
        share_array(charts.part, wp.uint8),
        share_array(charts.uv, wp.vec2),
        camera.width,
    ]
    outputs = [share_array(iuv, wp.uint8)]
    wp.launch(draw_charts, len(nearest), inputs=inputs, outputs=outputs, device="cpu")
    return iuv.reshape(camera.height, camera.width, 3)
