"""Workers on a Ray cluster: an actor each, which keeps the network warm.

Blobs lie in the object store, owned by this process, so that they outlive any other node. Drivers
and outputs are on a path that every node sees under the same name.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from motion_transfer.cores import take_share
from motion_transfer.errors import InputError
from motion_transfer.extras import require_extra
from motion_transfer.render.workers import Fetch

# read when ray is imported: an actor without a GPU of its own keeps CUDA_VISIBLE_DEVICES as it is
os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
# Ray tells of a node that died on standard output, where results and JSON lines are: what matches
# this, as all does, is not shown
os.environ.setdefault("RAY_DEDUP_LOGS_SKIP_REGEX", "^")


class RayWorkers:
    """Actors wherever the cluster has room; one that dies with its node starts elsewhere."""

    def __init__(self, count: int | None, address: str | None) -> None:
        """Join a cluster, or start one on this machine if `address` is None.

        Args:
            count: How many actors; None: one for each GPU of the cluster, or for each core.
        Raises: InputError if Ray is not installed or there is no such cluster.
        """
        require_extra("cluster")
        import ray
        from ray.exceptions import ObjectLostError, RayActorError, WorkerCrashedError

        self._ray = ray
        self._joined_here = not ray.is_initialized()
        if self._joined_here:
            try:
                # actors find the modules that are found here
                path = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
                ray.init(
                    address=address,
                    runtime_env={"env_vars": path},
                    configure_logging=False,
                    log_to_driver=False,
                )
            except (ConnectionError, ValueError) as error:
                raise InputError(
                    f"no Ray cluster at {address}: {error}; start one with `ray start --head`"
                ) from error
        lost: list[type[BaseException]] = [RayActorError, WorkerCrashedError, ObjectLostError]
        self.lost_error = tuple(lost)
        resources = ray.cluster_resources()
        self._gpus = int(resources.get("GPU", 0))
        self.count = count or self._gpus or max(1, int(resources.get("CPU", 1)))
        self._actors: list[Any] = [None] * self.count
        self._blobs: dict[str, Any] = {}

    def submit(self, place: int, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        if self._actors[place] is None:
            needs = {"num_gpus": 1} if self._gpus else {"num_cpus": 1}
            worker = self._ray.remote(Worker).options(**needs, max_restarts=0)
            self._actors[place] = worker.remote()
        future: Future[Any] = Future()
        inner = self._actors[place].call.remote(task, *arguments).future()
        inner.add_done_callback(partial(self._deliver, place, future))
        return future

    def share(self, name: str, blob: bytes) -> Fetch:
        reference = self._blobs[name] = self._ray.put(blob)
        return partial(_fetch, [reference])

    def forget(self, name: str) -> None:
        self._blobs.pop(name, None)

    def stop(self, *, now: bool) -> None:  # noqa: ARG002 (the protocol's)
        for actor in filter(None, self._actors):
            self._ray.kill(actor)
        self._blobs.clear()
        if self._joined_here:
            self._ray.shutdown()

    def _deliver(self, place: int, future: Future[Any], inner: Future[Any]) -> None:
        """Pass a result on; a task's error goes as it was raised, not as Ray wraps it."""
        error = inner.exception()
        if error is None:
            future.set_result(inner.result())
            return
        if isinstance(error, self.lost_error):
            self._actors[place] = None  # the next task starts a fresh one, where there is room
        cause = getattr(error, "cause", None)
        future.set_exception(cause if isinstance(cause, Exception) else error)


class Worker:
    """Runs tasks in an actor."""

    def __init__(self) -> None:
        os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as every command has it
        take_share(1)

    def call(self, task: Callable[..., Any], *arguments: Any) -> Any:
        """Run a task here; it finds what this process keeps warm."""
        return task(*arguments)


def _fetch(references: list[Any]) -> bytes:
    """Fetch a blob; in a list, since Ray would fetch a bare argument before it is wanted."""
    import ray

    return ray.get(references[0])
