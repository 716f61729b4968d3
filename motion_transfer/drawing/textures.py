"""Partial textures: what is seen of one comes from another, from its mirror image, or in coarse.

The twins, without torch and without a batch axis, of functions of the same names in `nhrr_core`,
which training needs on GPUs; tests hold them equal. A texture is 0 where it is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float32, Int64, Shaped, UInt8

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


def lay_out_body(size: int) -> tuple[UInt8[np.ndarray, " L"], Float32[np.ndarray, "3 L"]]:
    """Tell the part of each texel of a texture of that side, and where it is, metres."""
    tables = load_uv_tables()
    position = pick_nearest(tables.position.transpose(2, 0, 1), size)
    return pick_nearest(tables.part, size).reshape(-1), position.reshape(3, -1)


def weigh_nearest(away: Float32[np.ndarray, "M K"], reach: float) -> Float32[np.ndarray, "M K"]:
    """Weigh points by how much farther than the nearest, the first, they are: a sum of 1 each.

    Args:
        reach: So much farther, a point counts 1 / e as much.
    """
    weights = np.exp((away[:, :1] - away) / reach)
    return weights / weights.sum(1, keepdims=True)


def light_between(
    colours: Float32[np.ndarray, "3 N *M"],
    of: Float32[np.ndarray, "3 _ *_"],
    shades: tuple[float, float],
) -> Float32[np.ndarray, " N *M"]:
    """Find the light in which colours are most like others, 0 to 1 each.

    Args:
        of: The others, as many or to be broadcast.
        shades: The least and the most light, in that of the others.
    """
    light = (colours * of).sum(0) / np.maximum((of * of).sum(0), np.float32(1e-4))
    return light.clip(*shades)


def differ_in_any_light(
    colours: Float32[np.ndarray, "3 N *M"],
    of: Float32[np.ndarray, "3 _ *_"],
    shades: tuple[float, float],
) -> Float32[np.ndarray, " N *M"]:
    """Tell how far colours are from others, 0 to 1, see `light_between`.

    Returns: The difference in the channel that differs most.
    """
    return np.abs(colours - of * light_between(colours, of, shades)).max(0)


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
