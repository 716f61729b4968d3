"""A job while it is worked on, and the results that it shares with others."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal

from motion_transfer.batch.job import Job
from motion_transfer.batch.tasks import ChunkOutline, Fetch, Outline
from motion_transfer.media.work import WorkFolder, key_of
from motion_transfer.option import part_of
from motion_transfer.render.options import RenderOptions, SourceOptions

Stage = Literal["begun", "preparing", "rendering", "assembling", "ended"]


def scan_name(options: RenderOptions) -> str:
    """Name what is seen of a driver; jobs of one name share it."""
    partners = tuple(partner.person for partner in options.partners)
    # a driver that is fitted to a source belongs to that source as well
    fitted = (part_of(options, SourceOptions), options.partners) if options.fit_body else None
    return _name(
        *("scan", options.driver, options.missing, options.iuv_order, options.frames),
        *(options.driver_kind, options.driver_person, options.estimator, options.estimator_model),
        *(options.azimuth, partners, fitted),
    )


def source_name(options: RenderOptions) -> str:
    """Name a source's appearance, the feature map; jobs of one name share it."""
    person = part_of(options, SourceOptions)
    words = person, options.partners, options.renderer, options.weights, options.adapt
    # what is behind is among the files that were looked at
    return _name("source", *words, options.background_file)


@cache
def _name(kind: str, *words: object) -> str:
    return f"{kind}-{key_of({kind: words})[:32]}"


@dataclass
class Shared:
    """A result that several jobs need: asked for once, kept until the last of them has ended.

    Attributes:
        name: Tells it from others, see `scan_name` and `source_name`.
        users: How many of those jobs have not ended.
        blobs: The result, by kind, as `Workers.share` gave it.
    """

    name: str
    users: int
    state: Literal["missing", "pending", "ready", "failed"] = "missing"
    blobs: dict[str, Fetch] = field(default_factory=dict)
    error: str = ""


@dataclass
class ActiveJob:
    """A job between its beginning and its end.

    Attributes:
        todo: Chunks that nobody works on yet.
        running: How many tasks of this job have not come back.
        left: How many chunks are not finished.
        tries: How often each chunk (by index), or another task (by kind), has failed.
        work_seconds: How long workers worked for it; what it shares counts where it was first
            needed.
        ours: Whether the existing output is what an earlier run of this job made.
    """

    job: Job
    work: WorkFolder
    scan: Shared
    source: Shared
    ours: bool
    stage: Stage = "begun"
    prepared: Fetch | None = None
    outline: Outline | None = None
    todo: list[ChunkOutline] = field(default_factory=list)
    running: int = 0
    left: int = 0
    tries: Counter[Any] = field(default_factory=Counter)
    error: str = ""
    work_seconds: float = 0.0

    @property
    def name(self) -> str:
        return self.job.name

    @property
    def blob_name(self) -> str:
        return f"run-{self.job.index}"
