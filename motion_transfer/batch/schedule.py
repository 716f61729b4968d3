"""The scheduler: which task runs next in which worker, and what follows from its result.

It holds names, not pixels: whatever is large goes from worker to worker as blobs. So its memory
grows with neither frames nor running jobs, of which there are only a few at a time.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from typing import Any

from motion_transfer.batch import events, tasks
from motion_transfer.batch.active import ActiveJob, Shared, look_name, scan_name
from motion_transfer.batch.expand import Job
from motion_transfer.batch.signature import is_current, is_ours, sign
from motion_transfer.batch.state import BatchState
from motion_transfer.batch.workers import Workers
from motion_transfer.errors import InputError, MotionTransferError, OutputError
from motion_transfer.media.publish import check_destination
from motion_transfer.media.work import WorkFolder, was_published

POLL_SECONDS = 0.5  # how soon a signal is heeded
TURN_TAKING_CHUNKS = 2  # one task's, where the network is the bottleneck: see render.engine
SPARE_JOBS = 2  # planned ahead, beyond one for each worker


@dataclass
class Task:
    """A call in a worker, and what to do with its result."""

    kind: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    owner: ActiveJob
    shared: Shared | None = None
    chunks: list[tasks.ChunkOutline] = field(default_factory=list)


@dataclass
class Tally:
    """How the jobs of a run ended."""

    done: int = 0
    current: int = 0
    failed: int = 0
    left: int = 0


class Scheduler:
    """Runs jobs on workers until none is left, or until it is told to stop."""

    def __init__(
        self,
        jobs: Sequence[Job],
        workers: Workers,
        state: BatchState,
        *,
        retries: int,
        keep_going: bool,
        restart: bool,
        listener: events.BatchListener,
    ) -> None:
        self._workers = workers
        self._state = state
        self._retries = retries
        self._keep_going = keep_going
        self._restart = restart
        self._listener = listener
        self._shared: dict[str, Shared] = {}
        self._waiting = self._order(jobs)
        self._active: list[ActiveJob] = []
        self._running: dict[Future[Any], tuple[int, Task]] = {}
        self._last: dict[int, tuple[str, int]] = {}
        self._halted = False
        self.tally = Tally()
        self.feature_maps = 0

    def halt(self) -> None:
        """Begin nothing new; what runs is finished."""
        if not self._halted:
            self._halted = True
            self._listener(events.BatchStopping(len(self._running)))

    def run(self) -> Tally:
        """Work until nothing is left to do. However it ends, every finished chunk is kept."""
        try:
            while True:
                if not self._halted:
                    self._fill()
                if not self._running:
                    break
                done, _ = wait(self._running, timeout=POLL_SECONDS, return_when=FIRST_COMPLETED)
                for future in done:
                    self._receive(future)
        finally:
            self.tally.left = len(self._waiting)
            for active in list(self._active):
                self.tally.left += not active.error
                self._end(active)
        return self.tally

    def _order(self, jobs: Sequence[Job]) -> list[Job]:
        """Last job first: by priority, jobs of one driver together, else as in the manifest."""
        first: dict[tuple[int, str], int] = {}
        users: Counter[str] = Counter()
        names: dict[int, str] = {}
        for job in jobs:
            names[job.index] = scan_name(job.options)
            first.setdefault((job.priority, names[job.index]), job.index)
            users.update((names[job.index], look_name(job.options)))
        self._shared = {name: Shared(count) for name, count in users.items()}
        return sorted(
            jobs,
            key=lambda job: (-job.priority, first[job.priority, names[job.index]], job.index),
            reverse=True,
        )

    # ---- what runs next

    def _fill(self) -> None:
        busy = {place for place, _ in self._running.values()}
        for place in range(self._workers.count):
            if place in busy:
                continue
            task = self._next(place)
            if task is None:
                return
            task.owner.running += 1
            future = self._workers.submit(place, task.function, *task.arguments)
            self._running[future] = place, task

    def _next(self, place: int) -> Task | None:
        while not self._halted:
            for active in self._by_preference(place):
                task = self._task_of(active, place)
                if task is not None:
                    return task
            if not self._waiting or len(self._active) >= self._workers.count + SPARE_JOBS:
                return None
            self._begin(self._waiting.pop())
        return None

    def _by_preference(self, place: int) -> list[ActiveJob]:
        """The highest priority first; there, a chunk whose frames this worker has just decoded."""
        last = self._last.get(place)

        def distance(active: ActiveJob) -> tuple[int, bool]:
            same = any((active.scan_name, chunk.start) == last for chunk in active.todo)
            return -active.job.priority, not same

        return sorted(self._active, key=distance)

    def _task_of(self, active: ActiveJob, place: int) -> Task | None:
        options = active.job.options
        if active.error:
            return None
        if active.stage == "begun":
            for shared, kind, function in (
                (active.scan, "scan", tasks.scan),
                (active.look, "look", tasks.look),
            ):
                if shared.state == "missing":
                    shared.state = "pending"
                    return Task(kind, function, (options,), active, shared)
            if active.scan.state == active.look.state == "ready":
                active.stage = "preparing"
                blobs = (active.scan.blobs["scan"], active.look.blobs["source"])
                return Task("prepare", tasks.prepare, (options, *blobs), active)
            return None
        if active.stage == "rendering" and active.todo:
            return self._chunk_task(active, place)
        if active.stage == "rendering" and not active.left and not active.running:
            active.stage = "assembling"
            pictures = self._state.pictures / f"{active.job.index:06d}"
            arguments = (options, active.prepared, active.work.path, pictures)
            return Task("assemble", tasks.assemble, arguments, active)
        return None

    def _chunk_task(self, active: ActiveJob, place: int) -> Task:
        last = self._last.get(place)
        for _ in range(len(active.todo)):
            if (active.scan_name, active.todo[0].start) == last:
                break
            active.todo.rotate(-1)
        else:
            active.todo = type(active.todo)(sorted(active.todo, key=lambda chunk: chunk.index))
        takes_turns = active.outline is not None and active.outline.takes_turns
        count = min(len(active.todo), TURN_TAKING_CHUNKS if takes_turns else 1)
        chunks = [active.todo.popleft() for _ in range(count)]
        self._last[place] = active.scan_name, chunks[-1].start
        places = [(c.index, active.work.temporary(c.piece), c.piece) for c in chunks]
        arguments = (
            *(f"{active.blob_name}", active.prepared),
            *(active.look_name, active.look.blobs["appearance"]),
            *(active.work.path, places, active.job.options.sheet is not None),
        )
        return Task("render", tasks.render, arguments, active, chunks=chunks)

    def _begin(self, job: Job) -> None:
        options = job.options
        record = self._state.records.get(str(options.output), {})
        signature = record.get("signature", {})
        names = scan_name(options), look_name(options)
        if not self._restart and is_current(options, signature):
            self.tally.current += 1
            self._release(names)
            return
        ours = is_ours(options, signature)
        work = WorkFolder(options.output, restart=self._restart)
        active = ActiveJob(
            *(job, work, self._shared[names[0]], self._shared[names[1]], *names, ours)
        )
        try:
            published = not self._restart and was_published(options.output)
            check_destination(options.output, force=options.force or ours or published)
            if options.sheet is not None:
                check_destination(options.sheet, force=options.force or ours or published)
            work.__enter__()
        except (MotionTransferError, OSError) as error:
            self._release(names)
            self._report_failure(active, str(error))
            return
        self._active.append(active)
        for shared in (active.scan, active.look):
            if shared.state == "failed":
                self._fail(active, shared.error)
                break

    # ---- what follows from a result

    def _receive(self, future: Future[Any]) -> None:
        place, task = self._running.pop(future)
        active = task.owner
        active.running -= 1
        try:
            result = future.result()
        except self._workers.lost_error:
            self._last.pop(place, None)
            self._retry(
                task,
                "its worker process was killed, perhaps for want of memory; try fewer --workers",
            )
        except InputError as error:
            self._give_up(task, str(error))
        except Exception as error:  # whatever a worker raises fails its job, never the batch
            self._retry(task, str(error) or type(error).__name__)
        else:
            try:
                getattr(self, f"_{task.kind}_done")(task, result)
            except (MotionTransferError, OSError) as error:
                self._give_up(task, str(error))
        if active.error and not active.running:
            self._end(active)

    def _scan_done(self, task: Task, result: tuple[Any, ...]) -> None:
        blob, files, notices = result
        self._ready(task, files, {"scan": (task.owner.scan_name, blob)})
        for notice in notices:
            self._listener(events.JobNotice(task.owner.name, notice))

    def _look_done(self, task: Task, result: tuple[Any, ...]) -> None:
        source, appearance, files = result
        name = task.owner.look_name
        blobs = {"source": (f"source-{name}", source), "appearance": (name, appearance)}
        self._ready(task, files, blobs)
        self.feature_maps += 1

    def _ready(self, task: Task, files: dict, blobs: dict[str, tuple[str, bytes]]) -> None:
        shared = task.shared
        if shared is None:
            raise RuntimeError(f"{task.kind} is shared by nobody")
        for kind, (name, blob) in blobs.items():
            shared.blobs[kind] = self._workers.share(name, blob)
        shared.files, shared.state = files, "ready"

    def _prepare_done(self, task: Task, result: tuple[bytes, tasks.Outline]) -> None:
        active = task.owner
        blob, outline = result
        active.outline = outline
        if active.work.published(outline.output_key):
            self._succeed(active, None, {})
            return
        options = active.job.options
        if options.output.exists() and not (options.force or active.ours):
            raise OutputError(f"{options.output} exists already; choose another name or set force")
        active.prepared = self._workers.share(active.blob_name, blob)
        active.todo.extend(c for c in outline.chunks if not active.work.has(c.piece, c.key))
        active.left = len(active.todo)
        active.stage = "rendering"
        missing = sum(chunk.stop - chunk.start for chunk in active.todo)
        done = outline.frame_count - missing
        self._listener(events.JobPlanned(active.name, outline.frame_count, done))

    def _render_done(self, task: Task, result: list[tuple[int, str]]) -> None:
        digests = dict(result)
        for chunk in task.chunks:
            task.owner.work.note(chunk.piece, digests[chunk.index], chunk.key)
            task.owner.left -= 1
            self._listener(events.JobFrames(task.owner.name, chunk.stop - chunk.start))

    def _assemble_done(self, task: Task, result: tuple[Any, ...]) -> None:
        finished, posters, files = result
        if task.owner.outline is None:
            raise RuntimeError("assembled before it was planned")
        task.owner.work.publish(finished, task.owner.outline.output_key)
        self._succeed(task.owner, posters, files)

    def _succeed(self, active: ActiveJob, posters: Any, files: dict) -> None:
        outline, options = active.outline, active.job.options
        if outline is None:
            raise RuntimeError("done before it was planned")
        seconds = time.monotonic() - active.began
        files = {**active.scan.files, **active.look.files, **files}
        self._state.record(
            {
                **self._facts(active, "done", seconds),
                "frames": outline.frame_count,
                "duration_seconds": outline.duration_seconds,
                "renderer": outline.renderer,
                "poster": str(posters) if posters else None,
                "signature": sign(options, files),
            }
        )
        active.work.clear()
        self.tally.done += 1
        self._end(active)
        self._listener(
            events.JobDone(active.name, options.output, outline.frame_count, seconds)
        )

    def _retry(self, task: Task, message: str) -> None:
        """Put a failed task back, unless it has failed too often."""
        active = task.owner
        keys = [chunk.index for chunk in task.chunks] or [task.kind]
        active.tries.update(keys)
        if max(active.tries[key] for key in keys) > self._retries:
            if task.chunks:
                frames = f"{task.chunks[0].start}:{task.chunks[-1].stop}"
                message = f"frames {frames} failed {self._retries + 1} times: {message}"
            self._give_up(task, message)
        elif task.chunks:
            active.todo.extendleft(reversed(task.chunks))
        elif task.shared is not None:
            task.shared.state = "missing"
        else:
            active.stage = "begun" if task.kind == "prepare" else "rendering"

    def _give_up(self, task: Task, message: str) -> None:
        """Fail the job; of a shared task, every job that waits for it."""
        owners = [task.owner]
        if task.shared is not None:
            task.shared.state, task.shared.error = "failed", message
            owners = [a for a in self._active if task.shared in (a.scan, a.look)]
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
        seconds = time.monotonic() - active.began
        self._state.record({**self._facts(active, "failed", seconds), "error": message})
        self._listener(events.JobFailed(active.name, message))
        if not self._keep_going:
            self.halt()

    def _facts(self, active: ActiveJob, status: str, seconds: float) -> dict[str, Any]:
        options = active.job.options
        return {
            "output": str(options.output),
            "name": active.name,
            "status": status,
            "source": str(options.source),
            "driver": str(options.driver),
            "seconds": round(seconds, 3),
        }

    def _end(self, active: ActiveJob) -> None:
        if active.stage == "ended":
            return
        active.stage = "ended"
        self._active.remove(active)
        active.work.__exit__(None, None, None)
        self._workers.forget(active.blob_name)
        self._release((active.scan_name, active.look_name))

    def _release(self, names: tuple[str, str]) -> None:
        for name in names:
            shared = self._shared[name]
            shared.users -= 1
            if not shared.users:
                for blob in (name, f"source-{name}"):
                    self._workers.forget(blob)
                shared.blobs.clear()
