"""Whether files are still what they were when reading them began.

It is told as a version control system's index tells it: size, times and inode that did not change
mean content that did not change. Where they did, the content itself decides, so that a file that
was only touched, or copied over itself, stops nobody.
"""

# to make tens of thousands of `Path` takes longer than to look at the files
# ruff: noqa: PTH116, PTH118, PTH119, PTH122, PTH123, PTH208

from __future__ import annotations

import os
import stat
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple, Self, TypeVar

from xxhash import xxh3_128

from motion_transfer.errors import InputError
from motion_transfer.media.work import READ_BYTES, key_of

TICK_NS = 20_000_000
"""A file that was written so shortly before may be written again without its times telling: the
clock that stamps files goes in steps of 1 to 10 ms."""

GLANCE_SHARE = 0.02
"""The most time that glances take: a folder of 10,000 frames takes 50 ms to look at."""

FRAME_SUFFIXES = {
    *(".png", ".apng", ".bmp", ".tif", ".tiff", ".npy", ".npz"),
    *(".jpg", ".jpeg", ".webp", ".avif", ".heic", ".heif", ".hif"),
}
"""Endings of what folders of frames are made of, in any of the tables of formats, which lie above
this module."""

Item = TypeVar("Item")


class Status(NamedTuple):
    """What tells a file's content from another without reading it.

    `ctime_ns` also gives away who sets a file's other times back; nothing compares it to a clock
    but to find it suspicious.
    """

    size_bytes: int
    mtime_ns: int
    ctime_ns: int
    inode: int


class Known(NamedTuple):
    """A file as it was: its status, None if that may not be trusted, and a digest."""

    status: Status | None
    digest: str


class Inputs:
    """Files and folders as they were before they were read.

    Of a folder only what may be a frame counts, so that an output may lie in there. What cannot be
    read, or is no file, is left to whoever reads it to complain of; one that is not there must not
    appear.
    """

    def __init__(self, paths: Iterable[Path] = ()) -> None:
        """Note status and digest of files; to be called before anything is read from them."""
        self._known = {path: {file: _know(file) for file in _list(path)} for path in paths}
        self._glanced = 0.0, 0.0  # when the last glance ended, and how long it took, seconds

    def __or__(self, other: Self) -> Inputs:
        both = Inputs()
        both._known = self._known | other._known
        return both

    def check(self) -> None:
        """Raise InputError naming a file that is not what it was."""
        for path, known in self._known.items():
            found = _list(path)
            for file in sorted(known.keys() ^ found):
                raise _changed(file, "been removed" if file in known else "been added")
            for file, (status, digest) in known.items():
                now = _status(file)
                if now is None and digest:
                    raise _changed(file, "been removed")
                if now == status and status is not None:
                    continue
                again = _know(file)
                if again.digest != digest:
                    raise _changed(file, "changed")
                known[file] = again

    def glance(self) -> None:
        """As `check`, for calling often: it takes a small share of the time at most."""
        began = time.monotonic()
        ended, took = self._glanced
        if began - ended < took / GLANCE_SHARE:
            return
        self.check()
        self._glanced = time.monotonic(), time.monotonic() - began

    def guard(self, items: Iterable[Item]) -> Iterator[Item]:
        """Pass on what is read from the files, as long as they are what they were."""
        for item in items:
            self.glance()
            yield item
        self.check()

    def digest(self, path: Path) -> str | None:
        """Tell the content of a file or folder as it was noted; None of what was not there.

        Returns: The algorithm and the digest: XXH3 of a file, and of a folder the SHA-256 of names
            with the XXH3 of each.
        """
        known = self._known[path]
        if str(path) in known:
            return f"xxh3-128:{known[str(path)].digest}"
        by_file = {file: seen.digest for file, seen in known.items()}
        return f"names-and-xxh3-128:{_key(by_file)}" if by_file else None

    def keys(self) -> dict[str, list[str]]:
        """Tell, by path, the keys that `status_key` and `content_key` gave when it was noted."""
        return {
            str(path): [
                _key({file: seen.status for file, seen in known.items()}),
                _key({file: seen.digest for file, seen in known.items()}),
            ]
            for path, known in self._known.items()
        }


def status_key(path: Path) -> str:
    """Make a key of what a file or folder looks like without reading it."""
    return _key({file: _status(file) for file in _list(path)})


def content_key(path: Path) -> str:
    """Make a key of what a file or folder holds."""
    return _key({file: _know(file).digest for file in _list(path)})


def _key(by_file: Mapping[str, object]) -> str:
    return key_of({os.path.basename(file): fact for file, fact in by_file.items()})


def _list(path: Path) -> set[str]:
    """List what counts of a folder, or the file itself; nothing where there is neither."""
    try:
        if not path.is_dir():
            return {str(path)} if path.exists() else set()
        names = os.listdir(path)
    except (OSError, ValueError):  # ValueError: a name with a null byte
        return set()
    return {
        os.path.join(path, name)
        for name in names
        if not name.startswith(".") and os.path.splitext(name)[1].lower() in FRAME_SUFFIXES
    }


def _status(file: str) -> Status | None:
    """Read a file's status; None of what is no file, or just went."""
    try:
        status = os.stat(file)
    except OSError:
        return None
    if not stat.S_ISREG(status.st_mode):
        return None  # reading a pipe may take for ever
    return Status(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)


def _know(file: str) -> Known:
    status = _status(file)  # before the content: what changes meanwhile then has another one
    digest = xxh3_128()
    if status is None:
        return Known(None, "")
    try:
        with open(file, "rb") as stream:
            while block := stream.read(READ_BYTES):
                digest.update(block)
    except OSError:
        return Known(None, "")
    # one from the future is not settled: the clock was set back, and may come there again
    settled = time.time_ns() - status.ctime_ns > TICK_NS
    return Known(status if settled else None, digest.hexdigest())


def _changed(file: str, how: str) -> InputError:
    return InputError(f"{file} has {how} since the run began; start again when it is complete")
