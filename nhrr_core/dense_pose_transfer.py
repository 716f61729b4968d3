"""What `dpt` has in RenderNet's place: a picture that is warped and one that is not, blended."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from nhrr_core.config import IUV_CHANNELS, PICTURE_CHANNELS, ModelConfig
from nhrr_core.render_net import RenderNet


class DirectAndBlending(nn.Module):
    """One network draws of the source's picture and the target IUV; another blends.

    The first sees no warped colours and can draw what the surface does not have; the second sees
    its drawing beside them.

    Source: Neverova et al., "Dense pose transfer" (ECCV 2018), predictive and blending module.
        Departs from it: both are `RenderNet`s and learn together, with `geometry` both are told
        where the body is, and blending is at half the size, not at the whole.
    """

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self._warped = config.warped_channels
        self.direct = RenderNet(config.direct_sizes)
        self.blending = RenderNet(config.blending_sizes)

    @property
    def layers(self) -> nn.Sequential:
        """Those that draw in the end, where fine-tuning begins."""
        return self.blending.layers

    def forward(self, features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B K H W"]:
        """Draw a frame in [-1, 1], as `RenderNet` does."""
        warped, iuv, picture, around = features.tensor_split(
            (
                self._warped,
                self._warped + IUV_CHANNELS,
                self._warped + IUV_CHANNELS + PICTURE_CHANNELS,
            ),
            dim=1,
        )
        drawn = self.direct(torch.cat([iuv, picture, around], dim=1))
        return self.blending(torch.cat([warped, drawn, iuv, around], dim=1))
