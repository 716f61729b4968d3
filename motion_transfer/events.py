"""What long work says of itself: the command line draws it, `--json` prints it, pages show it.

`event` is the name that `--json` prints: programs know it, and it stays when a class is renamed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar


@dataclass(frozen=True)
class Started:
    """The input is accepted: what will be rendered, and how."""

    event: ClassVar = "started"
    renderer: str
    frame_count: int
    width: int
    height: int
    frame_rate: str


@dataclass(frozen=True)
class Stage:
    """A step of known length begins (`adapt`, `compare`, `estimate`, `track`,
    `draw`, `look`, `scan`, `render`)."""

    event: ClassVar = "stage"
    name: str
    frame_count: int


@dataclass(frozen=True)
class FramesDone:
    """So many more frames of the current stage are finished."""

    event: ClassVar = "frames-done"
    frame_count: int


@dataclass(frozen=True)
class Notice:
    """Something the user should know, though the work goes on."""

    event: ClassVar = "notice"
    message: str


@dataclass(frozen=True)
class Finished:
    """The output has its final name, or stands whole at its URL."""

    event: ClassVar = "finished"
    output: Path | str
    frame_count: int
    duration_seconds: float
    renderer: str
    wall_seconds: float
    render_seconds: float


@dataclass(frozen=True)
class Failed:
    """The command ends without what it was asked for; the last line that `--json` prints."""

    event: ClassVar = "failed"
    exit_code: int
    message: str


Event = Started | Stage | FramesDone | Notice | Finished
Listener = Callable[[Event], None]


def ignore(_event: Event) -> None:
    """Hear an event and do nothing."""
