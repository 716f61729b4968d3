"""Global UV: places in the one SMPL/SURREAL texture, back to parts and chart coordinates.

Coordinate-based inpainting (Grigorev et al., CVPR 2019; "CBI") keeps a pose as one `.npy` for each
picture: H x W x 2 floats (x, y) in [-1, 1], x to the right and y down in the texture, NaN where
nobody is. It is the chart lookup of `nhrr_core.uv_tables` applied to an IUV image, and nothing in
it says which of the 24 charts a place came from.

The way back is the nearest entry of the same table. An IUV image that was folded with this very
table comes back as it was, except that (U, V) off a chart's surface moves to its rim, where both
mean the same place (measured on a rendered and on a photographed person: parts all the same, 99.1 %
of pixels exactly the same). Places moved by half a texel of 256, as another table might have them,
come back with 99 % of the parts and a median error of 2/255 in U and V.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import scipy  # whose parts are imported when they are used
from jaxtyping import Float, UInt8

from motion_transfer.errors import IuvFileError
from nhrr_core.uv_tables import TWIN_SIZE, load_uv_tables

WORD = 65535  # the table's coordinates are 16-bit
ROUNDING = 1e-6  # how far beyond 1 floats may come to lie that were computed, not measured
Frame = Float[np.ndarray, "H W 2"]


def global_to_iuv(places: Frame, where: str) -> tuple[UInt8[np.ndarray, "H W 3"], float]:
    """Find (I, U, V) of every place that is not NaN; background elsewhere.

    Args:
        places: (x, y) in [-1, 1].
        where: Names the frame, for messages.
    Returns: The IUV image, and the largest distance of a place from its entry in texels of a
        256 x 256 texture: below 0.1 for the same table, 1 and more for another layout.
    Raises: IuvFileError if a place lies outside the texture.
    """
    iuv = np.zeros((*places.shape[:2], 3), np.uint8)
    covered = ~np.isnan(places).any(-1)
    if not covered.any():
        return iuv, 0.0
    wanted = places[covered].astype(np.float64)
    furthest = float(np.abs(wanted).max())
    if furthest > 1 + ROUNDING:
        raise IuvFileError(
            f"{where} has global UV up to {furthest:g}; places in the texture lie in -1..1, with"
            " NaN for the background"
        )
    tree, entries = _nearest_entries()
    distances, nearest = tree.query((wanted + 1) / 2)
    iuv[covered] = entries[nearest]
    return iuv, float(distances.max()) * TWIN_SIZE


def check_scale(places: Frame, where: str) -> None:
    """Refuse a frame that is not on CBI's scale. Raises: IuvFileError with the remedy."""
    finite = places[~np.isnan(places)]
    if finite.size == places.size:
        raise IuvFileError(
            f"{where} is {places.dtype} with two channels, but no pixel of it is NaN: in global UV"
            " the background is; set it to NaN, or export the IUV as PNG"
        )
    if finite.size and finite.min() >= 0:
        raise IuvFileError(
            f"{where} holds global UV within 0..1, whose direction cannot be told; bring it to"
            " CBI's scale, x = 2 s - 1 and y = 1 - 2 t for texture coordinates (s, t) with t"
            " pointing up"
        )


@cache
def _nearest_entries() -> tuple[scipy.spatial.KDTree, UInt8[np.ndarray, "N 3"]]:
    """Index the places of all table entries that a surface covers, with their (I, U, V)."""
    charts = load_uv_tables().charts
    words = np.round(charts * WORD).astype(np.int64)
    keys = words[..., 0] << 16 | words[..., 1]
    _, group, sizes = np.unique(keys, return_inverse=True, return_counts=True)
    single = sizes[group].reshape(keys.shape) == 1
    # entries off the surface repeat the nearest one on it: of equals, the one nearest to those
    # that have no equal is the original
    depth = np.stack(
        [cv2.distanceTransform((~chart).astype(np.uint8), cv2.DIST_L2, 5) for chart in single]
    )
    order = np.lexsort((depth.ravel(), group.ravel()))
    originals = order[np.flatnonzero(np.diff(group.ravel()[order], prepend=-1))]
    part, v, u = np.unravel_index(originals, keys.shape)
    entries = np.stack([part + 1, u, v], -1).astype(np.uint8)
    return scipy.spatial.KDTree(charts.reshape(-1, 2)[originals].astype(np.float64)), entries
