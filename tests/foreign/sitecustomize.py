"""Makes Linux behave as Windows does, as far as Python can: for processes begun with this folder in
`PYTHONPATH`, and all that they begin in turn.

What Windows lacks is taken away, and what it refuses is refused: opening folders, syncing what may
only be read, replacing or removing what is open. Its old encodings are told of as errors.
"""

from __future__ import annotations

import errno
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path

# these have ways of their own on Windows; filelock's, too, keeps a lock's file open
import filelock  # noqa: F401

with suppress(ImportError):
    import psutil  # noqa: F401

MODULES = ("fcntl", "resource", "grp", "pwd", "termios")
FUNCTIONS = {
    os: (
        *("sched_getaffinity", "process_cpu_count", "sysconf", "pread", "fork", "geteuid"),
        *("O_DIRECTORY", "mkfifo", "killpg", "statvfs"),
    ),
    signal: ("pthread_sigmask", "SIGHUP", "SIGUSR1"),
}


class _Missing:
    """A finder of modules that knows some to be missing."""

    @staticmethod
    def find_spec(name: str, *_: object) -> None:
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def _refuse(path: object, code: int = errno.EACCES) -> None:
    raise PermissionError(code, os.strerror(code), os.fsdecode(path))  # type: ignore[arg-type]


def _is_open(path: object) -> bool:
    """Tell whether this process holds a file open, or a file in a folder."""
    real = os.path.realpath(os.fsdecode(path))  # type: ignore[arg-type]
    for link in Path("/proc/self/fd").iterdir():
        try:
            target = str(link.readlink())
        except OSError:  # the descriptor that lists them
            continue
        if target == real or target.startswith(f"{real}/"):
            return True
    mapped = Path("/proc/self/maps").read_text(encoding="utf-8")
    return any(line.endswith(f" {real}") or f" {real}/" in line for line in mapped.splitlines())


def _patch_files() -> None:
    # standard library modules that took names of `os` do not see these; what is tested calls `os`
    open_, fsync, replace, rename, unlink = os.open, os.fsync, os.replace, os.rename, os.unlink

    def guarded_open(path, flags, *arguments, **options):
        # the standard library's own walks aside, which do otherwise on Windows
        if Path(os.fsdecode(path)).is_dir() and "dir_fd" not in options:
            _refuse(path)
        return open_(path, flags, *arguments, **options)

    def guarded_fsync(descriptor):
        number = descriptor if isinstance(descriptor, int) else descriptor.fileno()
        told = Path(f"/proc/self/fdinfo/{number}").read_text(encoding="ascii")
        flags = int(told.split("flags:")[1].split()[0], 8)
        if flags & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return fsync(descriptor)

    def guarded_move(move):
        def guarded(source, destination, **options):
            if _is_open(source) or _is_open(destination):
                _refuse(source)
            return move(source, destination, **options)

        return guarded

    def guarded_unlink(path, **options):
        if _is_open(path):
            _refuse(path)
        return unlink(path, **options)

    os.open, os.fsync = guarded_open, guarded_fsync
    os.replace, os.rename = guarded_move(replace), guarded_move(rename)
    os.unlink = os.remove = guarded_unlink
    shutil._use_fd_functions = False  # type: ignore[attr-defined]
    tempfile.TemporaryFile = tempfile.NamedTemporaryFile


def _patch_processes() -> None:
    get_context = multiprocessing.get_context

    def spawn_only(method=None):
        if method not in (None, "spawn"):
            raise ValueError(f"cannot find context for {method!r}")
        return get_context("spawn")

    multiprocessing.get_context = spawn_only
    multiprocessing.get_all_start_methods = lambda: ["spawn"]


_patch_files()
_patch_processes()
for module, names in FUNCTIONS.items():
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
sys.meta_path.insert(0, _Missing())  # type: ignore[arg-type]
for name in MODULES:
    sys.modules.pop(name, None)
# set by -X warn_default_encoding: whoever leaves the encoding to the system is told of
warnings.filterwarnings("error", category=EncodingWarning, module=r"motion_transfer|nhrr_core")
