"""A whole batch, from a manifest to its report: what `mt batch` calls."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.batch.events import BatchFinished, BatchListener, BatchStarted
from motion_transfer.batch.expand import check_inputs, expand, find_output_root
from motion_transfer.batch.job import Job
from motion_transfer.batch.manifest import Manifest, ManifestError, read_manifest
from motion_transfer.batch.remote import Deliveries, RemoteInputs
from motion_transfer.batch.report import write_report
from motion_transfer.batch.schedule import Scheduler, Tally
from motion_transfer.batch.signals import Signals
from motion_transfer.batch.state import DONE, TO_DO, BatchState
from motion_transfer.cores import core_count
from motion_transfer.devices import count_cuda
from motion_transfer.errors import InputError
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.option import is_url
from motion_transfer.render.workers import LocalWorkers, Workers

ENGINES = ("local", "ray")
MOST_PROBLEMS = 10  # missing inputs that are named; a wrong folder misses them all


@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """How a manifest is run.

    Attributes:
        settings: `key=value`, over the manifest's fields or every job's options.
        chosen: A half-open range of jobs, either end open.
        workers: How many processes; None: one for each GPU, or for each core.
        engine: `local`, or `ray` with the `cluster` extra.
        address: Where the Ray cluster is; `auto` finds one, None starts one on this machine.
        keep_going: Whether the others go on after a failed job.
        restart: Whether to forget what earlier runs finished.
    """

    manifest: Path
    settings: Sequence[str] = ()
    chosen: tuple[int | None, int | None] = (None, None)
    workers: int | None = None
    engine: str = "local"
    address: str | None = None
    keep_going: bool = True
    restart: bool = False

    def __post_init__(self) -> None:
        if self.engine not in ENGINES:
            raise InputError(f"engine {self.engine!r}; supported are {', '.join(ENGINES)}")
        if self.workers is not None and self.workers < 1:
            raise InputError(f"workers is {self.workers}; it must be at least 1")
        if self.address is not None and self.engine != "ray":
            raise InputError("--address is of a Ray cluster; add --engine ray")


@dataclass(frozen=True)
class Batch:
    """A manifest that was read."""

    manifest: Manifest
    jobs: list[Job]
    state: BatchState
    remote: RemoteInputs
    name: str


def read_batch(path: Path, settings: Sequence[str] = ()) -> Batch:
    """Read a manifest, `-` from standard input, and lay out its jobs. Raises: ManifestError."""
    manifest, text = read_manifest(path, settings)
    root = find_output_root(manifest, text.path)
    state = BatchState(text.path, root)
    remote = RemoteInputs(state.folder / "remote")
    return Batch(manifest, expand(manifest, text, remote), state, remote, text.name)


def check_batch(batch: Batch) -> None:
    """Check that all inputs are there. Raises: ManifestError naming those that are missing."""
    problems = list(check_inputs(batch.jobs, batch.remote))
    if problems:
        more = [f"and {len(problems) - MOST_PROBLEMS} more"] * (len(problems) > MOST_PROBLEMS)
        lines = [f"{batch.name}: {words}" for words in problems[:MOST_PROBLEMS]]
        raise ManifestError(*lines, *more)


def run_batch(options: BatchOptions, listener: BatchListener) -> Tally:
    """Run a manifest's jobs; those that are done and unchanged are left alone.

    Raises: ManifestError; OutputError if somebody else is at work on it; KeyboardInterrupt after
        a Ctrl-C, with everything finished kept.
    """
    began = time.monotonic()
    batch = read_batch(options.manifest, options.settings)
    jobs = choose_jobs(batch.jobs, options)
    with explain_disk_errors(batch.state.folder), batch.state.held():
        if options.restart:
            batch.state.forget()
        deliveries = _deliveries(batch, jobs, listener)
        with batch.remote.fetched(jobs) as refused:
            workers, signals = _open_workers(options, batch.state.scratch), Signals()
            scheduler = Scheduler(
                jobs,
                workers,
                batch.state,
                retries=batch.manifest.retries,
                keep_going=options.keep_going,
                restart=options.restart,
                listener=deliveries or listener,
                signals=signals,
                refused=refused,
            )
            listener(BatchStarted(len(jobs), workers.count))
            with deliveries or nullcontext(), signals.noted():
                tally = scheduler.run()
        if deliveries:
            deliveries.finish([j for j in jobs if batch.state.status_of(j.options.output) == DONE])
            tally.failed += deliveries.failed_count
        counts = (tally.done, tally.current, tally.failed, tally.left)
        seconds = time.monotonic() - began
        listener(BatchFinished(*counts, seconds, scheduler.feature_maps))
        report = write_report(batch.jobs, batch.state)  # of all jobs, after a Ctrl-C as well
        if deliveries:
            deliveries.send_report(report.parent)
    if signals.interrupted:
        raise KeyboardInterrupt
    return tally


def _deliveries(batch: Batch, jobs: list[Job], listener: BatchListener) -> Deliveries | None:
    """Make what sends the outputs, where they are to go to a URL."""
    url = batch.manifest.output_root
    if not is_url(url):
        return None
    return Deliveries(find_output_root(batch.manifest, batch.state.manifest), url, jobs, listener)


def count_jobs(batch: Batch) -> dict[str, int]:
    """Count the jobs that are done, failed and to do, as far as was noted."""
    counts = {DONE: 0, "failed": 0, TO_DO: 0}
    for job in batch.jobs:
        counts[batch.state.status_of(job.options.output)] += 1
    return counts


def choose_jobs(jobs: list[Job], options: BatchOptions) -> list[Job]:
    """Take the jobs that the options name. Raises: InputError if there are none."""
    start, stop = options.chosen
    chosen = jobs[slice(start, stop)]
    if not chosen:
        raise InputError(
            f"jobs {start or 0}:{len(jobs) if stop is None else stop} asked for, but"
            f" {options.manifest} has {len(jobs)}: 0:{len(jobs)} at most"
        )
    return chosen


def _open_workers(options: BatchOptions, scratch: Path) -> Workers:
    if options.engine == "ray":
        from motion_transfer.batch.ray_workers import RayWorkers

        return RayWorkers(options.workers, options.address)
    return LocalWorkers(options.workers or _default_count(), scratch)


def _default_count() -> int:
    """Count a worker for each GPU, or else for each core."""
    return count_cuda() or core_count()
