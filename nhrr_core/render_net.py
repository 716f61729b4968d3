"""RenderNet g: a feature image becomes a frame, I = g(R)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

LAST_LAYERS = 3
"""How many there are after the norms: padding, 7x7 and tanh."""


class ResidualBlock(nn.Module):
    """The input plus 3x3, norm, ReLU, 3x3, norm of it; reflected at the border."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.ReflectionPad2d(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
            nn.ReLU(inplace=True),
            nn.ReflectionPad2d(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
        )

    def forward(self, x: Float[Tensor, "B C H W"]) -> Float[Tensor, "B C H W"]:
        return x + self.body(x)


class RenderNet(nn.Module):
    """Pix2PixHD's global generator: 7x7, down blocks, residual blocks, up blocks, 7x7, tanh.

    Args:
        width: Channels of the first convolution; they double at each down block.
        shortcut: Whether the last convolution reads the network's input, too.
    Source: the paper, Sec. 3.4, Eq. 3; layer shapes from Pix2PixHD (Wang et al., CVPR 2018).
        Departs from it: `shortcut`, off by default.
    """

    def __init__(
        self,
        *,
        inputs: int,
        outputs: int,
        width: int,
        down_blocks: int,
        residual_blocks: int,
        shortcut: bool = False,
    ) -> None:
        super().__init__()
        self.shortcut = shortcut
        layers: list[nn.Module] = [nn.ReflectionPad2d(3), nn.Conv2d(inputs, width, 7)]
        layers += [nn.InstanceNorm2d(width), nn.ReLU(inplace=True)]
        for i in range(down_blocks):
            wide = width * 2 ** (i + 1)
            layers += [nn.Conv2d(wide // 2, wide, 3, stride=2, padding=1)]
            layers += [nn.InstanceNorm2d(wide), nn.ReLU(inplace=True)]
        layers += [ResidualBlock(width * 2**down_blocks) for _ in range(residual_blocks)]
        for i in reversed(range(down_blocks)):
            narrow = width * 2**i
            layers += [
                nn.ConvTranspose2d(narrow * 2, narrow, 3, stride=2, padding=1, output_padding=1)
            ]
            layers += [nn.InstanceNorm2d(narrow), nn.ReLU(inplace=True)]
        read = width + inputs if shortcut else width
        layers += [nn.ReflectionPad2d(3), nn.Conv2d(read, outputs, 7), nn.Tanh()]
        self.layers = nn.Sequential(*layers)

    def forward(self, features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B K H W"]:
        """Draw a frame in [-1, 1]; H and W are multiples of 2**down_blocks."""
        if not self.shortcut:
            return self.layers(features)
        drawn = self.layers[:-LAST_LAYERS](features)
        return self.layers[-LAST_LAYERS:](torch.cat([drawn, features], dim=1))
