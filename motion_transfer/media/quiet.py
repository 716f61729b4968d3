"""Native libraries that write to standard error: only the file descriptor keeps them from it."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

QUIET = threading.RLock()
"""Two threads that take turns halfway would leave standard error closed to everybody."""

# Pillow logs what it raises, too
logging.getLogger("PIL").addHandler(logging.NullHandler())


@contextmanager
def quiet_libraries() -> Iterator[None]:
    """Keep off standard error what native code writes there, in whatever thread, for a moment."""
    with QUIET:
        try:
            stderr = os.dup(2)
        except OSError:  # closed, and so quiet
            yield
            return
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(nowhere, 2)
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            os.close(nowhere)
