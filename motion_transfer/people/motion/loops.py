"""Numbers that repeat without a seam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator


@dataclass(frozen=True)
class Loop:
    """Rows of numbers at phases, joined smoothly and round (monotone cubic, no overshoot).

    Attributes:
        curve: over three cycles, of which the middle one is used.
    """

    curve: PchipInterpolator

    @classmethod
    def through(
        cls, phases: Sequence[float] | np.ndarray, rows: np.ndarray, gain: np.ndarray | float = 0.0
    ) -> Loop:
        """Args: phases, rising in [0, 1); rows, one each; gain, what a cycle adds to a row."""
        x = np.concatenate([np.asarray(phases) + cycle for cycle in (-1, 0, 1)])
        return cls(PchipInterpolator(x, np.concatenate([rows + c * gain for c in (-1, 0, 1)])))

    def __call__(self, phase: float) -> np.ndarray:
        return self.curve(phase)
