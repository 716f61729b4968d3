"""Files that a user names: what may be read at all, and their bytes."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from motion_transfer.errors import InputError


def cache_folder() -> Path:
    """Name the folder of what is kept between runs: `$MT_CACHE_DIR`, or `motion-transfer` in the
    user's cache (`$XDG_CACHE_HOME`, or `~/.cache`)."""
    if chosen := os.environ.get("MT_CACHE_DIR"):
        return Path(chosen).expanduser()
    cache = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG specification says to ignore relative paths
    base = Path(cache) if Path(cache).is_absolute() else Path.home() / ".cache"
    return base / "motion-transfer"


def check_readable(path: Path, what: str, *, folder: bool = False) -> None:
    """Refuse what is no file to read from beginning to end.

    A device or a pipe may have no end, or nobody who writes into it, and is read more than once
    here.

    Args:
        what: What the file is wanted for, such as `driver`, for messages.
        folder: Whether a folder will do, too.
    Raises: InputError saying what is there instead.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise InputError(f"{what} {path} does not exist") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a null byte
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{what} {path} cannot be read: {reason}") from error
    if stat.S_ISDIR(mode) and not folder:
        raise InputError(f"{what} {path} is a folder; name a file in it")
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(
            f"{what} {path} is a device or a pipe; write its content to a file, and name that"
        )


def read_bytes(path: Path, what: str) -> bytes:
    """Read a file. Raises: InputError naming what the file was wanted for."""
    check_readable(path, what)
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{what} {path} does not exist") from None
    except OSError as error:
        raise InputError(f"{what} {path} cannot be read: {error.strerror}") from error
