"""Checkpoints: one safetensors file that carries its own configuration.

Reading takes three steps, each of which says what it refuses: from the file to its header, from the
header to the configuration, and from the tensors to the model, all of them and no others.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.media.publish import name_beside
from motion_transfer.media.structured import parse_json, shown
from motion_transfer.media.work import digest_file
from motion_transfer.weights.tensors import (
    Array,
    Entry,
    check_weights,
    read_header,
    read_tensors,
)
from nhrr_core.config import ModelConfig
from nhrr_core.errors import ConfigError
from nhrr_core.tensors import list_tensors

if TYPE_CHECKING:
    import torch

    from nhrr_core import NeuralReRenderer

FORMAT = "nhrr-1"
RESERVED = ("format", "config")
LENGTH_BYTES = 8  # of the number that a safetensors file begins with
RANGES = "ranges"
"""The note that holds, as JSON, what `read_ranges` reads."""


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
    from safetensors.torch import save_file

    state = {}
    for name, tensor in model.state_dict().items():
        stored = dtype if tensor.is_floating_point() else None
        state[name] = tensor.detach().to("cpu", stored).contiguous()
    metadata = {"format": FORMAT, "config": json.dumps(model.config.to_dict()), **(notes or {})}
    temporary = name_beside(path, ".part")
    try:
        save_file(state, temporary, metadata=metadata)
        temporary.chmod(0o644)  # safetensors writes for the owner only
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def read_checkpoint(path: Path) -> tuple[ModelConfig, dict[str, Array]]:
    """Read configuration and tensors of a checkpoint, those that are floating as float32.

    Raises: WeightsError if the file is missing, truncated, not a checkpoint of this model, or its
        tensors are not exactly those that its configuration calls for.
    """
    header = read_header(path, "weights")
    config = _read_config(path, header.metadata)
    wanted = {
        name: Entry(shape, not name.endswith("num_batches_tracked"))
        for name, shape in list_tensors(config).items()
    }
    tensors = read_tensors(path, wanted, header.state, "weights")
    for name, values in tensors.items():
        if name.endswith("running_var") and (values < 0).any():
            raise WeightsError(
                f"weights {path} are damaged: {name} holds negative variances; download or export"
                " again"
            )
    return config, tensors


def load_checkpoint(path: Path) -> NeuralReRenderer:
    """Load the model of a checkpoint, in evaluation mode, on the CPU, in float32.

    Raises: WeightsError, see `read_checkpoint`.
    """
    import torch

    from nhrr_core import NeuralReRenderer

    config, tensors = read_checkpoint(path)
    model = NeuralReRenderer(config)
    model.load_state_dict({name: torch.tensor(values) for name, values in tensors.items()})
    return model.eval()


def digest_weights(path: Path) -> str:
    """Compute the SHA-256 of a checkpoint, hexadecimal. Raises: InputError if it cannot be read."""
    check_weights(path, "weights")
    return digest_file(path, "weights")


def inspect_checkpoint(path: Path) -> CheckpointInfo:
    """Tell what a checkpoint holds, without reading its tensors. Raises: WeightsError."""
    metadata, state = read_header(path, "weights")
    # safetensors tells them in an order that changes from run to run
    notes = {key: metadata[key] for key in sorted(metadata) if key not in RESERVED}
    count = sum(math.prod(entry.shape) for entry in state.values())
    return CheckpointInfo(path, _read_config(path, metadata), notes, len(state), count)


def copy_with_notes(path: Path, copy: Path, notes: Mapping[str, str]) -> None:
    """Write a copy of a checkpoint, its tensors as they are, with more notes.

    Raises: WeightsError if it cannot be read.
    """
    metadata = {**read_header(path, "weights").metadata, **notes}
    stored = path.read_bytes()
    end = LENGTH_BYTES + int.from_bytes(stored[:LENGTH_BYTES], "little")
    entries = json.loads(stored[LENGTH_BYTES:end])
    header = json.dumps({**entries, "__metadata__": metadata}).encode()
    header += b" " * (-len(header) % LENGTH_BYTES)  # the tensors begin at a multiple of it
    copy.write_bytes(len(header).to_bytes(LENGTH_BYTES, "little") + header + stored[end:])


def read_ranges(info: CheckpointInfo) -> dict[str, tuple[float, float]] | None:
    """Tell the least and the largest value that each of RenderNet's convolutions reads.

    They are what arithmetic of 8 bits needs to know, measured on pictures; see `RANGES`.

    Returns: By the names of the convolutions; None where the checkpoint does not say.
    Raises: WeightsError if what it says cannot be.
    """
    if RANGES not in info.notes:
        return None
    try:
        values = parse_json(info.notes[RANGES], RANGES)
        ranges = {str(name): (float(least), float(most)) for name, (least, most) in values.items()}
    except (InputError, AttributeError, TypeError, ValueError):
        ranges = {}
    convolutions = {name.removesuffix(".weight") for name in list_tensors(info.config)}
    if not ranges or any(
        name not in convolutions or not -math.inf < least <= most < math.inf
        for name, (least, most) in ranges.items()
    ):
        raise WeightsError(
            f"weights {info.path} carry broken ranges of their numbers; measure them again"
        )
    return ranges


def _read_config(path: Path, metadata: dict[str, str]) -> ModelConfig:
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            f"weights {path} are not a checkpoint of this model: their metadata has format"
            f" {metadata.get('format')!r}, not {FORMAT!r}"
        )
    try:
        values = parse_json(metadata.get("config", "null"), "config")
        if not isinstance(values, dict):
            raise ConfigError(f"{shown(values)} is no table of fields")
        return ModelConfig.from_dict(values)
    except (ConfigError, InputError) as error:
        raise WeightsError(f"weights {path} carry a broken configuration: {error}") from error
