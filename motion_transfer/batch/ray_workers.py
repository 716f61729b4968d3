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

from motion_transfer.batch.tasks import Fetch
from motion_transfer.errors import InputError

CLUSTER_EXTRA = "motion-transfer[cluster]"
# set before ray is imported: it reads them then
os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")


class RayWorkers:
    """Actors wherever the cluster has room; one that dies with its node starts elsewhere."""

    def __init__(self, count: int | None, address: str | None) -> None:
        """Join a cluster, or start one on this machine if `address` is None.

        Args:
            count: of actors; None: one for each GPU of the cluster, or for each core.
        Raises: InputError if Ray is not installed or there is no such cluster.
        """
        try:
            import ray
            from ray.exceptions import ObjectLostError, RayActorError, WorkerCrashedError
        except ImportError:
            raise InputError(
                f"the ray engine is not installed; pip install '{CLUSTER_EXTRA}'"
            ) from None
        self._ray = ray
        self._joined_here = not ray.is_initialized()
        if self._joined_here:
            try:
                ray.init(
                    address=address,
                    runtime_env={
                        "env_vars": {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
                    },
                    configure_logging=False,
                    log_to_driver=False,
                )
            except (ConnectionError, ValueError) as error:
                raise InputError(
                    f"no Ray cluster at {address}: {error}; start one with `ray start --head`"
                ) from error
        self.lost_error: tuple[type[BaseException], ...] = (
            RayActorError,
            WorkerCrashedError,
            ObjectLostError,
        )
        resources = ray.cluster_resources()
        self._gpus = int(resources.get("GPU", 0))
        self.count = count or self._gpus or max(1, int(resources.get("CPU", 1)))
        self._actors: list[Any] = [None] * self.count
        self._blobs: dict[str, Any] = {}

    def submit(self, place: int, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        if self._actors[place] is None:
            self._actors[place] = self._start(place)
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

    def _start(self, place: int) -> Any:
        worker = self._ray.remote(Worker)
        options = {"num_gpus": 1} if self._gpus else {"num_cpus": 1}
        return worker.options(**options, max_restarts=0).remote(place)

    def _deliver(self, place: int, future: Future[Any], inner: Future[Any]) -> None:
        """Pass a result on; an error of ours as it was raised, not as Ray wraps it."""
        error = inner.exception()
        if error is None:
            future.set_result(inner.result())
            return
        if isinstance(error, self.lost_error):
            self._actors[place] = None  # the next task starts a fresh one, where there is room
        cause = getattr(error, "cause", None)
        future.set_exception(cause if isinstance(cause, Exception) else error)


class Worker:
    """What runs in an actor."""

    def __init__(self, place: int) -> None:
        import cv2
        import torch

        os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
        self.place = place
        if not torch.cuda.is_available():
            torch.set_num_threads(1)
        cv2.setNumThreads(1)

    def call(self, task: Callable[..., Any], *arguments: Any) -> Any:
        """Run a task here; it finds what this process keeps warm."""
        return task(*arguments)


def _fetch(references: list[Any]) -> bytes:
    """A blob from the object store; the list keeps Ray from fetching it before it is wanted."""
    import ray

    return ray.get(references[0])
