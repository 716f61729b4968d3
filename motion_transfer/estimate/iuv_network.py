"""The network that paints IUV from landmarks and mask: a small U-Net.

It never sees the picture, only what BlazePose says of it, so that synthetic people are all it has
to be trained on. Bones go in as maps; the same numbers as a row also scale and shift the features
of each decoder level (FiLM, Perez et al. 2018), so that far-away joints count everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.fusion import fuse_conv_bn_eval

from motion_transfer.estimate.body_features import (
    MAP_CHANNELS,
    VECTOR_LENGTH,
    BodyInput,
    feature_maps,
    feature_vector,
)

PARTS = 25
"""DensePose's 24 and the background."""

OUTPUT_SIZE = 128
FINER = 2
"""Output pixels a cell and side."""


@dataclass(frozen=True)
class IuvNetworkConfig:
    """Sizes.

    Attributes:
        widths: channels from the finest level (64 x 64) to the coarsest (8 x 8).
        code: numbers that the row of landmarks is condensed to.
    """

    widths: tuple[int, ...] = (32, 56, 96, 144)
    code: int = 128


class IuvLogits(NamedTuple):
    """What the network says of B windows.

    Attributes:
        parts: logits of background and 24 parts.
        uv: U and V of each part, in [0, 1] where that part is.
    """

    parts: Float[Tensor, "B 25 128 128"]
    uv: Float[Tensor, "B 24 2 128 128"]


class IuvNetwork(nn.Module):
    """Landmarks and mask -> parts, U and V on 128 x 128."""

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
        self.head = nn.Conv2d(widths[0], (PARTS + 2 * (PARTS - 1)) * FINER**2, 1)

    def forward(self, body: BodyInput) -> IuvLogits:
        """The logits of B people."""
        code = self.encode_row(feature_vector(body))
        features = self.stem(feature_maps(body))
        skips: list[Tensor] = []
        for level, block in enumerate(self.down):
            features = block(F.max_pool2d(features, 2) if level else features, code)
            skips.append(features)
        skips.pop()
        for block in self.up:
            larger = F.interpolate(features, scale_factor=2, mode="nearest")
            features = block(torch.cat([larger, skips.pop()], 1), code)
        out = spread_cells(self.head(features))
        parts, uv = out.split((PARTS, 2 * (PARTS - 1)), dim=1)
        return IuvLogits(parts, uv.unflatten(1, (PARTS - 1, 2)) + 0.5)

    def fused(self) -> IuvNetwork:
        """Itself, ready to be used only: normalisation becomes part of the convolutions."""
        self.eval()
        for block in self.modules():
            if isinstance(block, Block):
                block.fuse()
        return self


def spread_cells(cells: Float[Tensor, "B C h w"]) -> Float[Tensor, "B c H W"]:
    """Four values of each cell as four pixels; `F.pixel_shuffle`, which is slow on a CPU."""
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
        nn.init.zeros_(self.film.weight)
        nn.init.zeros_(self.film.bias)

    def forward(self, features: Tensor, code: Tensor) -> Tensor:
        features = F.relu(self.first_norm(self.first(features)))
        features = self.second_norm(self.second(features))
        scale, shift = self.film(code)[..., None, None].chunk(2, dim=1)
        return F.relu(features * (1 + scale) + shift)

    def fuse(self) -> None:
        for conv, norm in (("first", "first_norm"), ("second", "second_norm")):
            if not isinstance(getattr(self, norm), nn.Identity):
                fused = fuse_conv_bn_eval(getattr(self, conv), getattr(self, norm))
                setattr(self, conv, fused)
                setattr(self, norm, nn.Identity())
