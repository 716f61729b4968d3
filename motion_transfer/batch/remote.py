"""Batches whose inputs or outputs are URLs: fetched before the jobs begin, sent as they finish."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Self

from motion_transfer.batch.events import BatchEvent, BatchListener, JobDone, JobFailed
from motion_transfer.batch.job import Job
from motion_transfer.errors import InputError, MotionTransferError
from motion_transfer.media.remote import (
    exists,
    fetch,
    name_of,
    same_size,
    send,
    shown_url,
    url_beside,
)
from motion_transfer.media.work import key_of

AT_ONCE = 8
"""How many inputs are fetched at a time: most of the time goes in waiting for the other side."""


@dataclass
class RemoteInputs:
    """The inputs of a manifest that are URLs, and where each lies while the batch runs.

    Attributes:
        folder: Holds them; a URL has the same place in each run, so that finished jobs are known.
    """

    folder: Path
    _urls: dict[Path, str] = field(default_factory=dict)

    def place(self, url: str) -> Path:
        """Say where a URL is fetched to. Raises: InputError if it names no file."""
        path = self.folder / key_of({"url": url})[:16] / name_of(url)
        self._urls[path] = url
        return path

    def url_of(self, path: Path) -> str | None:
        """Name the URL that lies at a path; None for files of this machine."""
        return self._urls.get(path)

    def check(self, path: Path, what: str) -> None:
        """Refuse a URL where nothing is. Raises: InputError, FetchError."""
        if not exists(self._urls[path]):
            raise InputError(f"{what} {shown_url(self._urls[path])} does not exist")

    @contextmanager
    def fetched(self, jobs: Sequence[Job]) -> Iterator[dict[int, str]]:
        """Fetch what jobs need; it goes when the block ends, however that is.

        Returns: Why jobs cannot be done whose inputs cannot be had, by their index.
        """
        wanted = {job.index: self._wanted(job) for job in jobs}
        paths = sorted({path for found in wanted.values() for path in found})
        try:
            problems = self._fetch_all(paths)
            refused = {
                index: next(filter(None, map(problems.get, found)), None)
                for index, found in wanted.items()
            }
            yield {index: reason for index, reason in refused.items() if reason}
        finally:
            if paths:
                shutil.rmtree(self.folder, ignore_errors=True)

    def _wanted(self, job: Job) -> list[Path]:
        return [path for path in _paths_in(job.options) if path in self._urls]

    def _fetch_all(self, paths: Sequence[Path]) -> dict[Path, str | None]:
        pool = ThreadPoolExecutor(AT_ONCE)
        try:
            return dict(zip(paths, pool.map(self._fetch, paths), strict=True))
        finally:
            pool.shutdown(cancel_futures=True)  # after a Ctrl-C, only what is under way is left

    def _fetch(self, path: Path) -> str | None:
        """Fetch one, with the IUV beside it. Returns: Why that cannot be done."""
        from motion_transfer.render.remote import beside

        url = self._urls[path]
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            fetch(url, path, "input")
            for name in beside(url) if "?" not in url else ():
                if exists(other := url_beside(url, name)):
                    fetch(other, path.with_name(name), "input")
        except (MotionTransferError, OSError) as error:
            return str(error)
        return None


class Deliveries:
    """A listener that sends each finished output, and says that a job is done when it is there.

    Attributes:
        failed_count: How many could not be sent. They are kept, and sent by the next run.
    """

    def __init__(self, root: Path, url: str, jobs: Sequence[Job], listener: BatchListener) -> None:
        """Take the local root of the outputs, and the URL that it stands for."""
        self.failed_count = 0
        self._root = root
        self._url = url.rstrip("/")
        self._jobs = {str(job.options.output): job for job in jobs}
        self._listener = listener
        self._speaking = threading.Lock()
        self._pool = ThreadPoolExecutor(1)  # jobs finish one by one

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_error: object) -> None:
        """Wait for what is on its way; after an error, begin nothing more."""
        self._pool.shutdown(cancel_futures=kind is not None)

    def __call__(self, event: BatchEvent) -> None:
        if isinstance(event, JobDone):
            self._pool.submit(self._deliver, event)
        else:
            self._tell(event)

    def finish(self, done: Sequence[Job]) -> None:
        """Send what an earlier run made and could not send."""
        for job in done:
            try:
                for path in _outputs_of(job):
                    if path.exists() and not same_size(path, self._url_of(path)):
                        send(path, self._url_of(path))
            except MotionTransferError as error:
                self._fail(job.name, error)

    def send_report(self, folder: Path) -> None:
        """Send the page, its facts and its pictures. Raises: OutputError, FetchError."""
        for each in (folder, folder / "pictures"):
            if each.exists():
                send(each, self._url_of(each))

    def _deliver(self, event: JobDone) -> None:
        job = self._jobs[str(event.output)]
        try:
            for path in _outputs_of(job):
                send(path, self._url_of(path))
        except MotionTransferError as error:
            self._fail(event.name, error)
        else:
            self._tell(replace(event, output=self._url_of(job.options.output)))

    def _fail(self, name: str, error: MotionTransferError) -> None:
        self.failed_count += 1
        self._tell(JobFailed(name, f"{error}; the next run sends it"))

    def _url_of(self, path: Path) -> str:
        return f"{self._url}/{path.relative_to(self._root).as_posix()}"

    def _tell(self, event: BatchEvent) -> None:
        with self._speaking:
            self._listener(event)


def _outputs_of(job: Job) -> list[Path]:
    return [path for path in (job.options.output, job.options.sheet) if path is not None]


def _paths_in(value: Any) -> Iterator[Path]:
    """List the paths in options, in whatever they hold."""
    if isinstance(value, Path):
        yield value
    elif isinstance(value, tuple):
        for each in value:
            yield from _paths_in(each)
    elif is_dataclass(value):
        for entry in fields(value):
            yield from _paths_in(getattr(value, entry.name))
    elif isinstance(value, str) and "/" in value:  # a background is a text
        yield Path(value)
