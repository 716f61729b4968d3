"""Screen space from UV space: the paper's rendering operation r."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float, UInt8
from torch import Tensor

from nhrr_core.errors import ShapeError
from nhrr_core.uv_layout import texture_coordinates


def sample_features(
    feature_map: Float[Tensor, "M D T T"],
    iuv: UInt8[Tensor, "B 3 H W"],
    charts: Float[Tensor, "24 256 256 2"],
) -> Float[Tensor, "B D H W"]:
    """Look up each pixel's feature in the UV feature map.

    Convention: bilinear between texel centres; beyond the outermost centres the map is constant.

    Args:
        feature_map: one map per image, or a single one (M = 1) for the whole batch.
        iuv: target IUV, uint8, (I, U, V).
        charts: the lookup table, `UVLayout.charts`.
    Returns: the feature image; exactly 0 where the part index is 0.
    Raises: ShapeError if the number of maps is neither 1 nor that of the images.
    Source: the paper, Sec. 3.3, Eq. 2. Departs from it: no.
    """
    maps, images = feature_map.shape[0], iuv.shape[0]
    if maps not in (1, images):
        raise ShapeError(f"{maps} feature maps for {images} IUV images; give 1 or {images}")
    grid = texture_coordinates(iuv, charts) * 2 - 1
    sampled = F.grid_sample(
        feature_map.expand(images, -1, -1, -1),
        grid.to(feature_map.dtype),
        mode="bilinear",
        padding_mode="border",
        align_corners=False,
    )
    return torch.where(iuv[:, :1] > 0, sampled, 0)
