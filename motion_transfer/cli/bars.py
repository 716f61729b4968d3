"""How work that is counted shows on stderr: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import os
import sys
import time
from typing import Any, Protocol

import click
from tqdm import tqdm

from motion_transfer.cli.terminal import counted

LINE_SECONDS = 10
"""No sooner comes another line: a log is read afterwards, and short work needs none."""

LONGEST_SILENCE_SECONDS = 60
"""No later, so that nobody takes long work for stuck, systems that end silent jobs included."""

SHARE = 0.1
"""How much more of the work has to be done for a line that comes sooner."""


class Bar(Protocol):
    """What counts, as tqdm has it."""

    n: float
    total: float | None

    def update(self, n: float = 1, /) -> Any:
        """Count so many more as done."""
        ...

    def close(self) -> None:
        """Take the bar away."""
        ...


def is_interactive() -> bool:
    """Tell whether stderr is a terminal that a person looks at, and wide enough for a bar.

    Build systems give a terminal of no columns, or say by `CI` that they keep a log.
    """
    if not sys.stderr.isatty() or os.environ.get("CI", "").lower() not in ("", "0", "false"):
        return False
    try:
        columns = os.get_terminal_size(sys.stderr.fileno()).columns
    except (OSError, ValueError):  # whatever stands in for stderr is no file
        return True
    return columns > 0 and os.environ.get("TERM") != "dumb"


def open_bar(words: str, *, unit: str, total: int | None) -> Bar:
    """Begin to count, in the way that stderr is good for."""
    if is_interactive():
        return tqdm(desc=words, unit=unit, total=total, leave=False, dynamic_ncols=True)
    return LineBar(words, unit=unit, total=total)


class LineBar:
    """Says in whole lines how far work is: after each tenth, but seldom enough for a log."""

    def __init__(self, words: str, *, unit: str, total: float | None) -> None:
        self.n: float = 0
        self.total = total
        self._words = words
        self._unit = unit
        self._began = self._said = time.monotonic()
        self._said_n: float = 0

    def update(self, n: float = 1, /) -> None:
        """Count so many more as done, and say it if it is time to."""
        self.n += n
        now = time.monotonic()
        silent = now - self._said
        enough = not self.total or self.n - self._said_n >= SHARE * self.total
        if silent >= LONGEST_SILENCE_SECONDS or (silent >= LINE_SECONDS and enough):
            self._said, self._said_n = now, self.n
            click.echo(f"mt: {self._line(now - self._began)}", err=True)

    def close(self) -> None:
        """Say nothing more: whoever counted says what came of it."""

    def _line(self, seconds: float) -> str:
        words = f"{self._words}: " if self._words else ""
        if not self.total:
            return f"{words}{counted(int(self.n), self._unit)}"
        words += (
            f"{self.n:.0f} of {counted(int(self.total), self._unit)}, {self.n / self.total:.0%}"
        )
        if not 0 < self.n < self.total:
            return words
        left = round(seconds / self.n * (self.total - self.n))
        return f"{words}, about {left // 60}:{left % 60:02d} left"
