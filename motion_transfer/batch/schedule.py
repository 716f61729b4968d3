"""The scheduler: which task runs next in which worker, and what follows from its result.

It holds names, not pixels: whatever is large goes from worker to worker as blobs. So its memory
grows with neither frames nor running jobs, of which there are only a few at a time.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

from motion_transfer.batch import events, tasks
from motion_transfer.batch.active import ActiveJob, Shared, scan_name, source_name
from motion_transfer.batch.job import Job
from motion_transfer.batch.signals import Signals
from motion_transfer.batch.state import BatchState, is_current, is_ours, sign
from motion_transfer.errors import InputError, MotionTransferError, OutputError
from motion_transfer.media.publish import check_destination, explain_disk_errors
from motion_transfer.media.unchanged import status_key
from motion_transfer.media.work import WorkFolder, was_published
from motion_transfer.render.chunks import render
from motion_transfer.render.workers import Workers

log = logging.getLogger(__name__)

POLL_SECONDS = 0.5  # how soon a signal is heeded
SPARE_JOBS = 2  # planned ahead, beyond one for each worker
LOST = "its worker process was killed, perhaps for want of memory; try fewer --workers"


@dataclass
class Task:
    """A call in a worker, and whom its result is for.

    Attributes:
        shared: The result that it makes, if other jobs wait for it as well.
        chunks: Those that it renders.
        began: When it was given to a worker, who is free by then.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    owner: ActiveJob
    shared: Shared | None = None
    chunks: list[tasks.ChunkOutline] = field(default_factory=list)
    began: float = field(default_factory=time.monotonic)

    @property
    def kind(self) -> str:
        return self.function.__name__


@dataclass
class Tally:
    """How many jobs of a run ended how; `current` ones had nothing to do."""

    done: int = 0
    current: int = 0
    failed: int = 0
    left: int = 0


@dataclass(eq=False)
class Scheduler:
    """Runs jobs on workers until none is left, or until it is told to stop.

    Attributes:
        retries: How often a chunk that failed is tried again.
        keep_going: Whether other jobs go on after a failed one.
        restart: Whether to forget what earlier runs finished.
        refused: Why jobs cannot be done, by their index.
        tally: How the jobs ended.
        feature_maps: How many sources' appearance was computed.
    """

    jobs: Sequence[Job]
    workers: Workers
    state: BatchState
    retries: int
    keep_going: bool
    restart: bool
    listener: events.BatchListener
    signals: Signals
    refused: Mapping[int, str] = field(default_factory=dict)
    tally: Tally = field(default_factory=Tally)
    feature_maps: int = 0

    def __post_init__(self) -> None:
        self._active: list[ActiveJob] = []
        self._running: dict[Future[Any], tuple[int, Task]] = {}
        self._last: dict[int, tuple[str, int]] = {}  # by place: what it decoded, driver and start
        self._halted = False
        self._status_of = cache(status_key)  # thousands of jobs have a few inputs
        self._waiting = self._order(self.jobs)

    def run(self) -> Tally:
        """Work until nothing is left to do, then end the workers.

        The first Ctrl-C lets running chunks finish; one while they do stops now, as SIGTERM does.
        However it ends, every finished chunk is kept.
        """
        interrupted = True
        try:
            while True:
                self.signals.heed(self.halt)
                if not self._halted:
                    self._fill()
                if not self._running:
                    break
                done, _ = wait(self._running, timeout=POLL_SECONDS, return_when=FIRST_COMPLETED)
                for future in done:
                    self._receive(future)
            interrupted = False
        finally:
            self.workers.stop(now=interrupted)  # before the folders they write in are tidied
            self.tally.left = len(self._waiting)
            for active in list(self._active):
                self.tally.left += not active.error
                self._end(active)
        return self.tally

    def halt(self) -> bool:
        """Begin nothing new; what runs is finished. Returns: False if it was so already."""
        if self._halted:
            return False
        self._halted = True
        self.listener(events.BatchStopping(len(self._running)))
        return True

    def _order(self, jobs: Sequence[Job]) -> list[Job]:
        """Order jobs, the last first: by priority, jobs of one driver together, else as written."""
        first: dict[tuple[int, str], int] = {}
        users: Counter[str] = Counter()
        names: dict[int, str] = {}
        for job in jobs:
            names[job.index] = scan_name(job.options)
            first.setdefault((job.priority, names[job.index]), job.index)
            users.update((names[job.index], source_name(job.options)))
        self._shared = {name: Shared(name, count) for name, count in users.items()}
        return sorted(
            jobs,
            key=lambda job: (-job.priority, first[job.priority, names[job.index]], job.index),
            reverse=True,
        )

    # which task is next

    def _fill(self) -> None:
        busy = {place for place, _ in self._running.values()}
        for place in range(self.workers.count):
            if place in busy:
                continue
            task = self._next(place)
            if task is None:
                return
            task.owner.running += 1
            future = self.workers.submit(place, task.function, *task.arguments)
            self._running[future] = place, task

    def _next(self, place: int) -> Task | None:
        while not self._halted:
            for active in self._by_preference(place):
                task = self._task_of(active, place)
                if task is not None:
                    return task
            if not self._waiting or len(self._active) >= self.workers.count + SPARE_JOBS:
                return None
            self._begin(self._waiting.pop())
        return None

    def _by_preference(self, place: int) -> list[ActiveJob]:
        """Sort by priority; then come jobs with a chunk whose frames this worker just decoded."""
        last = self._last.get(place)

        def distance(active: ActiveJob) -> tuple[int, bool]:
            same = any((active.scan.name, chunk.start) == last for chunk in active.todo)
            return -active.job.priority, not same

        return sorted(self._active, key=distance)

    def _task_of(self, active: ActiveJob, place: int) -> Task | None:
        options = active.job.options
        if active.error:
            return None
        if active.stage == "begun":
            if active.scan.state == "missing":
                active.scan.state = "pending"
                arguments = (options, self.state.estimates)
                return Task(tasks.scan, arguments, active, active.scan)
            if active.source.state == "missing":
                active.source.state = "pending"
                return Task(tasks.encode, (options,), active, active.source)
            if active.scan.state == active.source.state == "ready":
                active.stage = "preparing"
                blobs = (active.scan.blobs["scan"], active.source.blobs["source"])
                arguments = (options, *blobs, self.state.estimates)
                return Task(tasks.prepare, arguments, active)
        elif active.stage == "rendering" and active.todo:
            return self._chunk_task(active, place)
        elif active.stage == "rendering" and not active.left and not active.running:
            active.stage = "assembling"
            stem = self.state.picture_stem(options.output)
            arguments = (options, active.prepared, active.work.path, stem)
            return Task(tasks.assemble, arguments, active)
        return None

    def _chunk_task(self, active: ActiveJob, place: int) -> Task:
        assert active.outline is not None
        # in order, from the frames on that this worker has just decoded for another job, if any
        todo = sorted(active.todo, key=lambda chunk: chunk.index)
        starts = [(active.scan.name, chunk.start) for chunk in todo]
        last = self._last.get(place)
        begin = starts.index(last) if last in starts else 0
        todo = todo[begin:] + todo[:begin]
        count = active.outline.chunks_at_once
        chunks, active.todo = todo[:count], todo[count:]
        self._last[place] = active.scan.name, chunks[-1].start
        arguments = (
            active.blob_name,
            active.prepared,
            active.source.name,
            active.source.blobs["appearances"],
            active.work.path,
            active.job.options.output,
            [(c.index, active.work.temporary(c.piece), c.piece) for c in chunks],
            active.job.options.sheet is not None,
            True,
        )
        return Task(render, arguments, active, chunks=chunks)

    def _begin(self, job: Job) -> None:
        options = job.options
        signature = self.state.records.get(str(options.output), {}).get("signature", {})
        shared = self._shared[scan_name(options)], self._shared[source_name(options)]
        if not self.restart and is_current(options, signature, self._status_of):
            self.tally.current += 1
            self._release(*shared)
            return
        ours = is_ours(options, signature)
        work = WorkFolder(options.output, restart=self.restart)
        active = ActiveJob(job, work, *shared, ours)
        try:
            if job.index in self.refused:
                raise InputError(self.refused[job.index])
            # a run that was killed right after publishing left an output that is ours, unnoted
            published = not self.restart and was_published(options.output)
            for path in filter(None, (options.output, options.sheet)):
                check_destination(path, force=options.force or ours or published)
            work.__enter__()  # left by `_end`
        except (MotionTransferError, OSError) as error:
            self._release(*shared)
            self._report_failure(active, str(error))
            return
        self._active.append(active)
        for result in shared:
            if result.state == "failed":
                self._fail(active, result.error)
                break

    # what follows from a result

    def _receive(self, future: Future[Any]) -> None:
        place, task = self._running.pop(future)
        active = task.owner
        active.running -= 1
        seconds = time.monotonic() - task.began
        active.work_seconds += seconds
        log.debug("worker %d, %s: %s, %.2f s", place, active.name, task.kind, seconds)
        try:
            result = future.result()
        except self.workers.lost_error:
            self._last.pop(place, None)  # what it had decoded is lost with it
            self._retry(task, LOST)
        except InputError as error:  # of which nothing is better at the second try
            self._give_up(task, str(error))
        except Exception as error:  # whatever a worker raises fails its job, never the batch
            self._retry(task, str(error) or type(error).__name__)
        else:
            try:
                with explain_disk_errors(active.job.options.output):
                    getattr(self, f"_{task.kind}_done")(task, result)
            except (MotionTransferError, OSError) as error:
                self._give_up(task, str(error))
        if active.error and not active.running:
            self._end(active)

    def _scan_done(self, task: Task, result: tuple[bytes, list[str]]) -> None:
        blob, notices = result
        self._ready(task, {"scan": (task.owner.scan.name, blob)})
        for notice in notices:
            self.listener(events.JobNotice(task.owner.name, notice))

    def _encode_done(self, task: Task, result: tuple[bytes, bytes, tuple[str, ...]]) -> None:
        sources, appearances, notices = result
        name = task.owner.source.name
        blobs = {"source": (f"source-{name}", sources), "appearances": (name, appearances)}
        self._ready(task, blobs)
        self.feature_maps += 1
        for notice in notices:
            self.listener(events.JobNotice(task.owner.name, notice))

    def _ready(self, task: Task, blobs: dict[str, tuple[str, bytes]]) -> None:
        assert task.shared is not None
        for kind, (name, blob) in blobs.items():
            task.shared.blobs[kind] = self.workers.share(name, blob)
        task.shared.state = "ready"

    def _prepare_done(self, task: Task, result: tuple[bytes, tasks.Outline]) -> None:
        active = task.owner
        blob, outline = result
        active.outline = outline
        if active.work.published(outline.output_key):  # by a run that was killed right after it
            self._succeed(active, None)
            return
        options = active.job.options
        # somebody else may have put it there since the job began
        if options.output.exists() and not (options.force or active.ours):
            raise OutputError(f"{options.output} exists already; choose another name or set force")
        active.prepared = self.workers.share(active.blob_name, blob)
        active.todo = [c for c in outline.chunks if not active.work.has(c.piece, c.key)]
        active.left = len(active.todo)
        active.stage = "rendering"
        missing = sum(chunk.stop - chunk.start for chunk in active.todo)
        done = outline.frame_count - missing
        self.listener(events.JobPlanned(active.name, outline.frame_count, done))

    def _render_done(self, task: Task, result: list[tuple[int, str]]) -> None:
        digests = dict(result)
        for chunk in task.chunks:
            task.owner.work.note(chunk.piece, digests[chunk.index], chunk.key)
            task.owner.left -= 1
            self.listener(events.JobFrames(task.owner.name, chunk.stop - chunk.start))

    def _assemble_done(self, task: Task, result: tuple[Path, bool]) -> None:
        finished, posters = result
        assert task.owner.outline is not None
        task.owner.work.publish(finished, task.owner.outline.output_key)
        self._succeed(task.owner, posters)

    def _succeed(self, active: ActiveJob, posters: bool | None) -> None:
        outline, output = active.outline, active.job.options.output
        assert outline is not None
        self.state.record(
            {
                **_facts(active, "done"),
                "frames": outline.frame_count,
                "duration_seconds": outline.duration_seconds,
                "renderer": outline.renderer,
                "note": outline.note or None,
                "poster": posters,
                "signature": sign(active.job.options, outline.files),
            }
        )
        active.work.clear()
        self.tally.done += 1
        self._end(active)
        if outline.note:
            self.listener(events.JobNotice(active.name, outline.note))
        self.listener(events.JobDone(active.name, output, outline.frame_count, active.work_seconds))

    def _retry(self, task: Task, message: str) -> None:
        """Put a failed task back, unless it has failed too often."""
        active = task.owner
        keys = [chunk.index for chunk in task.chunks] or [task.kind]
        active.tries.update(keys)
        if max(active.tries[key] for key in keys) > self.retries:
            if task.chunks:
                frames = f"{task.chunks[0].start}:{task.chunks[-1].stop}"
                message = f"frames {frames} failed {self.retries + 1} times: {message}"
            self._give_up(task, message)
        elif task.chunks:
            active.todo += task.chunks
        elif task.shared is not None:
            task.shared.state = "missing"
        else:
            active.stage = "begun" if task.kind == "prepare" else "rendering"

    def _give_up(self, task: Task, message: str) -> None:
        """Fail the job; of a shared task, every job that waits for it."""
        owners = [task.owner]
        if task.shared is not None:
            task.shared.state, task.shared.error = "failed", message
            owners = [a for a in self._active if task.shared in (a.scan, a.source)]
        for active in owners:
            self._fail(active, message)

    def _fail(self, active: ActiveJob, message: str) -> None:
        if not active.error:
            self._report_failure(active, message)
        if not active.running:
            self._end(active)

    def _report_failure(self, active: ActiveJob, message: str) -> None:
        active.error = message
        active.todo.clear()
        self.tally.failed += 1
        with suppress(OutputError):  # on a full disk; what is not noted is tried again all the same
            self.state.record({**_facts(active, "failed"), "error": message})
        self.listener(events.JobFailed(active.name, message))
        if not self.keep_going:
            self.halt()

    def _end(self, active: ActiveJob) -> None:
        if active.stage == "ended":
            return
        active.stage = "ended"
        self._active.remove(active)
        active.work.__exit__(None, None, None)
        self.workers.forget(active.blob_name)
        self._release(active.scan, active.source)

    def _release(self, *results: Shared) -> None:
        """Let go of what a job shared; what nobody needs any more is forgotten."""
        for shared in results:
            shared.users -= 1
            if not shared.users:
                for blob in (shared.name, f"source-{shared.name}"):
                    self.workers.forget(blob)
                shared.blobs.clear()


def _facts(active: ActiveJob, status: str) -> dict[str, Any]:
    options = active.job.options
    return {
        "output": str(options.output),
        "name": active.name,
        "status": status,
        "source": options.source_words,
        "driver": str(options.driver),
        "seconds": round(active.work_seconds, 3),
        "ended": datetime.now().astimezone().isoformat(timespec="seconds"),
    }
