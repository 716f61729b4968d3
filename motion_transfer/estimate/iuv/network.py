"""The network that paints IUV from what BlazePose finds: a small U-Net.

It never sees the picture, only landmarks, mask and the feature maps that BlazePose reads both from.
Those were learned from real photos, so that synthetic people are all it has to be trained on. Bones
go in as maps; the same numbers as a row also scale and shift the features of each level (FiLM,
Perez et al. 2018), so that far-away joints count everywhere. Its weights are one safetensors file
with the network's sizes inside.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import torch
from jaxtyping import Float
from safetensors.torch import save_file
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.fusion import fuse_conv_bn_eval

from motion_transfer.estimate.iuv.body import GRID, MAP_CHANNELS, VECTOR_LENGTH
from motion_transfer.estimate.iuv.features import BodyInput, feature_maps, feature_vector
from motion_transfer.estimate.iuv.weights import (
    FINER,
    PARTS,
    WHAT,
    IuvNetworkConfig,
    read_config,
)
from motion_transfer.weights.tensors import load_network, read_header
from nhrr_core.parts import PART_COUNT

OUTPUT_SIZE = GRID * FINER


class IuvLogits(NamedTuple):
    """What the network says of B windows.

    Attributes:
        parts: Logits of background and 24 parts.
        uv: U and V of each part, in [0, 1] where that part is.
    """

    parts: Float[Tensor, "B 25 128 128"]
    uv: Float[Tensor, "B 24 2 128 128"]


class IuvNetwork(nn.Module):
    """The network: landmarks, mask and features in; parts, U and V on 128 x 128 out."""

    def __init__(self, config: IuvNetworkConfig | None = None) -> None:
        super().__init__()
        self.config = config or IuvNetworkConfig()
        widths, code = self.config.widths, self.config.code
        self.encode_row = nn.Sequential(
            nn.Linear(VECTOR_LENGTH, 2 * code), nn.ReLU(), nn.Linear(2 * code, code), nn.ReLU()
        )
        self.stem = nn.Conv2d(MAP_CHANNELS, widths[0], 1)
        inputs = (widths[0], *widths[:-1])
        self.down = nn.ModuleList(
            Block(before, width, code) for before, width in zip(inputs, widths, strict=True)
        )
        self.up = nn.ModuleList(
            Block(widths[level + 1] + widths[level], widths[level], code)
            for level in reversed(range(len(widths) - 1))
        )
        self.head = nn.Conv2d(widths[0], (PARTS + 2 * PART_COUNT) * FINER**2, 1)

    def forward(self, body: BodyInput) -> IuvLogits:
        """Compute the logits of B people."""
        code = self.encode_row(feature_vector(body))
        features = self.stem(feature_maps(body))
        skips: list[Tensor] = []
        for level, block in enumerate(self.down):
            features = block(F.max_pool2d(features, 2) if level else features, code)
            skips.append(features)
        skips.pop()  # the coarsest level is what goes up, and no skip
        for block in self.up:
            larger = F.interpolate(features, scale_factor=2, mode="nearest")
            features = block(torch.cat([larger, skips.pop()], 1), code)
        out = spread_cells(self.head(features))
        parts, uv = out.split((PARTS, 2 * PART_COUNT), dim=1)
        # a fresh network answers around zero: the middle of a chart
        return IuvLogits(parts, uv.unflatten(1, (PART_COUNT, 2)) + 0.5)

    def fused(self) -> IuvNetwork:
        """Make itself fit for use only: normalisation becomes part of the convolutions."""
        self.eval().requires_grad_(False)
        for block in self.modules():
            if isinstance(block, Block):
                block.fuse()
        return self


def spread_cells(cells: Float[Tensor, "B C h w"]) -> Float[Tensor, "B c H W"]:
    """Spread four values of each cell over four pixels.

    Channels are ordered otherwise than in `F.pixel_shuffle`, which is slow on a CPU.
    """
    batch, channels, height, width = cells.shape
    split = cells.view(batch, FINER, FINER, channels // FINER**2, height, width)
    return split.permute(0, 3, 4, 1, 5, 2).reshape(batch, -1, FINER * height, FINER * width)


class Block(nn.Module):
    """Two convolutions, the second's output scaled and shifted by the code."""

    def __init__(self, inputs: int, width: int, code: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(inputs, width, 3, padding=1, bias=False)
        self.first_norm: nn.Module = nn.BatchNorm2d(width)
        self.second = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.second_norm: nn.Module = nn.BatchNorm2d(width)
        self.film = nn.Linear(code, 2 * width)
        # at first the code changes nothing: training decides where it helps
        nn.init.zeros_(self.film.weight)
        nn.init.zeros_(self.film.bias)

    def forward(self, features: Tensor, code: Tensor) -> Tensor:
        """Compute the next features from the last ones and the code."""
        features = F.relu(self.first_norm(self.first(features)))
        features = self.second_norm(self.second(features))
        scale, shift = self.film(code)[..., None, None].chunk(2, dim=1)
        return F.relu(features * (1 + scale) + shift)

    def fuse(self) -> None:
        """Make each normalisation part of the convolution before it; twice is as good as once."""
        for conv, norm in (("first", "first_norm"), ("second", "second_norm")):
            if not isinstance(getattr(self, norm), nn.Identity):
                fused = fuse_conv_bn_eval(getattr(self, conv), getattr(self, norm))
                setattr(self, conv, fused)
                setattr(self, norm, nn.Identity())


def save_weights(path: Path, network: IuvNetwork, notes: Mapping[str, str]) -> None:
    """Write the weights in half precision, with notes on what they were trained on.

    The caller publishes the file: it is written in place.
    """
    tensors = {
        name: (value.half() if value.is_floating_point() else value).contiguous()
        for name, value in network.state_dict().items()
    }
    save_file(tensors, path, {"config": json.dumps(asdict(network.config)), **notes})


def load_weights(path: Path) -> IuvNetwork:
    """Load a network, as it was trained: `fused` makes it ready to be used.

    Raises: WeightsError if the file is missing, damaged, or another network's.
    """
    header = read_header(path, WHAT)
    config = read_config(header.metadata, path)
    # into float32, from the half precision of the file
    return load_network(lambda: IuvNetwork(config), header.state, path, WHAT)
