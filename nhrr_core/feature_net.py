"""FeatureNet f: a U-Net that completes a partial texture to a full UV feature map, F_s = f(T_s).

And PhotoNet, which looks at a photo before it is unfolded.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from nhrr_core.config import PHOTO_FEATURES, PICTURE_CHANNELS
from nhrr_core.tensors import FEATURE_DOWN_BLOCKS, PHOTO_WIDTH, feature_widths


def _two_convolutions(inputs: int, outputs: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for channels in (inputs, outputs):
        layers += [
            nn.Conv2d(channels, outputs, 3, padding=1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        ]
    return nn.Sequential(*layers)


class FeatureNet(nn.Module):
    """Four down blocks of two convolutions and max-pool, two convolutions, four up blocks.

    An up block is bilinear up-sampling and two convolutions, which also read what the way down had
    at that size. Convolutions are 3x3 with batch norm and ReLU, but for the 1x1 that writes the
    map. A 256 x 256 texture reaches 16 x 16 in the middle.

    Args:
        width: Channels at full size; they double at each halving but the last.
    Source: the paper, Sec. 3.2, Eq. 1. Departs from it: no; what it does not give (skips, widths,
        norm) is the usual U-Net's (Ronneberger et al., MICCAI 2015).
    """

    def __init__(self, *, inputs: int, outputs: int, width: int) -> None:
        super().__init__()
        widths = feature_widths(width)
        self.entry = _two_convolutions(inputs, widths[0])
        self.down = nn.ModuleList(
            _two_convolutions(widths[i], widths[i + 1]) for i in range(FEATURE_DOWN_BLOCKS)
        )
        self.up = nn.ModuleList(
            _two_convolutions(2 * widths[i], widths[max(i - 1, 0)])
            for i in reversed(range(FEATURE_DOWN_BLOCKS))
        )
        self.exit = nn.Conv2d(widths[0], outputs, 1)

    def forward(self, texture: Float[Tensor, "B C T T"]) -> Float[Tensor, "B D T T"]:
        """Complete a texture, and whatever is known of its texels; T is a multiple of 16."""
        skips = [self.entry(texture)]
        for block in self.down:
            skips.append(block(F.max_pool2d(skips[-1], 2)))
        x = skips.pop()
        for block in self.up:
            x = F.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)
            x = block(torch.cat([x, skips.pop()], dim=1))
        return self.exit(x)


class PhotoNet(nn.Module):
    """Learned features of each pixel of a photo, which see what lies around it: hair and clothes.

    A U-Net of one halving, with FeatureNet's blocks: a feature depends on the 15 pixels about.

    Source: the paper's discussion (Sec. 5), which proposes such features without giving a network.
    """

    def __init__(self) -> None:
        super().__init__()
        self.entry = _two_convolutions(PICTURE_CHANNELS, PHOTO_WIDTH)
        self.down = _two_convolutions(PHOTO_WIDTH, 2 * PHOTO_WIDTH)
        self.exit = nn.Conv2d(3 * PHOTO_WIDTH, PHOTO_FEATURES, 1)

    def forward(self, picture: Float[Tensor, "B 6 S S"]) -> Float[Tensor, "B E S S"]:
        """Look at RGB and IUV, each in [-1, 1]; S is even."""
        near = self.entry(picture)
        around = self.down(F.max_pool2d(near, 2))
        around = F.interpolate(around, scale_factor=2.0, mode="bilinear", align_corners=False)
        return self.exit(torch.cat([near, around], dim=1))
