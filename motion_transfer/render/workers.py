"""Workers on this machine: a process each, so that one that dies takes nobody with it."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing.context import BaseContext
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from motion_transfer.cores import core_count, take_share
from motion_transfer.devices import count_cuda
from motion_transfer.processes import begin_child, deaf

PRELOADED = [
    "motion_transfer.render.composition",
    "motion_transfer.render.engine",
    "motion_transfer.media.output.video",
]
"""What workers need is imported once, in the process that they are forked from: each then begins
within 10 ms, not half a second. None of it has threads yet that a fork would lose."""

KEPT_OBJECTS = 16  # of a few jobs at once: run, renderer and reader of each

Fetch = Callable[[], bytes]
"""Gives a blob, wherever it lies; what `Workers.share` returns."""

BEGINNING = threading.Lock()  # one worker at a time: what is set for it is the whole process's


class Workers(Protocol):
    """A fixed number of places where tasks run, one at a time in each.

    Attributes:
        count: How many places there are.
        lost_error: What a future raises whose worker died.
    """

    count: int
    lost_error: tuple[type[BaseException], ...]

    def submit(self, place: int, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run a task in a place, in a fresh worker if the last one there died."""
        ...

    def share(self, name: str, blob: bytes) -> Fetch:
        """Make a blob available to every worker; the result can be an argument of a task."""
        ...

    def forget(self, name: str) -> None:
        """Drop a blob that nobody needs any more, if there is one of that name."""
        ...

    def stop(self, *, now: bool) -> None:
        """End the workers; if `now`, without waiting for what they do."""
        ...


class LocalWorkers:
    """Workers that are processes of this machine, and hand each other blobs as files."""

    lost_error: tuple[type[BaseException], ...] = (BrokenProcessPool,)

    def __init__(self, count: int, scratch: Path, *, share_gpus: bool = True) -> None:
        """Start nobody yet; empty `scratch`, the folder for blobs, which `stop` removes.

        Args:
            share_gpus: Whether workers take GPUs in turn, for which they import torch.
        """
        self.count = count
        self._share_gpus = share_gpus
        self._scratch = scratch
        shutil.rmtree(scratch, ignore_errors=True)
        scratch.mkdir(parents=True, mode=0o700)
        self._pools: list[ProcessPoolExecutor | None] = [None] * count

    def submit(self, place: int, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        pool = self._pools[place]
        if pool is not None:
            try:
                return pool.submit(task, *arguments)
            except BrokenProcessPool:
                pool.shutdown(wait=False)
        pool = self._pools[place] = ProcessPoolExecutor(
            1,
            mp_context=_how_to_begin(),
            initializer=begin_worker,
            initargs=(place, self.count, sys.path, self._share_gpus),
        )
        with BEGINNING, deaf(signal.SIGINT), _without_main():
            future = pool.submit(task, *arguments)
        # the worker has its own; with this one open, half a result of a worker that was killed
        # would be waited for without end
        pool._result_queue._writer.close()  # type: ignore[attr-defined]
        return future

    def share(self, name: str, blob: bytes) -> Fetch:
        path = self._scratch / name
        path.write_bytes(blob)
        return partial(Path.read_bytes, path)

    def forget(self, name: str) -> None:
        (self._scratch / name).unlink(missing_ok=True)

    def stop(self, *, now: bool) -> None:
        for pool in filter(None, self._pools):
            if now:
                for process in list((pool._processes or {}).values()):
                    process.kill()
            pool.shutdown(wait=True, cancel_futures=True)
        shutil.rmtree(self._scratch, ignore_errors=True)


def begin_worker(place: int, count: int, path: list[str], share_gpus: bool) -> None:
    """Settle into a worker process: its share of the cores, its GPU, an end with its parent."""
    sys.path[:] = path
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # whatever the command's own handler does
    begin_child()
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    take_share(max(1, core_count() // count))
    if share_gpus and count_cuda():
        import torch

        torch.cuda.set_device(place % count_cuda())


class Warm:
    """What a worker process keeps between tasks; the oldest goes first."""

    def __init__(self) -> None:
        self._objects: OrderedDict[str, Any] = OrderedDict()
        self.frames: tuple[Any, list[Any]] = (None, [])

    def get(self, name: str, make: Callable[[], Any]) -> Any:
        """Give the object of a name; make it if it is not there."""
        if name not in self._objects:
            self._objects[name] = make()
            while len(self._objects) > KEPT_OBJECTS:
                self._objects.popitem(last=False)
        self._objects.move_to_end(name)
        return self._objects[name]


WARM = Warm()
"""Kept by this worker process."""


def _how_to_begin() -> BaseContext:
    """Choose how workers begin; Apple's frameworks do not survive a fork, and Windows has none."""
    if sys.platform == "darwin" or "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    return context


@contextmanager
def _without_main() -> Iterator[None]:
    """Keep processes that begin inside from running the caller's script, as they would by default.

    Tasks are functions of this package; and a script that calls `render_video` without asking for
    its own `__name__` would call it again in every worker.
    """
    before = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = before
