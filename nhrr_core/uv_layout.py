"""The tables of `uv_tables` as tensors, and the look-up in the charts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from nhrr_core.uv_tables import CHART_SIZE, load_uv_tables


@dataclass(frozen=True)
class UVLayout:
    """The tables of `UVTables`, as tensors on the CPU."""

    charts: Float[Tensor, "24 256 256 2"]
    side_twin: Int64[Tensor, "256 256"]
    depth_twin: Int64[Tensor, "256 256"]
    position: Float[Tensor, "256 256 3"]
    part: Int64[Tensor, "256 256"]


@cache
def load_uv_layout() -> UVLayout:
    """Give the tables that ship with the package; their memory is that of `load_uv_tables`."""
    return UVLayout(**{name: torch.from_numpy(t) for name, t in vars(load_uv_tables()).items()})


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
