"""The way there of `motion_transfer.media.iuv.global_uv`, as those who export global UV go it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from nhrr_core import load_uv_tables


def iuv_to_global(iuv: UInt8[np.ndarray, "H W 3"]) -> Float[np.ndarray, "H W 2"]:
    """Find each pixel's place in the texture, (x, y) in [-1, 1], NaN where I is 0; float32."""
    part, u, v = (iuv[..., channel].astype(np.int64) for channel in range(3))
    charts = load_uv_tables().charts
    places = charts[np.maximum(part, 1) - 1, v, u] * 2 - 1
    places[part == 0] = np.nan
    return places
