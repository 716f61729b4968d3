"""Processes that a command has left behind, and one that dies at a bad moment."""

from __future__ import annotations

import os
import struct
import sys
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


def die_in_mid_result() -> None:
    """A task whose worker is killed when it has sent a part of its result."""
    frame = sys._getframe()
    while frame is not None and "result_queue" not in frame.f_locals:
        frame = frame.f_back
    assert frame is not None
    pipe = frame.f_locals["result_queue"]._writer.fileno()
    os.write(pipe, struct.pack("!i", 1000) + b"a part")
    os._exit(9)
