"""Measures that other people's packages and weights compute: LPIPS and FID.

Neither is installed with the program, nor are their weights downloaded: both are given by the user.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.evaluation.framing import Image, PairPictures
from motion_transfer.evaluation.measures import (
    Column,
    Features,
    Numbers,
    SetMeasure,
    hash_weights,
    to_tensor,
)
from motion_transfer.media.work import digest_of
from motion_transfer.training.feature_networks import read_tensors
from motion_transfer.training.metrics import frechet_distance

BACKBONES = {11: "alex", 3: "vgg"}  # by the side of the first convolution's kernel
FIRST_LAYER = "features.0.weight"
DROP_LPIPS = "or leave lpips out of --metrics"

INCEPTION_FILE = "inception-2015-12-05.pt"  # the only name that clean-fid reads
DROP_FID = "or leave fid out of --metrics"


class LpipsMeasure:
    """LPIPS v0.1 as the authors' package computes it.

    The package brings its linear layers; its backbone, AlexNet or VGG-16, comes from a file in
    torchvision's naming (`features.0.weight`, ...), and which of the two it is shows in the file.

    Raises: InputError if the package cannot be imported or no file is given; WeightsError if the
        file is not such a backbone.
    Source: Zhang et al., CVPR 2018.
    """

    takes_turns = True

    def __init__(self, weights: Path | None) -> None:
        if weights is None:
            raise InputError(
                "lpips needs the backbone's weights: give AlexNet's or VGG-16's of torchvision with"
                f" --lpips-weights FILE, {DROP_LPIPS}"
            )
        package = _import("lpips", "lpips", DROP_LPIPS)
        backbone = _read_backbone(weights)
        net = BACKBONES[backbone[FIRST_LAYER].shape[-1]]
        # a random trunk, as anything else would be downloaded
        self._network = package.LPIPS(net=net, version="0.1", pnet_rand=True, verbose=False).eval()
        _fill_trunk(self._network.net, backbone, weights)
        definition = f"LPIPS v0.1 ({net}); weights sha256 {hash_weights(self._network)}"
        self.columns = (Column("lpips", "lower", 4, definition),)

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        with torch.inference_mode():
            rendered = to_tensor(shown.results)
            real = to_tensor([shown.target.rgb]).expand_as(rendered)
            return [(distance,) for distance in self._network(rendered, real).flatten().tolist()]


class FidMeasure(SetMeasure):
    """Fréchet inception distance of all results from all targets, with clean-fid's network.

    One number for a whole set: without a standard error, biased upwards for small sets, and only to
    be compared between sets of the same size. The distance itself is computed here, in float64.

    Raises: InputError if the package cannot be imported or no file is given; WeightsError if the
        file is not the network that clean-fid uses.
    Source: Heusel et al., NeurIPS 2017; resizing of Parmar et al., CVPR 2022.
    """

    def __init__(self, weights: Path | None) -> None:
        if weights is None:
            raise InputError(
                f"fid needs Inception's weights: give {INCEPTION_FILE} (TorchScript, as clean-fid"
                f" downloads it) with --fid-weights FILE, {DROP_FID}"
            )
        if not weights.is_file():
            raise WeightsError(f"weights {weights} do not exist")
        if weights.name != INCEPTION_FILE:
            raise WeightsError(f"weights {weights}: clean-fid reads only {INCEPTION_FILE}")
        inception = _import("cleanfid.inception_torchscript", "clean-fid", DROP_FID)
        resizing = _import("cleanfid.resize", "clean-fid", DROP_FID)
        try:
            self._network = inception.InceptionV3W(str(weights.parent), download=False).eval()
        except RuntimeError as error:
            raise WeightsError(f"weights {weights} cannot be read: {error}") from error
        self._resize = resizing.build_resizer("clean")
        digest = digest_of(weights)[:16]
        definition = f"FID, clean-fid's resizing and Inception; weights sha256 {digest}"
        self.columns = (Column("fid", "lower", 2, definition),)

    def features(self, images: Sequence[Image]) -> list[Features]:
        """Compute Inception's pooled features of each picture."""
        resized = np.stack([self._resize(image) for image in images])
        with torch.inference_mode():
            batch = torch.from_numpy(resized).permute(0, 3, 1, 2).float()
            return list(self._network(batch).double().numpy())

    def distance(self, results: Sequence[Features], targets: Sequence[Features]) -> float:
        """Compute the distance; NaN for fewer than two pictures, which have no spread."""
        return (
            frechet_distance(np.stack(results), np.stack(targets)) if len(results) > 1 else math.nan
        )


def _import(module: str, package: str, otherwise: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        raise InputError(
            f"{package} cannot be imported ({error}); install it with `pip install {package}`,"
            f" {otherwise}"
        ) from error


def _read_backbone(path: Path) -> dict[str, Tensor]:
    """The tensors of a `.pth` or `.safetensors` file. Raises: WeightsError."""
    state = read_tensors(path, what="LPIPS's backbone", remedy=f"give another file, {DROP_LPIPS}")
    first = state.get(FIRST_LAYER)
    if first is None or first.shape[-1] not in BACKBONES:
        raise WeightsError(
            f"weights {path} are neither AlexNet nor VGG-16 as torchvision names their tensors"
            f" ({FIRST_LAYER} of 11 x 11 or 3 x 3); give another file, {DROP_LPIPS}"
        )
    return state


def _fill_trunk(trunk: torch.nn.Module, backbone: Mapping[str, Tensor], path: Path) -> None:
    """Put a backbone into the package's trunk, which holds the same layers in slices.

    Raises: WeightsError if a layer is missing or of another shape.
    """
    state = trunk.state_dict()
    for name, wanted in state.items():
        source = re.sub(r"^slice\d+\.", "features.", name)
        if source not in backbone or backbone[source].shape != wanted.shape:
            found = list(backbone[source].shape) if source in backbone else "missing"
            raise WeightsError(
                f"weights {path}: {source} is {found}, expected {list(wanted.shape)}"
            )
        state[name] = backbone[source]
    trunk.load_state_dict(state)
