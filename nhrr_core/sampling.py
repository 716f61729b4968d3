"""Screen space from UV space: the paper's rendering operation r, and what lies around a body."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nhrr_core.errors import ShapeError
from nhrr_core.uv_layout import smooth_coordinates

TINY = 1e-6  # far below the smallest weight that is not 0, a sixteenth


def sample_features(
    feature_map: Float[Tensor, "M D T T"],
    iuv: UInt8[Tensor, "B 3 H W"],
    charts: Float[Tensor, "24 256 256 2"],
    places: Float[Tensor, "B H W 2"] | None = None,
) -> Float[Tensor, "B D H W"]:
    """Look up each pixel's feature in the UV feature map.

    Convention: bilinear between texel centres; beyond the outermost centres the map is constant.
    A pixel lies where `smooth_coordinates` says.

    Args:
        feature_map: One map per image, or a single one (M = 1) for the whole batch.
        iuv: The target's, (I, U, V).
        charts: The lookup table, `UVLayout.charts`.
        places: What `smooth_coordinates` says, where several maps are looked up; None: it is asked.
    Returns: The feature image; exactly 0 where the part index is 0.
    Raises: ShapeError if the number of maps is neither 1 nor that of the images.
    Source: the paper, Sec. 3.3, Eq. 2. Departs from it: pixels lie between the levels of U and V.
    """
    maps, images = feature_map.shape[0], iuv.shape[0]
    if maps not in (1, images):
        raise ShapeError(f"{maps} feature maps for {images} IUV images; give 1 or {images}")
    if places is None:
        places = smooth_coordinates(iuv, charts)
    if iuv.device.type != "cpu":
        return _sample_everywhere(feature_map, iuv, places)
    image = feature_map.new_zeros(images, feature_map.shape[1], *iuv.shape[2:])
    for number, own_map in enumerate(feature_map.split(1)):
        shown = slice(None) if maps == 1 else slice(number, number + 1)
        index, row, column = (iuv[shown, 0] > 0).nonzero(as_tuple=True)  # often a tenth of all
        sampled = _sample(own_map, places[shown][index, row, column][None, None])  # 1 x 1 x N x 2
        image[shown][index, :, row, column] = sampled[0, :, 0].T
    return image


def _sample_everywhere(
    feature_map: Float[Tensor, "M D T T"],
    iuv: UInt8[Tensor, "B 3 H W"],
    places: Float[Tensor, "B H W 2"],
) -> Float[Tensor, "B D H W"]:
    """Look up the background as well, then put 0 there.

    It is more work, but a device is not asked where the body is: nobody waits for its answer, and
    all that it does can be recorded as a CUDA graph.
    """
    if len(feature_map) == len(places):
        sampled = _sample(feature_map, places)
    else:  # one map: images are looked up as one tall image, without a copy of the map for each
        tall = _sample(feature_map, places.flatten(0, 1)[None])
        sampled = tall.unflatten(2, places.shape[:2])[0].transpose(0, 1)
    return torch.where(iuv[:, :1] > 0, sampled, 0)


def _sample(
    feature_map: Float[Tensor, "M D T T"], places: Float[Tensor, "M H W 2"]
) -> Float[Tensor, "M D H W"]:
    return F.grid_sample(
        feature_map,
        (places * 2 - 1).to(feature_map.dtype),
        mode="bilinear",
        padding_mode="border",
        align_corners=False,
    )


def spread_colours(
    colours: Float[Tensor, "B C H W"], known: Bool[Tensor, "B 1 H W"], levels: int
) -> Float[Tensor, "B C H W"]:
    """Carry colours beyond the outline of what is known, each place a mean of what lies nearest.

    Args:
        known: Where they are known; there they stay as they are.
        levels: How often means of 2 x 2 are taken; colours reach 2**(levels - 1) pixels at least.
    Returns: The colours; 0 beyond their reach.
    Source: the pull-push of Gortler et al., "The Lumigraph" (SIGGRAPH 1996), Sec. 4.2.
    """
    height, width = known.shape[2:]
    padding = 0, -width % 2**levels, 0, -height % 2**levels
    # the last channel counts: means are of what is known alone
    weighted = F.pad(torch.cat([colours, torch.ones_like(colours[:, :1])], 1) * known, padding)
    means = [weighted]
    for _ in range(levels):
        mean = F.avg_pool2d(means[-1], 2)
        means.append(mean / mean[:, -1:].clamp_min(TINY))  # weights are 0 or 1 again
    filled = means.pop()
    while means:
        finer = means.pop()
        filled = F.interpolate(filled, scale_factor=2, mode="bilinear")
        filled = torch.where(finer[:, -1:] > 0, finer, filled / filled[:, -1:].clamp_min(TINY))
    return filled[:, :-1, :height, :width]


def signed_distance(inside: Bool[Tensor, "B 1 H W"], reach: int) -> Float[Tensor, "B 1 H W"]:
    """Measure the distance to the outline, px: negative inside, at most `reach` either way.

    The outline runs half-way between the centres of pixels inside and outside, so that no distance
    is 0. An image without an outline is at `reach` everywhere.

    Args:
        reach: At most 127, so that no sum of two squares exceeds 16 bits.
    Source: the exact distance transform of Felzenszwalb and Huttenlocher (2012), whose minimum over
    parabolas is taken here over those within reach.
    """
    far = torch.tensor((reach + 1) ** 2, dtype=torch.int16, device=inside.device)
    squared = torch.cat([inside, ~inside], dim=1).logical_not() * far  # half of float32's time
    for axis in (2, 3):  # squares add up, so one axis after the other is exact
        nearest, length = squared.clone(), squared.shape[axis]
        for step in range(1, min(reach + 1, length)):
            away = squared + step**2
            for one, other in ((0, step), (step, 0)):
                part = nearest.narrow(axis, one, length - step)
                torch.minimum(part, away.narrow(axis, other, length - step), out=part)
        squared = nearest
    outside, within = squared.float().sqrt().split(1, dim=1)
    return torch.where(inside, 0.5 - within, outside - 0.5).clamp(-reach, reach)
