"""A full texture from a partial one, without a network.

What is hidden takes the colour of its mirror image: first the other side of the body, then the
other face of the same limb. What is left takes the colours around it on the body's surface.
"""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float
from scipy.spatial import KDTree
from torch import Tensor

from nhrr_core import PART_GROUPS, UVLayout, mirror_texture
from nhrr_core.uv_layout import TWIN_SIZE

NEIGHBOURS = 12
OWN_SHARE = 0.05  # of a limb's texels: with fewer known, its own colours say too little
REFLECTION_METRES = 0.05  # patterns continue so far, then fade over as much again
NEAR_METRES = 0.01  # distances below this count alike, so that a single texel cannot dominate


def complete_texture(
    texture: Float[Tensor, "1 3 T T"], visibility: Float[Tensor, "1 1 T T"], layout: UVLayout
) -> Float[Tensor, "1 3 256 256"]:
    """Fill every texel that is not visible; visible ones pass unchanged."""
    if texture.shape[-1] != TWIN_SIZE:
        texture = F.interpolate(texture, (TWIN_SIZE, TWIN_SIZE), mode="area")
        visibility = (F.interpolate(visibility, (TWIN_SIZE, TWIN_SIZE), mode="area") == 1).float()
    texture, shown = mirror_texture(texture, visibility, layout.side_twin, layout.depth_twin)
    colours = texture[0].permute(1, 2, 0).reshape(-1, 3).clone()
    known = shown[0, 0].reshape(-1) > 0
    if known.all() or not known.any():
        return colours.view(1, TWIN_SIZE, TWIN_SIZE, 3).permute(0, 3, 1, 2)

    points, part = layout.position.reshape(-1, 3).numpy(), layout.part.reshape(-1).numpy()
    seen, values = known.numpy(), colours.numpy()
    for limb in PART_GROUPS.values():
        members = np.isin(part, limb)
        given = members & seen
        if given.sum() < OWN_SHARE * members.sum():
            given = seen  # the limb shows nothing to go by: its neighbours on the body must do
        hidden = members & ~seen
        if hidden.any():
            values[hidden] = _fill(points[hidden], points[given], values[given])
    return torch.from_numpy(values).view(1, TWIN_SIZE, TWIN_SIZE, 3).permute(0, 3, 1, 2)


def _fill(
    hidden: Float[np.ndarray, "N 3"],
    seen: Float[np.ndarray, "M 3"],
    colours: Float[np.ndarray, "M C"],
) -> Float[np.ndarray, "N C"]:
    """Colours for hidden places on the body from those of seen ones.

    Near the border of what is seen, its pattern continues by reflection at the border; further
    away only a mean of the surroundings can be told.
    """
    tree = KDTree(seen)
    distance, nearest = tree.query(hidden, k=min(NEIGHBOURS, len(seen)))
    distance, nearest = distance.reshape(len(hidden), -1), nearest.reshape(len(hidden), -1)
    weight = 1 / np.maximum(distance, NEAR_METRES) ** 2
    weight /= weight.sum(1, keepdims=True)
    mean = np.einsum("nk,nkc->nc", weight, colours[nearest])
    border = np.einsum("nk,nkc->nc", weight, seen[nearest])
    reflected = colours[tree.query(2 * border - hidden)[1]]
    blend = np.clip(2 - distance[:, :1] / REFLECTION_METRES, 0, 1)
    return (blend * reflected + (1 - blend) * mean).astype(colours.dtype)
