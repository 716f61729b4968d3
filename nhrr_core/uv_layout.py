"""DensePose's 24 charts folded into one texture of SMPL's, SURREAL's, through a lookup table.

Convention: a place in the texture is (x, y) in [0, 1], x to the right, y down, so the centre of the
texel in column c and row r of a T x T texture is ((c + 0.5) / T, (r + 0.5) / T).
Source: the paper, Sec. 3.1. The table is built by `tools/build_uv_layout.py`.
"""

from __future__ import annotations

import lzma
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from nhrr_core.iuv import PART_COUNT

CHART_SIZE = 256  # entries along a chart: every value of 8 bits that U and V can take
TWIN_SIZE = 256  # texels along the tables of the texture, the paper's size of it


@dataclass(frozen=True)
class UVLayout:
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

    charts: Float[Tensor, "24 256 256 2"]
    side_twin: Int64[Tensor, "256 256"]
    depth_twin: Int64[Tensor, "256 256"]
    position: Float[Tensor, "256 256 3"]
    part: Int64[Tensor, "256 256"]


@cache
def load_uv_layout() -> UVLayout:
    """Read the tables that ship with the package, once per process."""
    # 16-bit words; smooth tables are stored as differences along rows, which pack well
    packed = lzma.decompress(files("nhrr_core").joinpath("uv_layout.bin").read_bytes())
    words = torch.frombuffer(bytearray(packed), dtype=torch.int16).to(torch.int32) & 0xFFFF
    texels = TWIN_SIZE**2
    chart_words, side, depth, position_words, part = words.split(
        [2 * PART_COUNT * CHART_SIZE**2, texels, texels, 3 * texels, texels]
    )
    charts = _undo_differences(chart_words.view(2, PART_COUNT, CHART_SIZE, CHART_SIZE))
    # tenths of a millimetre, signed
    tenths = _undo_differences(position_words.view(3, TWIN_SIZE, TWIN_SIZE)).to(torch.int16)
    return UVLayout(
        charts=(charts.permute(1, 2, 3, 0).float() / 65535).contiguous(),
        side_twin=side.view(TWIN_SIZE, TWIN_SIZE).long(),
        depth_twin=depth.view(TWIN_SIZE, TWIN_SIZE).long(),
        position=(tenths.permute(1, 2, 0).float() / 10_000).contiguous(),
        part=part.view(TWIN_SIZE, TWIN_SIZE).long(),
    )


def _undo_differences(words: Tensor) -> Tensor:
    """Rows of 16-bit differences back to values."""
    return words.cumsum(-1) & 0xFFFF


def chart_index(
    part: Int64[Tensor, "*shape"], u: Int64[Tensor, "*shape"], v: Int64[Tensor, "*shape"]
) -> Int64[Tensor, "*shape"]:
    """Compute the row of `charts`, flattened to N x 2; the background, 0, falls on part 1."""
    return ((part - 1).clamp_min(0) * CHART_SIZE + v) * CHART_SIZE + u


def texture_coordinates(
    iuv: UInt8[Tensor, "B 3 H W"], charts: Float[Tensor, "24 256 256 2"]
) -> Float[Tensor, "B H W 2"]:
    """Look up where each pixel lies in the texture, as (x, y) in [0, 1]; undefined where I is 0."""
    part, u, v = iuv.long().unbind(1)
    return charts.view(-1, 2)[chart_index(part, u, v)]
