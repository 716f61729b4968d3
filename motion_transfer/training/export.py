"""Weights for `mt run`, with what they were trained on, how, and under which licence."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.training.config import TrainConfig
from motion_transfer.training.config_file import write_toml
from motion_transfer.version import __version__
from motion_transfer.weights.checkpoint import save_checkpoint
from nhrr_core import NeuralReRenderer


def describe_weights(config: TrainConfig, data: str, step: int) -> dict[str, str]:
    """The notes that travel inside a weights file."""
    return {
        "licence": config.run.licence,
        "data": data,
        "step": str(step),
        "trained_by": f"motion-transfer {__version__}",
        "train.toml": write_toml(config),
    }


def export_weights(path: Path, model: NeuralReRenderer, notes: Mapping[str, str]) -> None:
    """Write a checkpoint, whole or not at all. Raises: OutputError."""
    with explain_disk_errors(path):
        save_checkpoint(path, model, notes=notes)
