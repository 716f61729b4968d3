"""DensePose's charts on the body's triangles.

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
from jaxtyping import Float32, UInt8

WORD_MAX = 65535
TRIANGLE_BYTES = 1 + 3 * 2 * 2


@dataclass(frozen=True)
class BodyCharts:
    """Which chart each triangle of the body belongs to, and where on it.

    Attributes:
        part: of each triangle, 1..24.
        uv: (U, V) of its three corners, in [0, 1]. Corners that triangles of one part share have
            the same; at the border of two parts they differ.
    """

    part: UInt8[np.ndarray, " F"]
    uv: Float32[np.ndarray, "F 3 2"]


@cache
def load_charts() -> BodyCharts:
    """The table that ships with the package, read once per process; its arrays are read-only."""
    return unpack_charts(
        files("motion_transfer.people.figure").joinpath("body_charts.bin").read_bytes()
    )


def unpack_charts(packed: bytes) -> BodyCharts:
    """The table inside a file's content.

    Raises: lzma.LZMAError or ValueError where the content is no such file.
    """
    payload = lzma.decompress(packed)
    count, rest = divmod(len(payload), TRIANGLE_BYTES)
    if rest:
        raise ValueError(
            f"a chart table holds {TRIANGLE_BYTES} bytes a triangle; {len(payload)} bytes are no "
            f"multiple of it: build the file anew with tools/build_body_charts.py"
        )
    words = np.frombuffer(payload, "<u2", offset=count).reshape(count, 3, 2)
    uv = words.astype(np.float32) / np.float32(WORD_MAX)
    uv.setflags(write=False)
    return BodyCharts(np.frombuffer(payload, np.uint8, count), uv)
