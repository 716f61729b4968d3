"""The discriminator D: does an image belong to this feature image?"""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from nhrr_core.errors import ShapeError

SLOPE = 0.2  # of LeakyReLU, Pix2PixHD's
INITIAL_STD = 0.02  # of the convolutions' weights, Pix2PixHD's


class Verdict(NamedTuple):
    """What one scale says of images.

    Attributes:
        logits: B x 1 x h x w, one for each patch, above 0 for real.
        features: The activations of the four layers before, the first one's first.
    """

    logits: Float[Tensor, "B 1 h w"]
    features: list[Float[Tensor, "B _ _ _"]]


class PatchDiscriminator(nn.Module):
    """One scale: each logit judges a patch of 70 x 70 px.

    Three 4x4 convolutions of stride 2 and one of stride 1, all with LeakyReLU and all but the first
    with instance norm, then a 4x4 convolution to one channel.
    Source: Pix2PixHD (Wang et al., CVPR 2018), 64 base channels.
    """

    def __init__(self, *, inputs: int, width: int) -> None:
        super().__init__()
        # padding is 2 on every side, so each of stride 1 adds a pixel: Pix2PixHD's, kept
        layers: list[nn.Module] = [nn.Conv2d(inputs, width, 4, stride=2, padding=2)]
        layers += [nn.LeakyReLU(SLOPE, inplace=True)]
        for i, stride in enumerate((2, 2, 1)):
            narrow = width * 2**i
            layers += [nn.Conv2d(narrow, narrow * 2, 4, stride=stride, padding=2)]
            layers += [nn.InstanceNorm2d(narrow * 2), nn.LeakyReLU(SLOPE, inplace=True)]
        layers += [nn.Conv2d(width * 8, 1, 4, padding=2)]
        for layer in layers:
            if isinstance(layer, nn.Conv2d):
                nn.init.normal_(layer.weight, std=INITIAL_STD)
        self.layers = nn.Sequential(*layers)

    def forward(self, pair: Float[Tensor, "B C H W"]) -> Verdict:
        """Judge patches; the sides of the logits are about H / 8 and W / 8."""
        features, x = [], pair
        for layer in self.layers:
            x = layer(x)
            if isinstance(layer, nn.LeakyReLU):
                features.append(x)
        return Verdict(x, features)


class Discriminator(nn.Module):
    """Pix2PixHD's multi-scale discriminator, conditioned on the feature image.

    Every scale is a network of its own; between them, image and condition are halved by averaging.

    Args:
        image_channels: 3, or 4 where RenderNet also writes alpha.
        condition_channels: Those of the feature image, `ModelConfig.render_inputs`.
        width: Channels of the first convolution.
        scales: How many there are; the paper has three.
    Source: the paper, Sec. 3.4 and 3.5; layers and initial weights from Pix2PixHD, and so are the
        features, which the paper makes no use of.
    """

    def __init__(
        self, *, image_channels: int, condition_channels: int, width: int = 64, scales: int = 3
    ) -> None:
        super().__init__()
        self.scales = nn.ModuleList(
            PatchDiscriminator(inputs=image_channels + condition_channels, width=width)
            for _ in range(scales)
        )

    def forward(
        self, image: Float[Tensor, "B K H W"], condition: Float[Tensor, "B C h w"]
    ) -> list[Verdict]:
        """Compute each scale's logits, without sigmoid, and features, the finest scale first.

        Args:
            image: Real or generated, in [-1, 1].
            condition: The feature image of the same pose, `NeuralReRenderer.feature_image`.
        Raises: ShapeError if the two differ in batch or size.
        """
        if image.shape[0] != condition.shape[0] or image.shape[2:] != condition.shape[2:]:
            raise ShapeError(
                f"image {list(image.shape)} and feature image {list(condition.shape)} do not match"
            )
        pair = torch.cat([image, condition], dim=1)
        verdicts: list[Verdict] = []
        for scale in self.scales:
            if verdicts:
                pair = F.avg_pool2d(pair, 3, stride=2, padding=1, count_include_pad=False)
            verdicts.append(scale(pair))
        return verdicts
