"""Checkpoints: one safetensors file that carries its own configuration.

Reading takes three steps, each of which says what it refuses: from the file to tensors and
metadata, from metadata to the configuration, and from tensors to the model, all of them and no
others.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from motion_transfer.errors import WeightsError
from motion_transfer.media.work import digest_file
from nhrr_core import ConfigError, ModelConfig, NeuralReRenderer

FORMAT = "nhrr-1"
RESERVED = ("format", "config")


@dataclass(frozen=True)
class CheckpointInfo:
    """What a checkpoint says of itself: its configuration, notes (licence, data, ...) and size."""

    path: Path
    config: ModelConfig
    notes: dict[str, str]
    tensor_count: int
    parameter_count: int


def save_checkpoint(
    path: Path,
    model: NeuralReRenderer,
    *,
    notes: Mapping[str, str] | None = None,
    dtype: torch.dtype | None = None,
) -> None:
    """Write a model with its configuration, whole or not at all.

    Args:
        notes: Words about the weights, such as `licence` and `data`.
        dtype: What floating-point tensors are stored as; None: as they are.
    """
    state = {}
    for name, tensor in model.state_dict().items():
        stored = dtype if tensor.is_floating_point() else None
        state[name] = tensor.detach().to("cpu", stored).contiguous()
    metadata = {"format": FORMAT, "config": json.dumps(model.config.to_dict()), **(notes or {})}
    temporary = path.with_name(f".{path.name}.part")
    try:
        save_file(state, temporary, metadata=metadata)
        temporary.chmod(0o644)  # safetensors writes for the owner only
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def load_checkpoint(path: Path) -> NeuralReRenderer:
    """Load the model of a checkpoint, in evaluation mode, on the CPU, in float32.

    Raises: WeightsError if the file is missing, truncated, not a checkpoint of this model, or its
        tensors are not exactly those that its configuration calls for.
    """
    info, state = _read(path, with_tensors=True)
    model = NeuralReRenderer(info.config)
    if listed := list_misfits(model, state):
        raise WeightsError(f"weights {path} do not fit their own configuration: {listed}")
    model.load_state_dict(state)
    return model.eval()


def list_misfits(network: nn.Module, state: Mapping[str, Tensor]) -> str:
    """List up to three things that keep tensors from being exactly those of a network; else ""."""
    wanted = network.state_dict()
    problems = [f"{name} is missing" for name in wanted if name not in state]
    problems += [f"{name} is unknown" for name in state if name not in wanted]
    problems += [
        f"{name} is {list(state[name].shape)}, not {list(tensor.shape)}"
        for name, tensor in wanted.items()
        if name in state and state[name].shape != tensor.shape
    ]
    return "; ".join(problems[:3]) + ("; ..." if len(problems) > 3 else "")


def digest_weights(path: Path) -> str:
    """Compute the SHA-256 of a checkpoint, hexadecimal. Raises: InputError if it cannot be read."""
    return digest_file(path, "weights")


def inspect_checkpoint(path: Path) -> CheckpointInfo:
    """Tell what a checkpoint holds, without reading its tensors. Raises: WeightsError."""
    return _read(path, with_tensors=False)[0]


def _read(path: Path, *, with_tensors: bool) -> tuple[CheckpointInfo, dict[str, Tensor]]:
    if not path.is_file():
        raise WeightsError(f"weights {path} do not exist")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = dict(file.metadata() or {})
            shapes = {name: file.get_slice(name).get_shape() for name in file.keys()}  # noqa: SIM118
            state = {name: file.get_tensor(name) for name in shapes} if with_tensors else {}
    except (SafetensorError, OSError) as error:
        raise WeightsError(
            f"weights {path} are not a whole safetensors file ({error}); download or export again"
        ) from error
    config = _read_config(path, metadata)
    # safetensors tells them in an order that changes from run to run
    notes = {key: metadata[key] for key in sorted(metadata) if key not in RESERVED}
    count = sum(torch.Size(shape).numel() for shape in shapes.values())
    return CheckpointInfo(path, config, notes, len(shapes), count), state


def _read_config(path: Path, metadata: dict[str, str]) -> ModelConfig:
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            f"weights {path} are not a checkpoint of this model: their metadata has format"
            f" {metadata.get('format')!r}, not {FORMAT!r}"
        )
    try:
        return ModelConfig.from_dict(json.loads(metadata["config"]))
    except (KeyError, TypeError, AttributeError, json.JSONDecodeError, ConfigError) as error:
        raise WeightsError(f"weights {path} carry a broken configuration: {error}") from error
