"""What is measured on each pair: names, definitions, and how to get the numbers."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from jaxtyping import Bool, UInt8
from torch import Tensor

from motion_transfer.evaluation.framing import TargetFrame
from motion_transfer.training.metrics import (
    FLICKER_TEXELS,
    average_ssim,
    feature_distance,
    flicker,
    l1,
    psnr,
    ssim_map,
)

Image = UInt8[np.ndarray, "H W 3"]
Scores = dict[str, float]

MASKED = "-masked"
FeatureNetwork = Callable[[Tensor], Sequence[Tensor]]


@dataclass(frozen=True)
class Column:
    """One number of the table.

    Attributes:
        better: which end is good, `higher` or `lower`.
        decimals: digits after the point that mean something.
    """

    name: str
    better: str
    decimals: int
    definition: str


class Measure(Protocol):
    """Measures results of one pair against its target.

    Attributes:
        takes_turns: a call keeps the whole machine busy, so calls wait for each other.
    """

    columns: tuple[Column, ...]
    takes_turns: bool

    def measure(self, results: Sequence[Image], target: TargetFrame) -> list[Scores]:
        """One number for each column, for each result; all of the target's size."""
        ...


def with_masked(column: Column) -> tuple[Column, ...]:
    """A column and the same of the person alone."""
    masked = f"{column.definition}; only pixels of the mask"
    return column, Column(column.name + MASKED, column.better, column.decimals, masked)


class SsimMeasure:
    """Structural similarity."""

    takes_turns = False
    columns = with_masked(
        Column(
            "ssim",
            "higher",
            3,
            "SSIM (Wang 2004), Gaussian 11x11, sigma 1.5, population covariance, range 255; mean of"
            " R, G, B and of the pixels whose window lies inside",
        )
    )

    def measure(self, results: Sequence[Image], target: TargetFrame) -> list[Scores]:
        maps = [ssim_map(result, target.rgb) for result in results]
        return [
            {"ssim": average_ssim(one), "ssim-masked": average_ssim(one, target.mask)}
            for one in maps
        ]


class PixelMeasure:
    """A mean over pixels."""

    takes_turns = False

    def __init__(
        self,
        column: Column,
        compare: Callable[[Image, Image, Bool[np.ndarray, "H W"] | None], float],
    ) -> None:
        self.columns = with_masked(column)
        self._compare = compare

    def measure(self, results: Sequence[Image], target: TargetFrame) -> list[Scores]:
        return [
            {
                column.name: self._compare(result, target.rgb, mask)
                for column, mask in zip(self.columns, (None, target.mask), strict=True)
            }
            for result in results
        ]


def psnr_measure() -> PixelMeasure:
    definition = "PSNR in dB, 10 log10(255^2 / MSE over R, G, B)"
    return PixelMeasure(Column("psnr", "higher", 2, definition), psnr)


def l1_measure() -> PixelMeasure:
    definition = "mean absolute difference over R, G, B, levels of 0..255"
    return PixelMeasure(Column("l1", "lower", 2, definition), l1)


class FeatureMeasure:
    """Perceptual distance of a frozen classifier's features. Not LPIPS: nothing in it was learned
    from people's judgement, and the numbers are on another scale.

    Args:
        name: the network's, which is also the number's.
        network: B x 3 x H x W in [-1, 1] to feature maps; a frozen module.
    """

    takes_turns = True

    def __init__(self, name: str, network: torch.nn.Module) -> None:
        definition = (
            f"features of {name}: l2 of the difference of features of unit length, mean over"
            f" positions, then layers; weights sha256 {hash_weights(network)}"
        )
        self.columns = with_masked(Column(name, "lower", 4, definition))
        self._network = network

    def measure(self, results: Sequence[Image], target: TargetFrame) -> list[Scores]:
        with torch.inference_mode():
            layers = self._network(to_tensor([target.rgb, *results]))
            real, rendered = [maps[:1] for maps in layers], [maps[1:] for maps in layers]
            whole = feature_distance(rendered, real)
            person = feature_distance(rendered, real, target.mask)
        names = [column.name for column in self.columns]
        return [dict(zip(names, pair, strict=True)) for pair in zip(whole, person, strict=True)]


class FlickerMeasure:
    """Change between consecutive frames of a clip, measured on the body's surface."""

    columns = (
        Column(
            "flicker",
            "lower",
            2,
            "mean absolute difference, levels of 0..255, of two consecutive results unfolded by"
            f" their IUV into {FLICKER_TEXELS} x {FLICKER_TEXELS} texels, over texels seen in both",
        ),
    )

    def measure(
        self,
        before: Sequence[Image],
        target_before: TargetFrame,
        results: Sequence[Image],
        target: TargetFrame,
    ) -> list[Scores]:
        """For each method, from its result on the frame before and on this one."""
        return [
            {"flicker": flicker(first, target_before.iuv, second, target.iuv)}
            for first, second in zip(before, results, strict=True)
        ]


def to_tensor(images: Sequence[Image]) -> Tensor:
    """B x 3 x H x W in [-1, 1]."""
    return torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float() / 127.5 - 1


def hash_weights(network: torch.nn.Module) -> str:
    """The first 16 digits of the SHA-256 of a network's tensors by name."""
    content = hashlib.sha256()
    for name, tensor in sorted(network.state_dict().items()):
        content.update(f"{name} {list(tensor.shape)} {tensor.dtype}\n".encode())
        content.update(tensor.detach().cpu().contiguous().numpy().tobytes())
    return content.hexdigest()[:16]
