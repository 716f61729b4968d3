"""Find, check and load checkpoints."""

from motion_transfer.weights.checkpoint import (
    CheckpointInfo,
    inspect_checkpoint,
    list_misfits,
    load_checkpoint,
    save_checkpoint,
)

__all__ = [
    "CheckpointInfo",
    "inspect_checkpoint",
    "list_misfits",
    "load_checkpoint",
    "save_checkpoint",
]
