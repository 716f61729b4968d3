"""The real runs, one after the other beside the preview, each kept as a manifest until it is gone.

A run that was stopped, by hand or because the program ended, goes on where it was: its manifest
says what it is, and the journal beside its output what is finished.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from motion_transfer.batch.run import read_batch
from motion_transfer.errors import InputError, MotionTransferError
from motion_transfer.events import Event, Finished, FramesDone, Notice, Stage
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.media.work import WorkFolder, work_path
from motion_transfer.preview.export import manifest_text
from motion_transfer.preview.progress import Progress, explain
from motion_transfer.render.driver import are_pictures
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.run import run

Status = Literal["waiting", "running", "done", "failed", "stopped"]


class _StopRunError(Exception):
    """Somebody does not want the run any more, or not now."""


@dataclass(frozen=True)
class Render:
    """A run and how it stands.

    Attributes:
        number: By which the page knows it; its manifest is called so.
        message: Why it failed, or what it had to say last.
        seconds: How long the finished run took.
    """

    number: int
    options: RenderOptions
    status: Status = "waiting"
    progress: Progress | None = None
    message: str = ""
    seconds: float | None = None

    def told(self) -> dict[str, Any]:
        """Tell it in words and numbers, for JSON."""
        output, done = self.options.output, self.status == "done"
        return {
            "number": self.number,
            "name": output.name,
            "output": str(output),
            "status": self.status,
            "message": self.message,
            "seconds": self.seconds,
            "bytes": _size(output) if done else None,
            "gone": done and not output.exists(),
            **(self.progress or Progress("", 0, 0)).told(),
        }


class RenderQueue:
    """Runs in the order in which they were asked for, by one thread."""

    def __init__(self, folder: Path, estimates: Path, changed: Callable[[], object]) -> None:
        """Find what earlier previews left; nothing of it goes on by itself.

        Args:
            folder: Of the manifests; it is made with the first of them.
            estimates: Where the IUV of drivers may lie that are raw pictures.
            changed: Called whenever there is progress, by any thread, which may hold the queue's
                lock: it must not wait for another that somebody holds who asks this queue.
        """
        self._folder, self._estimates, self._changed = folder, estimates, changed
        self._lock = threading.Condition()
        self._stopping: set[int] = set()
        self._closed = False
        self._renders = {each.number: each for each in _restore(folder)}
        self._thread = threading.Thread(target=self._work, name="renders")
        self._thread.start()

    @property
    def all(self) -> list[Render]:
        """Every run, in the order of their numbers."""
        with self._lock:
            return list(self._renders.values())

    def get(self, number: int) -> Render:
        """Give one. Raises: InputError if there is none of that number."""
        with self._lock:
            if number not in self._renders:
                raise InputError(f"there is no render {number}")
            return self._renders[number]

    def add(self, options: RenderOptions) -> Render:
        """Queue a run. Raises: InputError if its output is on its way already; OutputError."""
        output = options.output.absolute()
        with self._lock:
            for other in self._renders.values():
                unfinished = other.status in ("waiting", "running")
                if unfinished and other.options.output.absolute() == output:
                    raise InputError(f"{options.output} is being rendered already; stop that first")
            number = max(self._renders, default=0) + 1
            with explain_disk_errors(self._folder):
                self._folder.mkdir(parents=True, exist_ok=True)
                while self._manifest(number).exists():  # of another preview beside this one
                    number += 1
                text = manifest_text(options, self._manifest(number))
                self._manifest(number).write_text(text, encoding="utf-8")
            # a run of this name that was finished or given up is replaced by it
            for other in [each for each in self._renders.values() if _same(each, output)]:
                self._forget(other.number)
            self._renders[number] = render = Render(number, options)
            self._lock.notify()
        self._changed()
        return render

    def stop(self, number: int) -> None:
        """Stop a run; one that draws does so within a batch of frames."""
        with self._lock:
            match self.get(number).status:
                case "waiting":
                    self._set(number, status="stopped")
                case "running":
                    self._stopping.add(number)

    def resume(self, number: int) -> None:
        """Let a stopped or failed run wait for its turn; it goes on where it was."""
        with self._lock:
            if self.get(number).status in ("stopped", "failed"):
                self._set(number, status="waiting", message="")
                self._lock.notify()

    def remove(self, number: int) -> None:
        """Forget a run that is not under way; a finished output stays where it is.

        Raises: InputError if it is being drawn.
        """
        with self._lock:
            if self.get(number).status == "running":
                raise InputError("it is being rendered; stop it first")
            self._forget(number)
        self._changed()

    def close(self) -> None:
        """Stop what is being drawn, and wait until it has stopped."""
        with self._lock:
            self._closed = True
            self._lock.notify()
        self._thread.join()

    def _forget(self, number: int) -> None:
        self._manifest(number).unlink(missing_ok=True)
        del self._renders[number]

    def _manifest(self, number: int) -> Path:
        return self._folder / f"{number:04d}.yaml"

    # the thread that runs

    def _work(self) -> None:
        while (render := self._next()) is not None:
            try:
                self._lend_estimate(render.options)
                run(render.options, lambda event, number=render.number: self._hear(number, event))
            except _StopRunError:
                self._set(render.number, status="stopped")
            except Exception as error:  # the page has to say so, whatever it was
                self._set(render.number, status="failed", message=explain(error))
            self._stopping.discard(render.number)

    def _next(self) -> Render | None:
        with self._lock:
            while not self._closed:
                waiting = [each for each in self._renders.values() if each.status == "waiting"]
                if waiting:
                    self._set(waiting[0].number, status="running", progress=None)
                    return waiting[0]
                self._lock.wait()
        return None

    def _lend_estimate(self, options: RenderOptions) -> None:
        """Give a run the IUV that was found for the page: to find it takes minutes."""
        if not self._estimates.is_dir() or not are_pictures(options):
            return
        from motion_transfer.render.picture_driver import take_over

        work = work_path(options.output)
        with WorkFolder(options.output) as folder:
            if (pictures := take_over(options, self._estimates, work)) is not None:
                folder.note(pictures.iuv.name, pictures.digest, pictures.key)

    def _hear(self, number: int, event: Event) -> None:
        if (self._closed or number in self._stopping) and not isinstance(event, Finished):
            raise _StopRunError  # the way out of a run that keeps what it has finished
        progress = self.get(number).progress
        match event:
            case Stage():
                self._set(number, progress=Progress(event.name, 0, event.frame_count))
            case FramesDone() if progress is not None:
                self._set(number, progress=progress.after(event.frame_count))
            case Notice():
                self._set(number, message=event.message)
            case Finished():
                self._set(number, status="done", seconds=round(event.wall_seconds, 1))

    def _set(self, number: int, **facts: Any) -> None:
        with self._lock:
            self._renders[number] = replace(self._renders[number], **facts)
        self._changed()


def _restore(folder: Path) -> list[Render]:
    """Read the manifests of earlier previews; one that is none is left alone, and not shown."""
    found = []
    for path in sorted(folder.glob("[0-9]*.yaml")):
        try:
            number, (job, *_) = int(path.stem), read_batch(path).jobs
        except (MotionTransferError, ValueError):
            continue
        output = job.options.output
        done = output.exists() and not work_path(output).exists()
        found.append(Render(number, job.options, "done" if done else "stopped"))
    return found


def _same(render: Render, output: Path) -> bool:
    return render.options.output.absolute() == output


def _size(output: Path) -> int | None:
    try:
        return output.stat().st_size if output.is_file() else None
    except OSError:
        return None
