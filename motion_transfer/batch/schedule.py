"""The scheduler: which task runs next in which worker, and what follows from its result.

It holds names, not pixels: whatever is large goes from worker to worker as blobs. So its memory
grows with neither frames nor running jobs, of which there are only a few at a time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from pathlib import Path

from motion_transfer.batch import events, tasks
from motion_transfer.batch.active import ActiveJob, Shared, look_name, scan_name
from motion_transfer.batch.expand import Job
from motion_transfer.batch.outcomes import Outcomes, Tally, Task
from motion_transfer.batch.signals import Signals
from motion_transfer.batch.signature import is_current, is_ours
from motion_transfer.batch.state import BatchState
from motion_transfer.batch.workers import Workers
from motion_transfer.errors import MotionTransferError
from motion_transfer.media.publish import check_destination
from motion_transfer.media.work import WorkFolder, was_published

POLL_SECONDS = 0.5  # how soon a signal is heeded
SPARE_JOBS = 2  # planned ahead, beyond one for each worker


class Scheduler(Outcomes):
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
        signals: Signals,
    ) -> None:
        super().__init__(workers, state, retries=retries, keep_going=keep_going, listener=listener)
        self._restart = restart
        self._signals = signals
        self._statuses: dict[Path, str] = {}
        self._waiting = self._order(jobs)

    def run(self) -> Tally:
        """Work until nothing is left to do, then end the workers.

        The first Ctrl-C lets running chunks finish; one while they do stops now, as SIGTERM does.
        However it ends, every finished chunk is kept.
        """
        interrupted = True
        try:
            while True:
                self._signals.heed(self.halt)
                if not self._halted:
                    self._fill()
                if not self._running:
                    break
                done, _ = wait(self._running, timeout=POLL_SECONDS, return_when=FIRST_COMPLETED)
                for future in done:
                    self._receive(future)
            interrupted = False
        finally:
            self._workers.stop(now=interrupted)  # before the folders they write in are tidied
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
            for shared, kind, function, more in (
                (active.scan, "scan", tasks.scan, (self._state.estimates,)),
                (active.look, "look", tasks.look, ()),
            ):
                if shared.state == "missing":
                    shared.state = "pending"
                    return Task(kind, function, (options, *more), active, shared)
            if active.scan.state == active.look.state == "ready":
                active.stage = "preparing"
                blobs = (active.scan.blobs["scan"], active.look.blobs["source"])
                arguments = (options, *blobs, active.look.files)
                return Task("prepare", tasks.prepare, arguments, active)
            return None
        if active.stage == "rendering" and active.todo:
            return self._chunk_task(active, place)
        if active.stage == "rendering" and not active.left and not active.running:
            active.stage = "assembling"
            stem = self._state.picture_stem(options.output)
            arguments = (options, active.prepared, active.work.path, stem)
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
        wanted = active.outline.chunks_at_once if active.outline else 1
        count = min(len(active.todo), wanted)
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
        if not self._restart and is_current(options, signature, self._statuses):
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
