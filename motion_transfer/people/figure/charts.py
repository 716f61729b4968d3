"""DensePose's charts on the body's triangles, and the exact IUV of a posed body drawn from them.

The IUV is what DensePose would say if it made no mistakes: that of the bare body, as DensePose
sees through clothes and hair.

The file `body_charts.bin` is LZMA-compressed. Inside lie, for F triangles in the order of the body
model's faces and without a header: F bytes, the part of each triangle; then F x 3 x 2 little-endian
16-bit words, U and V of its three corners in the order of the face, 65535 standing for 1. It is
written by `tools/build_body_charts.py`.
"""

from __future__ import annotations

import lzma
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
import warp as wp
from jaxtyping import Float32, UInt8

from motion_transfer.people.figure.body import Faces, Points
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.raster_kernels import draw_charts
from motion_transfer.people.figure.rasterise import Triangles, rasterise, share_array

_WORD_MAX = 65535
_TRIANGLE_BYTES = 1 + 3 * 2 * 2  # its part, and two words for each corner


@dataclass(frozen=True)
class BodyCharts:
    """Which chart each triangle of the body belongs to, and where on it.

    Attributes:
        part: Of each triangle, 1..24.
        uv: (U, V) of its three corners, in [0, 1]. Corners that triangles of one part share have
            the same; at the border of two parts they differ.
    """

    part: UInt8[np.ndarray, " F"]
    uv: Float32[np.ndarray, "F 3 2"]


@cache
def load_charts() -> BodyCharts:
    """Load the table that ships with the package, once a process; its arrays are read-only."""
    folder = files("motion_transfer.people.figure")
    return unpack_charts(folder.joinpath("body_charts.bin").read_bytes())


def unpack_charts(packed: bytes) -> BodyCharts:
    """Read the table out of a file's content.

    Raises: lzma.LZMAError or ValueError where the content is no such file.
    """
    payload = lzma.decompress(packed)
    count, rest = divmod(len(payload), _TRIANGLE_BYTES)
    if rest:
        raise ValueError(
            f"a chart table holds {_TRIANGLE_BYTES} bytes a triangle; {len(payload)} bytes are no "
            f"multiple of it: build the file anew with tools/build_body_charts.py"
        )
    words = np.frombuffer(payload, "<u2", offset=count).reshape(count, 3, 2)
    uv = words.astype(np.float32) / np.float32(_WORD_MAX)
    uv.setflags(write=False)
    return BodyCharts(np.frombuffer(payload, np.uint8, count), uv)


def render_iuv(
    points: Points, faces: Faces, charts: BodyCharts, camera: Camera
) -> UInt8[np.ndarray, "H W 3"]:
    """Draw the charts of a bare body.

    Args:
        points: Of the posed skin.
        charts: Of each of the faces.
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
