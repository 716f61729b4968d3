"""The tables of `uv_tables` as tensors, and the look-up in the charts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, reduce

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from nhrr_core.uv_tables import CHART_SIZE, MAX_SPREAD, SMOOTHED_OVER, WORD, load_uv_tables


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


def smooth_coordinates(
    iuv: UInt8[Tensor, "B 3 H W"], charts: Float[Tensor, "24 256 256 2"]
) -> Float[Tensor, "B H W 2"]:
    """Look up where each pixel lies in the texture, finer than 8 bits of U and V can say.

    In a large picture of a person a level of U or V is wider than a pixel, and enlarging IUV
    repeats some pixels more often than others: a stripe that such places follow gets steps. So a
    pixel's place is the mean of those in the square around it, the largest of SMOOTHED_OVER in
    which all pixels are of one part, lie within MAX_SPREAD of each other, and are in the image.

    Returns: (x, y) in [0, 1]; undefined where I is 0.
    Source: this project's; a box filter.
    """
    places = texture_coordinates(iuv, charts).permute(0, 3, 1, 2)
    known = torch.cat([iuv[:, :1].to(places.dtype), (places * WORD).round()], dim=1)
    for side in SMOOTHED_OVER:
        around = F.pad(known, [side // 2] * 4, value=-1.0)  # beyond the image: no part is -1
        extremes = _over_squares(torch.maximum, torch.cat([around, -around], dim=1), side)
        highest, lowest_negated = extremes.chunk(2, dim=1)
        part, across, down = (highest + lowest_negated).unbind(1)
        alike = (part == 0) & (torch.maximum(across, down) <= MAX_SPREAD * WORD)
        total = _over_squares(torch.add, around[:, 1:], side)
        places = torch.where(alike[:, None], total / (side**2 * WORD), places)
    return places.permute(0, 2, 3, 1)


def _over_squares(
    combine: Callable[[Tensor, Tensor], Tensor], values: Float[Tensor, "B C H W"], side: int
) -> Float[Tensor, "B C h w"]:
    """Combine the values of each square of pixels; several times as fast as torch's pooling."""
    for axis in (2, 3):
        length = values.shape[axis] - side + 1
        values = reduce(combine, (values.narrow(axis, start, length) for start in range(side)))
    return values
