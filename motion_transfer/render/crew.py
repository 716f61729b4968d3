"""Processes beside this one's threads, which share one lock: the more of them, the more they wait.

A thread hands on what it would do as soon as a process is free, and does it itself until then: for
processes that begin, nobody waits, and where none can begin, threads do it all.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Self, TypeVar

from motion_transfer.errors import RenderError
from motion_transfer.render.workers import Fetch, LocalWorkers

LEAST_SHARED = 3000
"""Frames times the other processes, from which they may be worth their 0.6 s of one core. Of two,
neither kind was seen to be faster; the more threads share a lock, the longer each waits for it."""

LOST = "a worker process was killed, perhaps for want of memory; try fewer --workers"

Result = TypeVar("Result")


class Crew:
    """A context manager, in which processes are begun and, however it ends, ended.

    Args:
        scratch: A folder to make for what they are handed; None: there will be no processes.
    """

    def __init__(self, scratch: Path | None = None) -> None:
        self._scratch = scratch
        self._workers: LocalWorkers | None = None
        self._free: SimpleQueue[int] = SimpleQueue()
        self._starter = threading.Thread(target=self._start, name="crew", daemon=True)
        self._stopping = threading.Event()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        if self._workers is not None:
            self._starter.join()  # who has just begun would be overlooked
            self._workers.stop(now=True)

    def begin(self, count: int, frame_count: int) -> None:
        """Begin processes for a run of so many frames, if they are worth it; do not wait."""
        if self._scratch is None or frame_count * (count - 1) < LEAST_SHARED:
            return
        with suppress(OSError):  # where nothing can be written, the run itself says so
            self._workers = LocalWorkers(count, self._scratch, share_gpus=False)
            self._starter.start()

    def offer(self, task: Callable[..., Result], *arguments: Any) -> Future[Result] | None:
        """Have a task done, see `result_of`; None if no process is free."""
        if self._workers is None:
            return None
        try:
            place = self._free.get_nowait()
        except Empty:
            return None
        future = self._workers.submit(place, task, *arguments)
        future.add_done_callback(lambda _done: self._free.put(place))
        return future

    def share(self, name: str, make: Callable[[], bytes]) -> Fetch | None:
        """Make a blob available to all; None if there is nobody. Raises: OSError."""
        return self._workers and self._workers.share(name, make())

    def _start(self) -> None:
        assert self._workers is not None
        for place in range(self._workers.count):
            if self._stopping.is_set():
                return
            try:
                begun = self._workers.submit(place, int)
            except Exception:  # whatever keeps a process from beginning: it is done without
                return
            begun.add_done_callback(
                lambda done, place=place: None if done.exception() else self._free.put(place)
            )


def result_of(future: Future[Result]) -> Result:
    """Wait for what a process does. Raises: whatever that raised; RenderError if it died."""
    try:
        return future.result()
    except BrokenProcessPool:
        raise RenderError(LOST) from None
