"""Processes of our own: they do not hear Ctrl-C, and end with the one that began them.

What POSIX has for that, Windows lacks: signals that wait while a process begins. There, and for the
moment until it has begun, a child hears what its terminal says.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import connection, parent_process, resource_tracker

ORPHANED = 3  # exit code of a process whose parent is gone


@contextmanager
def deaf(*signals: signal.Signals) -> Iterator[None]:
    """Keep signals from processes that begin inside; this one, whose they are, hears them after.

    A process that began inside calls `begin_child`.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which would lift this if it began inside
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin_child() -> None:
    """Settle into a process that was just begun: deaf to Ctrl-C, and it ends with its parent."""
    if not hasattr(signal, "pthread_sigmask"):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_follow_parent, daemon=True).start()


def _follow_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(ORPHANED)  # a thread cannot end its process in any kinder way
