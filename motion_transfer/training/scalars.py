"""Numbers and pictures for TensorBoard."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import UInt8


class ScalarLog:
    """Writes to RUN/tensorboard, or nothing at all.

    Args:
        first: the step that the run goes on from; what an earlier, killed run wrote after it is
            hidden.
    """

    def __init__(self, run: Path, first: int, *, enabled: bool) -> None:
        self._writer = None
        if enabled:
            from torch.utils.tensorboard import SummaryWriter

            purge = first + 1 if first else None
            self._writer = SummaryWriter(str(run / "tensorboard"), purge_step=purge)

    def add(self, values: Mapping[str, float], step: int) -> None:
        """One point of each curve."""
        if self._writer is not None:
            for name, value in values.items():
                self._writer.add_scalar(name, value, step)

    def add_picture(self, name: str, picture: UInt8[np.ndarray, "H W 3"], step: int) -> None:
        """A picture."""
        if self._writer is not None:
            self._writer.add_image(name, picture, step, dataformats="HWC")

    def close(self) -> None:
        """Everything is on the disk."""
        if self._writer is not None:
            self._writer.close()
