"""LPIPS (Zhang et al., CVPR 2018), by the authors' package, if it is installed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.evaluation.framing import TargetFrame
from motion_transfer.evaluation.measures import Column, Scores, hash_weights, to_tensor
from motion_transfer.training.pretrained import read_tensors

Image = UInt8[np.ndarray, "H W 3"]

BACKBONES = {11: "alex", 3: "vgg"}  # by the side of the first convolution's kernel
FIRST_LAYER = "features.0.weight"
DROP = "or leave lpips out of --metrics"


class LpipsMeasure:
    """LPIPS v0.1 as the package computes it.

    The package brings its linear layers; its backbone, AlexNet or VGG-16, comes from a file in
    torchvision's naming (`features.0.weight`, ...), and which of the two it is shows in the file.

    Raises: InputError if the package cannot be imported or no file is given; WeightsError if the
        file is not such a backbone.
    """

    takes_turns = True

    def __init__(self, weights: Path | None) -> None:
        if weights is None:
            raise InputError(
                "lpips needs the backbone's weights: give AlexNet's or VGG-16's of torchvision with"
                f" --lpips-weights FILE, {DROP}"
            )
        try:
            package = import_module("lpips")
        except ImportError as error:
            raise InputError(
                f"lpips cannot be imported ({error}); install it with `pip install lpips`, {DROP}"
            ) from error
        backbone = read_backbone(weights)
        net = BACKBONES[backbone[FIRST_LAYER].shape[-1]]
        # a random trunk, as anything else would be downloaded
        self._network = package.LPIPS(net=net, version="0.1", pnet_rand=True, verbose=False).eval()
        fill_trunk(self._network.net, backbone, weights)
        definition = f"LPIPS v0.1 ({net}); weights sha256 {hash_weights(self._network)}"
        self.columns = (Column("lpips", "lower", 4, definition),)

    def measure(self, results: Sequence[Image], target: TargetFrame) -> list[Scores]:
        with torch.inference_mode():
            rendered = to_tensor(results)
            real = to_tensor([target.rgb]).expand_as(rendered)
            distances = self._network(rendered, real).flatten().tolist()
        return [{"lpips": distance} for distance in distances]


def read_backbone(path: Path) -> dict[str, Tensor]:
    """The tensors of a `.pth` or `.safetensors` file. Raises: WeightsError."""
    state = read_tensors(path, what="LPIPS's backbone", remedy=f"give another file, {DROP}")
    first = state.get(FIRST_LAYER)
    if first is None or first.shape[-1] not in BACKBONES:
        raise WeightsError(
            f"weights {path} are neither AlexNet nor VGG-16 as torchvision names their tensors"
            f" ({FIRST_LAYER} of 11 x 11 or 3 x 3); give another file, {DROP}"
        )
    return state


def fill_trunk(trunk: torch.nn.Module, backbone: Mapping[str, Tensor], path: Path) -> None:
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
