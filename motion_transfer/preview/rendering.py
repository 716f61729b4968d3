"""The real run, beside the preview."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from motion_transfer.errors import MotionTransferError
from motion_transfer.events import Event, Finished, FramesDone, Notice, Stage
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.run import run


class _StopRunError(Exception):
    """Somebody does not want the run any more."""


@dataclass(frozen=True)
class RunProgress:
    """How a run stands.

    Attributes:
        status: `idle`, `running`, `done`, `failed` or `stopped`.
        stage: The name of the `Stage` that is under way.
        message: Why it failed, or what it had to say last.
        seconds: How long the finished run took.
    """

    status: str = "idle"
    stage: str = ""
    done: int = 0
    total: int = 0
    message: str = ""
    seconds: float | None = None


class Rendering:
    """One run at a time, in a thread; a stopped one goes on where it was when it is begun again."""

    def __init__(self, changed: Callable[[], object]) -> None:
        """Begin nothing yet; `changed` is called, by any thread, whenever there is progress."""
        self.progress = RunProgress()
        self.options: RenderOptions | None = None
        self._changed = changed
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def begin(self, options: RenderOptions) -> bool:
        """Start a run. Returns: False while another one is under way."""
        with self._lock:
            if self.progress.status == "running":
                return False
            self.progress, self.options = RunProgress("running"), options
            self._stop.clear()
            self._thread = threading.Thread(target=self._run, args=(options,), name="run")
            self._thread.start()
        self._changed()
        return True

    def stop(self) -> None:
        """Ask the run to stop; it does so within a batch of frames."""
        self._stop.set()

    def close(self) -> None:
        """Stop the run, and wait until it has."""
        self.stop()
        if self._thread is not None:
            self._thread.join()

    def _run(self, options: RenderOptions) -> None:
        try:
            run(options, self._hear)
        except _StopRunError:
            self._set(status="stopped")
        except Exception as error:  # the page has to say so, whatever it was
            self._set(status="failed", message=explain(error))

    def _hear(self, event: Event) -> None:
        if self._stop.is_set() and not isinstance(event, Finished):
            raise _StopRunError  # the way out of a run that keeps what it has finished
        match event:
            case Stage():
                self._set(stage=event.name, done=0, total=event.frame_count)
            case FramesDone():
                self._set(added=event.frame_count)
            case Notice():
                self._set(message=event.message)
            case Finished():
                self._set(status="done", seconds=round(event.wall_seconds, 1))

    def _set(self, *, added: int = 0, **facts: Any) -> None:
        with self._lock:
            facts.setdefault("done", self.progress.done + added)
            self.progress = replace(self.progress, **facts)
        self._changed()


def explain(error: Exception) -> str:
    """Put an error into words, its type included if it is none of ours."""
    known = isinstance(error, MotionTransferError)
    return str(error) if known else f"{type(error).__name__}: {error}"
