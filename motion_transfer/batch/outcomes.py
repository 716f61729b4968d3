"""What follows from a task's result, or from its failure: the second half of the scheduler."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from motion_transfer.batch import events, tasks
from motion_transfer.batch.active import ActiveJob, Shared
from motion_transfer.batch.signature import sign
from motion_transfer.batch.state import BatchState
from motion_transfer.batch.workers import Workers
from motion_transfer.errors import InputError, MotionTransferError, OutputError
from motion_transfer.media.publish import explain_disk_errors


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


class Outcomes:
    """Takes in results; keeps jobs, what they share, and how they ended.

    Attributes:
        tally: of jobs that ended.
        feature_maps: sources whose appearance was computed.
    """

    def __init__(
        self,
        workers: Workers,
        state: BatchState,
        *,
        retries: int,
        keep_going: bool,
        listener: events.BatchListener,
    ) -> None:
        self._workers = workers
        self._state = state
        self._retries = retries
        self._keep_going = keep_going
        self._listener = listener
        self._shared: dict[str, Shared] = {}
        self._active: list[ActiveJob] = []
        self._running: dict[Future[Any], tuple[int, Task]] = {}
        self._last: dict[int, tuple[str, int]] = {}
        self._halted = False
        self.tally = Tally()
        self.feature_maps = 0

    def halt(self) -> bool:
        """Begin nothing new; what runs is finished. Returns: False if it was so already."""
        if self._halted:
            return False
        self._halted = True
        self._listener(events.BatchStopping(len(self._running)))
        return True

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
                with explain_disk_errors(active.job.options.output):
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
                "note": outline.note or None,
                "poster": posters,
                "signature": sign(options, files),
            }
        )
        active.work.clear()
        self.tally.done += 1
        self._end(active)
        if outline.note:
            self._listener(events.JobNotice(active.name, outline.note))
        self._listener(events.JobDone(active.name, options.output, outline.frame_count, seconds))

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
        with suppress(OutputError):  # on a full disk; what is not noted is tried again all the same
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
