"""Partial textures: what is seen of one comes from another, from its mirror image, or in coarse.

The twins, without torch and without a batch axis, of functions of the same names in `nhrr_core`,
which training needs on GPUs; tests hold them equal. A texture is 0 where it is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float32, Int64, Shaped

from nhrr_core import load_uv_tables

Texture = Float32[np.ndarray, "C T T"]
Visibility = Float32[np.ndarray, "1 T T"]


def merge_textures(layers: Sequence[tuple[Texture, Visibility]]) -> tuple[Texture, Visibility]:
    """Unite partial textures, each with its visibility; where two claim a texel, the later wins.

    Source: the paper, Sec. 4.5 (garment transfer).
    """
    texture, visibility = layers[0]
    for more_texture, more_visibility in layers[1:]:
        texture = texture * (1 - more_visibility) + more_texture * more_visibility
        visibility = np.maximum(visibility, more_visibility)
    return texture, visibility


def mirror_texture(texture: Texture, visibility: Visibility) -> tuple[Texture, Visibility]:
    """Give hidden texels the colours of their mirror image, see `nhrr_core.mirror_texture`."""
    size = texture.shape[-1]
    side, depth = twins(size)
    colours, shown = texture.reshape(len(texture), -1).copy(), visibility.reshape(-1) > 0
    # side again: by then the side twin has got the colours of its own other face
    for twin in (side, depth, side):
        gain = (~shown & shown[twin]).nonzero()[0]
        colours[:, gain] = colours[:, twin[gain]]
        shown[gain] = True
    return colours.reshape(texture.shape), shown.astype(np.float32).reshape(visibility.shape)


def shrink_texture(
    texture: Texture, visibility: Visibility, factor: int
) -> tuple[Texture, Visibility]:
    """Make a partial texture coarser: a texel is the mean of those seen in its place, if any is.

    Args:
        factor: How many times; the side is a multiple of it.
    """
    if factor == 1:
        return texture, visibility
    size = texture.shape[-1] // factor
    share = average(visibility, size)
    mean = average(texture, size) / np.maximum(share, np.float32(1 / factor**2))
    return mean, (share > 0).astype(np.float32)


def average(values: Float32[np.ndarray, "C T T"], size: int) -> Float32[np.ndarray, "C t t"]:
    """Make a map coarser: the means of its size x size equal cells."""
    return _resize(values, size, cv2.INTER_AREA)


def enlarge(values: Float32[np.ndarray, "C t t"], size: int) -> Float32[np.ndarray, "C T T"]:
    """Bring a map to another size, bilinear between the centres of its texels."""
    return _resize(values, size, cv2.INTER_LINEAR)


def _resize(
    values: Float32[np.ndarray, "C T T"], size: int, interpolation: int
) -> Float32[np.ndarray, "C t t"]:
    planes = [cv2.resize(plane, (size, size), interpolation=interpolation) for plane in values]
    return np.stack(planes)


def pick_nearest(values: Shaped[np.ndarray, "*C t t"], size: int) -> Shaped[np.ndarray, "*C T T"]:
    """Bring a map to another size; each texel is the one at its centre."""
    length = values.shape[-1]
    if size == length:
        return values
    at = (2 * np.arange(size) + 1) * length // (2 * size)
    return values[..., at[:, None], at]


def differ_in_any_light(
    colours: Float32[np.ndarray, "3 N"],
    of: Float32[
        np.ndarray,
        (
            3  # N
        ),
    ],
    shades: tuple[float, float],
) -> Float32[np.ndarray, " N"]:
    """Tell how far colours are from others, 0 to 1, in the light that makes them most alike.

    Args:
        shades: The least and the most light, in that of the colours themselves.
    Returns: The difference in the channel that differs most.
    """
    light = (colours * of).sum(0) / np.maximum((of * of).sum(0), np.float32(1e-4))
    return np.abs(colours - of * light.clip(*shades)).max(0)


def fall(values: Float32[np.ndarray, "*S"], first: float, last: float) -> Float32[np.ndarray, "*S"]:
    """Fall from 1 to 0 between two values."""
    return ((last - values) / (last - first)).clip(0, 1)


def twins(size: int) -> tuple[Int64[np.ndarray, " L"], Int64[np.ndarray, " L"]]:
    """Give the tables `side_twin` and `depth_twin` for a texture of any size, flat."""
    tables = load_uv_tables()
    own = len(tables.side_twin)
    found = []
    for table in (tables.side_twin, tables.depth_twin):
        row, column = np.divmod(pick_nearest(table, size), own)
        found.append((row * size // own * size + column * size // own).reshape(-1))
    return found[0], found[1]
