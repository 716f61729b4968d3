"""The IUV network's weights: one safetensors file with its sizes inside."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from importlib.resources import as_file, files
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from motion_transfer.errors import WeightsError
from motion_transfer.estimate.iuv_network import IuvNetwork, IuvNetworkConfig

SHIPPED = "iuv_network.safetensors"


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
    """A network ready to be used.

    Raises: WeightsError if the file is missing, damaged, or another network's.
    """
    try:
        with safe_open(path, "pt") as stored:
            config = json.loads((stored.metadata() or {})["config"])
            config["widths"] = tuple(config["widths"])
            network = IuvNetwork(IuvNetworkConfig(**config))
            tensors = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
        network.load_state_dict(
            {n: t.float() if t.is_floating_point() else t for n, t in tensors.items()}
        )
    except (OSError, SafetensorError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise WeightsError(
            f"{path} holds no weights of the IUV network ({type(error).__name__}: {error});"
            " give a file written by motion_transfer.estimate.iuv_training"
        ) from error
    return network.fused().requires_grad_(False)


def has_shipped() -> bool:
    """Whether weights came with the package."""
    return files("motion_transfer.estimate").joinpath(SHIPPED).is_file()


def load_shipped() -> IuvNetwork:
    """The weights that come with the package. Raises: WeightsError."""
    resource = files("motion_transfer.estimate").joinpath(SHIPPED)
    if not has_shipped():
        raise WeightsError(
            f"this installation lacks {SHIPPED}, the weights with which the blazepose estimator"
            " paints IUV; choose the densepose estimator with a model of yours, or give IUV"
        )
    with as_file(resource) as path:
        return load_weights(path)


def average(into: IuvNetwork, source: IuvNetwork, keep: float) -> None:
    """Move `into` towards `source`: an exponential moving average of weights and statistics."""
    with torch.no_grad():
        for kept, new in zip(into.state_dict().values(), source.state_dict().values(), strict=True):
            if kept.is_floating_point():
                kept.lerp_(new, 1 - keep)
            else:
                kept.copy_(new)
