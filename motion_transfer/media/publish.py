"""Writing so that a final name only ever holds something whole.

What is made lies in a hidden folder beside it, on the same file system, until it is renamed.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from motion_transfer.errors import OutputError

LONGEST_NAME_BYTES = 255
"""What the file systems of today take (NAME_MAX)."""

RANDOM_ENDING_BYTES = 16
"""Room for what `tempfile` and others put behind a hidden name."""


def name_beside(final: Path, ending: str) -> Path:
    """Name something hidden beside an output, always the same for the same output."""
    final = final.absolute() if final.name not in ("", "..") else final.resolve()
    return final.parent / f".{extend_name(final.name, ending)}"


def extend_name(name: str, ending: str) -> str:
    """Put an ending behind a name, always the same for the same name.

    A name may be as long as the file system takes: there is no room for more then, so that it is
    cut, and a digest stands for the rest. A dot before it has room.
    """
    encoded = os.fsencode(name)
    added = os.fsencode(f".{ending}")
    if len(encoded) + len(added) + RANDOM_ENDING_BYTES > LONGEST_NAME_BYTES:
        digest = hashlib.sha256(encoded).hexdigest()[:16].encode()
        room = LONGEST_NAME_BYTES - RANDOM_ENDING_BYTES - len(added) - len(digest) - 1
        # whole characters only: some file systems take nothing but text
        kept = encoded[:room].decode("utf-8", "ignore")
        encoded = kept.encode() + b"-" + digest
    return os.fsdecode(encoded) + ending


def is_frame(item: Path) -> bool:
    """Tell whether something in a folder is a frame of a folder of frames, by its name."""
    return item.suffix == ".png" and item.stem.isdecimal()


def check_destination(
    path: Path,
    *,
    force: bool,
    belongs: Callable[[Path], bool] = is_frame,
    content: str = "frames",
) -> None:
    """Refuse a destination before any work is done.

    Args:
        belongs: Tells what a folder may hold that is replaced; `content` is that in words.
    Raises: OutputError if it exists and `force` is off, if its name is none, or if its folder
        cannot be written.
    """
    with explain_disk_errors(path):
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise OutputError(f"{path} is a device or a pipe; choose the name of a file")
        if path.is_dir() and Path.cwd().is_relative_to(path.resolve()):
            raise OutputError(f"{path} is where you are, or holds it; choose another name")
        if path.exists() and not force:
            raise OutputError(f"{path} exists already; choose another name or add --force")
        # a mistyped name is not to cost somebody a folder of other things
        if path.is_dir() and not all(map(belongs, path.iterdir())):
            raise OutputError(
                f"{path} is a folder with other things than {content} in it, and is not replaced"
                " even with --force; choose another name"
            )
        parent = path.absolute().parent
        existing = next(folder for folder in (parent, *parent.parents) if folder.exists())
        if not existing.is_dir():
            raise OutputError(f"cannot write {path}: {existing} is not a folder")
        try:
            tempfile.TemporaryFile(dir=existing).close()
        except OSError as error:  # no permission, a full disk, or a place such as /proc
            raise OutputError(
                f"cannot write {path}: {existing} takes no new files ({error.strerror})"
            ) from error


@contextmanager
def work_folder(final: Path) -> Iterator[Path]:
    """Make a hidden folder beside `final`, on the same file system, gone when the block ends.

    Raises: OutputError where the disk is full or the place cannot be written.
    """
    with explain_disk_errors(final):
        parent = final.absolute().parent
        made = make_folder(parent)
        folder = Path(tempfile.mkdtemp(prefix=name_beside(final, ".work-").name, dir=parent))
    try:
        with explain_disk_errors(final):
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if not final.exists():
            remove_folders(made)


def make_folder(folder: Path) -> list[Path]:
    """Make a folder and those that it lies in. Returns: Those that were made, innermost first."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def remove_folders(folders: list[Path]) -> None:
    """Remove folders that were made for nothing, innermost first."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:  # somebody else put something there meanwhile: theirs to keep
            break


@contextmanager
def explain_disk_errors(final: Path) -> Iterator[None]:
    """Turn the operating system's refusal to write `final` into one of ours."""
    try:
        yield
    except OSError as error:
        reasons = {
            errno.ENOSPC: "the disk is full; free some space or write elsewhere",
            errno.EDQUOT: "the disk quota is used up; free some space or write elsewhere",
            errno.EFBIG: "the file would exceed the largest size allowed here",
            errno.EACCES: "no permission; write elsewhere"
            if sys.platform != "win32"
            else "no permission, or a program has it open; close that, or write elsewhere",
            errno.EPERM: "no permission; write elsewhere",
            errno.EROFS: "the file system is read-only; write elsewhere",
            errno.ENOENT: "a folder was removed that it is written in; start again",
            errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
        }
        if error.errno not in reasons:
            raise
        raise OutputError(f"cannot write {final}: {reasons[error.errno]}") from error


def publish(finished: Path, final: Path) -> None:
    """Move a finished file or folder of files onto its final name, durably."""
    for file in sorted(finished.iterdir()) if finished.is_dir() else [finished]:
        _sync(file)
    if final.exists() and (final.is_dir() or finished.is_dir()):
        # a folder cannot be replaced, nor replace a file, in one step: the old one steps aside
        old = Path(tempfile.mkdtemp(prefix=name_beside(final, ".old-").name, dir=final.parent))
        final.replace(old / final.name)
        finished.replace(final)
        shutil.rmtree(old)
    else:
        finished.replace(final)
    _sync(final.absolute().parent)  # the new name itself is in there


def _sync(path: Path) -> None:
    is_posix = hasattr(os, "O_DIRECTORY")
    if path.is_dir() and not is_posix:  # Windows opens no folders, and keeps names safe by itself
        return
    # and makes only those files safe that may be written
    descriptor = os.open(path, os.O_RDONLY if is_posix else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
