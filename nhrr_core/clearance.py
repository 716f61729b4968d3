"""How far clothes and hair stand off the body: what a texture, all on the body, cannot hold.

A photo shows it along the body's outline only, as the distance from there to where the person ends.
Unfolded like colours, in lengths of the body instead of pixels, it tells RenderNet how far beyond
the outline of a target pose this person reaches. The paper has no such thing.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nhrr_core.config import CLEARANCE_SIZE, DETAIL_FULL, DETAIL_NONE, UNIT_TEXELS
from nhrr_core.texture import extract_texture
from nhrr_core.uv_layout import texture_coordinates


def unfold_clearance(
    clearance: Float[Tensor, "B 1 H W"],
    measured: Bool[Tensor, "B 1 H W"],
    iuv: UInt8[Tensor, "B 3 H W"],
    charts: Float[Tensor, "24 256 256 2"],
) -> Float[Tensor, "B 2 128 128"]:
    """Unfold a photo's clearance onto the body's surface.

    Args:
        clearance: Pixels from the body's outline to where the person ends; negative where that is
            inside the body.
        measured: Where it counts: on the outline.
    Returns: The clearance in UNIT_TEXELS, and 1 where it was measured; both 0 elsewhere.
    """
    in_units = clearance / (pixels_per_texel(iuv, charts) * UNIT_TEXELS)[:, None, None, None]
    return torch.cat(extract_texture(in_units, iuv * measured, charts, CLEARANCE_SIZE), dim=1)


def pixels_per_texel(
    iuv: UInt8[Tensor, "B 3 H W"], charts: Float[Tensor, "24 256 256 2"]
) -> Float[Tensor, " B"]:
    """Measure how large each body is in its image: the side of a texel of CLEARANCE_SIZE, px.

    It is the root of the number of the body's pixels over the number of texels that they fall into;
    1 where nobody is.
    """
    body = iuv[:, 0] > 0
    x, y = (texture_coordinates(iuv, charts) * CLEARANCE_SIZE).long().unbind(-1)
    last, texels = CLEARANCE_SIZE - 1, CLEARANCE_SIZE**2
    texel = y.clamp(0, last) * CLEARANCE_SIZE + x.clamp(0, last)
    # the background falls on one more texel, which does not count: nothing waits for a device to
    # tell where the body is
    texel = torch.where(body, texel, texels).flatten(1)
    hit = torch.zeros(iuv.shape[0], texels + 1, device=iuv.device).scatter_(1, texel, 1.0)
    pixels, seen = body.flatten(1).sum(1), hit[:, :texels].sum(1)
    return torch.where(pixels > 0, pixels / seen.clamp_min(1), 1.0).sqrt()


def detail_share(scale: Float[Tensor, " B"], size: int) -> Float[Tensor, " B"]:
    """Tell how much of a source's detail bodies are drawn with: the smaller, the less.

    Args:
        scale: What `pixels_per_texel` measured.
        size: Side of the detail, texels.
    Returns: From 0 to 1, without a jump, or a body that walks away would show it.
    """
    apart = size / CLEARANCE_SIZE / scale
    return ((DETAIL_NONE - apart) / (DETAIL_NONE - DETAIL_FULL)).clamp(0, 1)


def spread_clearance(
    filled: Float[Tensor, "B 1 t t"], known: Float[Tensor, "B 1 t t"], size: int
) -> Float[Tensor, "B 2 T T"]:
    """Bring clearance to the size of a feature map, T x T, which carries it to RenderNet.

    Args:
        filled: Without holes.
        known: 1 where it was measured.
    Returns: The clearance; and 1 everywhere if any of it was measured, else 0.
    """
    flag = known.amax((2, 3), keepdim=True).expand_as(filled)
    return F.interpolate(torch.cat([filled, flag], dim=1), (size, size), mode="nearest")
