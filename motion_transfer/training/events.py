"""What a run tells while it goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Logged:
    """Some steps are done.

    Attributes:
        terms: the losses of the last step, not weighted; `total` is their weighted sum.
        wait_share: of the time since the last such event, what was spent waiting for data.
    """

    step: int
    steps: int
    terms: Mapping[str, float]
    samples_per_second: float
    wait_share: float


@dataclass(frozen=True)
class Saved:
    """A checkpoint or a sample grid is on the disk."""

    path: Path


@dataclass(frozen=True)
class Note:
    """Something the user should know."""

    message: str


Event = Logged | Saved | Note
Listener = Callable[[Event], None]


@dataclass(frozen=True)
class TrainResult:
    """How a run ended.

    Attributes:
        stopped: it was asked to, before its last step.
        weights: the exported file.
    """

    step: int
    stopped: bool
    weights: Path
    samples_per_second: float
    wait_share: float
