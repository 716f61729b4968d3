"""Processes that a command has left behind."""

from __future__ import annotations

import time
from pathlib import Path


def wait_until_gone(session: int, seconds: float = 60) -> None:
    """Raises: AssertionError if a process of a session (`start_new_session`) lives on."""
    end = time.monotonic() + seconds
    while left := members(session):
        assert time.monotonic() < end, f"processes {left} are left"
        time.sleep(0.05)


def members(session: int) -> list[int]:
    """The living processes of a session."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = status.read_text().rpartition(")")[2].split()
        except OSError:  # ended meanwhile
            continue
        if int(words[3]) == session and words[0] != "Z":
            found.append(int(status.parent.name))
    return found
