"""DensePose's charts on the body's triangles.

NOTE to helpers: this file is for the reader of DensePose's chart table only (`load_charts`,
`BodyCharts`; to be overwritten by whoever writes that reader). The garments' flat charts, first
written here, have moved to `flattening.py`; import them from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float32, UInt8


@dataclass(frozen=True)
class BodyCharts:
    """Attributes: part of each triangle, 1..24; uv of its three corners, in [0, 1]."""

    part: UInt8[np.ndarray, " F"]
    uv: Float32[np.ndarray, "F 3 2"]


@cache
def load_charts() -> BodyCharts:
    table = np.load("/work/shared/data/charts/anny_densepose_charts.npz")
    return BodyCharts(table["part"], table["uv"].astype(np.float32))
