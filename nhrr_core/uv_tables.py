"""DensePose's 24 charts folded into one texture of SMPL's, SURREAL's, through a lookup table.

Convention: a place in the texture is (x, y) in [0, 1], x to the right, y down, so the centre of the
texel in column c and row r of a T x T texture is ((c + 0.5) / T, (r + 0.5) / T).
Source: the paper, Sec. 3.1. The table is built by `tools/build_uv_layout.py`.

Arrays, so that whoever draws without a network has no torch to load; `uv_layout` has the tensors.
"""

from __future__ import annotations

import lzma
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from jaxtyping import Float32, Int64, UInt16

from nhrr_core.parts import PART_COUNT

CHART_SIZE = 256  # entries along a chart: every value of 8 bits that U and V can take
TWIN_SIZE = 256  # texels along the tables of the texture, the paper's size of it

# How a photo is unfolded: see `extract_texture`. Chosen by eye, like all numbers there.

MAX_CHART_STEP = 0.15
"""Neighbouring pixels whose U or V, in [0, 1], differ by more lie on separate pieces of surface."""

MAX_STRETCH = 1 / 16
"""Neighbours that land further apart in the texture, as a share of its side, do so, too."""

MAX_ENTRY_STEP = 0.03
"""Neighbouring entries of the lookup table further apart lie on two sides of a texture seam."""

SAMPLES_PER_TEXEL = 3.0
"""How dense points fill between pixels along each axis: no texel is missed where charts bend."""

# How finely pixels lie in the texture: see `smooth_coordinates`. Measured on real photos.

WORD = 65535
"""Charts are kept in words of 16 bits: sums of some of these are exact, in whatever order."""

SMOOTHED_OVER = (3, 7)
"""Sides of the squares, px, over which places are averaged."""

MAX_SPREAD = 0.03
"""A square whose places lie further apart, as a share of the texture's side, may hold a seam."""


@dataclass(frozen=True)
class UVTables:
    """The tables that tie charts, texture and the body's symmetry together.

    Attributes:
        charts: 24 x 256 x 256 x 2, float32: `charts[part - 1, V, U]` is the (x, y) in the texture.
            Entries that no surface covers repeat the nearest covered one.
        side_twin: 256 x 256, int64: for each texel, the one (row * 256 + column) that shows the
            same place mirrored left-right.
        depth_twin: 256 x 256, int64: the same, mirrored front-back within the limb; on the head the
            texel itself.
        position: 256 x 256 x 3, float32, metres: where each texel lies on a body in T-pose. Texels
            outside every chart repeat the nearest one inside, here and in the other tables.
        part: 256 x 256, int64: the part that each texel belongs to, 1..24.
    """

    charts: Float32[np.ndarray, "24 256 256 2"]
    side_twin: Int64[np.ndarray, "256 256"]
    depth_twin: Int64[np.ndarray, "256 256"]
    position: Float32[np.ndarray, "256 256 3"]
    part: Int64[np.ndarray, "256 256"]


@cache
def load_uv_tables() -> UVTables:
    """Read the tables that ship with the package, once per process."""
    # 16-bit words; smooth tables are stored as differences along rows, which pack well
    packed = lzma.decompress(files("nhrr_core").joinpath("uv_layout.bin").read_bytes())
    texels = TWIN_SIZE**2
    lengths = [2 * PART_COUNT * CHART_SIZE**2, texels, texels, 3 * texels]
    tables = np.split(np.frombuffer(packed, "<u2"), np.cumsum(lengths))
    chart_words, side, depth, position_words, part = tables
    charts = _undo_differences(chart_words.reshape(2, PART_COUNT, CHART_SIZE, CHART_SIZE))
    # tenths of a millimetre, signed
    tenths = _undo_differences(position_words.reshape(3, TWIN_SIZE, TWIN_SIZE)).view(np.int16)
    return UVTables(
        charts=np.ascontiguousarray(np.moveaxis(charts, 0, -1), np.float32) / np.float32(WORD),
        side_twin=side.reshape(TWIN_SIZE, TWIN_SIZE).astype(np.int64),
        depth_twin=depth.reshape(TWIN_SIZE, TWIN_SIZE).astype(np.int64),
        position=np.ascontiguousarray(np.moveaxis(tenths, 0, -1), np.float32) / np.float32(10_000),
        part=part.reshape(TWIN_SIZE, TWIN_SIZE).astype(np.int64),
    )


def _undo_differences(words: UInt16[np.ndarray, "*shape"]) -> UInt16[np.ndarray, "*shape"]:
    """Rows of 16-bit differences back to values."""
    return words.cumsum(-1, np.uint16)
