"""A job while it is worked on, and the things that several jobs share."""

from __future__ import annotations

import time
from collections import Counter, deque
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal

from motion_transfer.batch.expand import Job
from motion_transfer.batch.signature import Files
from motion_transfer.batch.tasks import ChunkOutline, Fetch, Outline
from motion_transfer.media.work import WorkFolder, key_of
from motion_transfer.render.options import RenderOptions

Stage = Literal["begun", "preparing", "rendering", "assembling", "ended"]


def scan_name(options: RenderOptions) -> str:
    """Jobs of one name share a look at their driver; a fitted one is also its source's."""
    fitted = ()
    if options.fit_body:
        fitted = (options.source, options.source_iuv, options.source_iuv_order, options.person)
    return _name(
        *("scan", options.driver, options.missing, options.iuv_order, options.frames),
        *(options.driver_kind, options.driver_person, options.estimator, options.estimator_model),
        *fitted,
    )


def look_name(options: RenderOptions) -> str:
    """Jobs of one name share a source's appearance: the feature map."""
    return _name(
        *("look", options.source, options.source_iuv, options.source_iuv_order, options.person),
        *(options.garments, options.renderer, options.weights),
        *(options.estimator, options.estimator_model),
    )


@cache
def _name(kind: str, *words: object) -> str:
    return f"{kind}-{key_of({kind: words})[:32]}"


@dataclass
class Shared:
    """A result that several jobs need: asked for once, kept until the last of them has ended."""

    users: int = 0
    state: Literal["missing", "pending", "ready", "failed"] = "missing"
    blobs: dict[str, Fetch] = field(default_factory=dict)
    files: Files = field(default_factory=dict)
    notices: list[str] = field(default_factory=list)
    error: str = ""
    tries: int = 0


@dataclass
class ActiveJob:
    """A job between its beginning and its end.

    Attributes:
        todo: chunks that nobody works on yet.
        running: tasks of this job that have not come back.
        tries: how often each chunk (by index), or another task (by kind), has failed.
        ours: the existing output is what an earlier run of this job made.
    """

    job: Job
    work: WorkFolder
    scan: Shared
    look: Shared
    scan_name: str
    look_name: str
    ours: bool
    stage: Stage = "begun"
    prepared: Fetch | None = None
    outline: Outline | None = None
    todo: deque[ChunkOutline] = field(default_factory=deque)
    running: int = 0
    left: int = 0
    tries: Counter[Any] = field(default_factory=Counter)
    error: str = ""
    began: float = field(default_factory=time.monotonic)

    @property
    def name(self) -> str:
        return self.job.name

    @property
    def blob_name(self) -> str:
        return f"run-{self.job.index}"
