"""What a batch says while it works; what is said of a job names it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar


@dataclass(frozen=True)
class BatchStarted:
    """Jobs were read, and the first of them begin."""

    event: ClassVar = "batch-started"
    job_count: int
    workers: int


@dataclass(frozen=True)
class JobPlanned:
    """A job's frames are known; `done_count` of them were finished by an earlier run."""

    event: ClassVar = "job-planned"
    name: str
    frame_count: int
    done_count: int


@dataclass(frozen=True)
class JobFrames:
    """So many more frames of a job are done."""

    event: ClassVar = "job-frames"
    name: str
    frame_count: int


@dataclass(frozen=True)
class JobNotice:
    """Something the user should know of a job, though the work goes on."""

    event: ClassVar = "job-notice"
    name: str
    message: str


@dataclass(frozen=True)
class JobDone:
    """A job's output has its final name, or stands whole at its URL."""

    event: ClassVar = "job-done"
    name: str
    output: Path | str
    frame_count: int
    seconds: float
    """Of the workers: what they worked for the job, without its waiting for others."""


@dataclass(frozen=True)
class JobFailed:
    """A job will not be done in this run."""

    event: ClassVar = "job-failed"
    name: str
    message: str


@dataclass(frozen=True)
class BatchStopping:
    """A first Ctrl-C: running chunks are finished, nothing new begins."""

    event: ClassVar = "batch-stopping"
    running_count: int


@dataclass(frozen=True)
class BatchFinished:
    """Nothing is running any more. `left_count` jobs were not begun or not finished."""

    event: ClassVar = "batch-finished"
    done_count: int
    current_count: int
    failed_count: int
    left_count: int
    seconds: float
    feature_maps: int


JobEvent = JobPlanned | JobFrames | JobNotice | JobDone | JobFailed
BatchEvent = BatchStarted | JobEvent | BatchStopping | BatchFinished
BatchListener = Callable[[BatchEvent], None]
