"""A journal: what has been finished, one JSON line each, so that an interrupted work can go on.

A line is written after the thing it tells of is whole on disk; a thing without its line is made
again. A line that a crash cut short is dropped.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

Entry = dict[str, Any]


class Journal:
    """Append-only; one writer at a time, which a lock elsewhere sees to."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> list[Entry]:
        """Every whole line up to the first damaged one; changes nothing."""
        return self._read()[0]

    def repair(self) -> list[Entry]:
        """As `read`, and what is not believed is cut off; for the lock's holder only."""
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
            try:
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
                while line:
                    line = line[file.write(line) :]
                os.fsync(file.fileno())
            except OSError:  # a full disk: no later line is believed behind half a line
                os.truncate(self._path, whole_bytes)
                raise
