"""The work folder of an output: finished pieces, the journal that knows them, and a lock.

It lies beside the output, hidden, on the same file system, under a name that follows from the
output's: whoever makes the same output again finds what an interrupted run has finished. A piece is
published by writing it under another name, syncing, renaming, and only then noting it in the
journal, one JSON line each, with a key of the content it was made from; a piece without its line is
made again. The operating system releases the lock of a process that dies, so a lock that is held
has a living owner.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import socket
import threading
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from filelock import FileLock, Timeout

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.publish import (
    explain_disk_errors,
    make_folder,
    name_beside,
    publish,
    remove_folders,
)

Entry = dict[str, Any]


class Journal:
    """Lines that are only ever added, by one writer at a time, which a lock sees to."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> list[Entry]:
        """Read every whole line up to the first damaged one."""
        return self._read()[0]

    def repair(self) -> list[Entry]:
        """Read it, and cut off what is not believed; for the lock's holder only."""
        entries, whole_bytes = self._read()
        if self._path.exists() and self._path.stat().st_size > whole_bytes:
            os.truncate(self._path, whole_bytes)
        return entries

    def _read(self) -> tuple[list[Entry], int]:
        try:
            data = self._path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return [], 0
        entries: list[Entry] = []
        whole_bytes = 0
        for line in data.splitlines(keepends=True):
            try:  # a line that a crash cut short has no end
                entry = json.loads(line) if line.endswith(b"\n") else None
            except ValueError:
                entry = None
            if not isinstance(entry, dict):
                break
            entries.append(entry)
            whole_bytes += len(line)
        return entries, whole_bytes

    def append(self, entry: Entry) -> None:
        """Write a line; on return it is on disk. Raises: OSError, with nothing written."""
        line = json.dumps(entry, separators=(",", ":")).encode() + b"\n"
        with self._path.open("ab", buffering=0) as file:
            whole_bytes = file.seek(0, os.SEEK_END)
            try:
                while line:  # an unbuffered file may take less than it is given
                    line = line[file.write(line) :]
                os.fsync(file.fileno())
            except OSError:  # a full disk: no later line is believed behind half a line
                file.truncate(whole_bytes)
                raise


LOCK = "lock"
READ_BYTES = 1 << 20  # at a time, for digests: large enough, and small in memory


def work_path(final: Path) -> Path:
    """Name the work folder of an output."""
    return name_beside(final, ".work")


@contextmanager
def locked(folder: Path, what: str) -> Iterator[None]:
    """Hold an existing folder's lock. Raises: OutputError naming who holds it already.

    Args:
        what: Begins the message, such as `cannot write out.mp4`.
    """
    owner = folder / "owner.json"
    lock = FileLock(folder / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        try:
            who = json.loads(owner.read_text(encoding="utf-8"))
            words = f"process {who['process']} on {who['host']}"
        except (OSError, ValueError, KeyError, TypeError):  # it may be writing that just now
            words = "another process"
        raise OutputError(f"{what}: {words} is at work on it; wait for it, or stop it") from None
    try:
        who = {"process": os.getpid(), "host": socket.gethostname()}
        owner.write_text(json.dumps(who), encoding="utf-8")
        yield
    finally:
        lock.release()


def remove_held(folder: Path) -> bool:
    """Remove a folder while its lock is held by this process.

    Returns: Whether the lock is left, which Windows keeps; `remove_lock` it when it is released.
    Raises: OSError.
    """
    try:
        shutil.rmtree(folder)
    except PermissionError:
        for item in folder.iterdir():
            if item.name != LOCK:
                _remove(item)
        return True
    return False


def remove_lock(folder: Path) -> None:
    """Remove a folder of which only its lock is left, unless somebody holds that again."""
    with suppress(OSError):
        (folder / LOCK).unlink(missing_ok=True)
        folder.rmdir()


class WorkFolder:
    """A context manager: inside it, this process alone works on an output.

    What was finished stays for the next run unless `clear` was called; a folder in which nothing
    was finished goes, and so do the folders that were made to hold it.
    """

    def __init__(self, final: Path, *, restart: bool = False) -> None:
        self.path = work_path(final)
        self._final = final
        self._restart = restart
        self._made: list[Path] = []
        self._journal = Journal(self.path / "journal.jsonl")
        self._pieces: dict[str, dict[str, Any]] = {}
        self._writing = threading.Lock()
        self._leaves_lock = False

    def __enter__(self) -> Self:
        """Raises: OutputError if somebody else works there, or it cannot be written."""
        with explain_disk_errors(self._final):
            self._made = make_folder(self.path)[1:]
            self._lock = locked(self.path, f"cannot write {self._final}")
            self._lock.__enter__()
            if self._restart:
                self._remove_content()
            self._pieces = {entry["piece"]: entry for entry in self._journal.repair()}
            self._remove_strays()
        return self

    def __exit__(self, *_: object) -> None:
        if self._pieces:
            self._remove_strays()
        else:
            self.clear()
        self._lock.__exit__(None, None, None)
        if self._leaves_lock:
            remove_lock(self.path)
            if not self._final.exists():
                remove_folders(self._made)

    def clear(self) -> None:
        """Remove the folder: the output is published, or there is nothing to keep."""
        with suppress(OSError):
            # the journal last: if this is stopped, the next run knows that all is published
            self._remove_content(but=("journal.jsonl", LOCK))
            self._leaves_lock = remove_held(self.path)
        self._pieces = {}
        if not self._final.exists():
            remove_folders(self._made)

    def has(self, piece: str, key: str) -> bool:
        """Tell whether a piece is there, whole, and made from content with that key."""
        entry = self._pieces.get(piece)
        if entry is None or entry["key"] != key:
            return False
        path = self.path / piece
        try:
            return path.exists() and digest_of(path) == entry["sha256"]
        except OSError:
            return False

    def temporary(self, piece: str) -> Path:
        """Make a name to write a piece under before `finish`; never the same twice."""
        path = Path(piece)
        return self.path / f"{path.stem}.part-{uuid.uuid4().hex[:8]}{path.suffix}"

    def finish(self, piece: str, written: Path, key: str) -> None:
        """Give a written piece its name and note it; on return both are on disk."""
        self.note(piece, publish_piece(written, self.path / piece), key)

    def note(self, piece: str, digest: str, key: str) -> None:
        """Note a piece that has its name already (see `publish_piece`)."""
        entry = {"piece": piece, "key": key, "sha256": digest}
        with self._writing:
            self._journal.append(entry)
            self._pieces[piece] = entry

    def publish(self, finished: Path, key: str) -> None:
        """Move a finished output onto its final name; killed at any moment, `published` knows."""
        entry = {"piece": "output", "key": key, "sha256": _identity(finished)}
        self._journal.append(entry)
        publish(finished, self._final)

    def published(self, key: str | None = None) -> bool:
        """Tell whether the file under the final name is the one that `publish` put there."""
        entry = self._pieces.get("output")
        if entry is None or not self._final.exists() or key not in (None, entry["key"]):
            return False
        return _identity(self._final) == entry["sha256"]

    def _remove_strays(self) -> None:
        """Remove what was being written when its writer was stopped."""
        for stray in self.path.glob("*.part-*"):
            _remove(stray)

    def _remove_content(self, but: tuple[str, ...] = (LOCK, "owner.json")) -> None:
        for item in self.path.iterdir():
            if item.name not in but:
                _remove(item)


def was_published(final: Path) -> bool:
    """Tell whether an output's run was stopped after publishing it, before its folder was gone."""
    entries = Journal(work_path(final) / "journal.jsonl").read()
    output = [entry["sha256"] for entry in entries if entry["piece"] == "output"]
    return bool(output) and final.exists() and _identity(final) == output[-1]


def publish_piece(written: Path, final: Path) -> str:
    """Sync a file or folder of files and give it its name. Returns: its digest. Raises: OSError."""
    digest = digest_of(written)
    if final.is_dir():
        shutil.rmtree(final)
    publish(written, final)
    return digest


def key_of(facts: Mapping[str, Any]) -> str:
    """Make a digest of facts that JSON can hold; paths and fractions count as words."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True, default=str).encode()).hexdigest()


def digest_of(path: Path) -> str:
    """Make the SHA-256 of a file, or of a folder's files and their names. Raises: OSError."""
    digest = hashlib.sha256()
    files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
    for file in files:
        if path.is_dir():
            digest.update(f"{file.name}\0{file.stat().st_size}\0".encode())
        with file.open("rb") as stream:
            while block := stream.read(READ_BYTES):
                digest.update(block)
    return digest.hexdigest()


def digest_file(path: Path, what: str) -> str:
    """Compute the SHA-256 of a file or folder. Raises: InputError naming what it was wanted for."""
    try:
        return digest_of(path)
    except FileNotFoundError:
        raise InputError(f"{what} {path} does not exist") from None
    except OSError as error:
        raise InputError(f"{what} {path} cannot be read: {error.strerror}") from error


def _identity(path: Path) -> str:
    """Take from a file's status what a rename leaves as it is, and nothing else does."""
    status = path.stat()
    return f"{status.st_ino}:{status.st_mtime_ns}:{0 if path.is_dir() else status.st_size}"


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
