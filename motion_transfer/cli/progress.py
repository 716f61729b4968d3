"""What commands say while they work: a bar and sentences for a person, or JSON for a program."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Self

import click
from tqdm import tqdm

from motion_transfer.cli.terminal import note, tell
from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.events import Event, Finished, FramesDone, Listener, Notice, Stage

STAGE_WORDS = {
    "adapt": "learning the person",
    "compare": "comparing bodies",
    "estimate": "finding the driver's person",
    "background": "taking the driver's person out",
    "scan": "reading driver",
    "render": "rendering",
}
_open_bar = partial(tqdm, leave=False, dynamic_ncols=True)


def choose_listener(*, quiet: bool, as_json: bool) -> Listener:
    """Choose JSON lines, nothing, or a bar and sentences; the bar is for terminals only."""
    if as_json:
        return JsonPrinter()
    return Reporter(show_bar=sys.stderr.isatty(), quiet=quiet)


class JsonPrinter:
    """Prints events of any kind on stdout, one JSON object a line, whose `event` names the kind."""

    def __init__(self) -> None:
        self._lock = threading.Lock()  # events come from any thread

    def __call__(self, event: Any) -> None:
        fields = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(event).items()}
        with self._lock:
            click.echo(json.dumps({"event": type(event).__name__.lower(), **fields}))


class Reporter:
    """Shows the progress of a run on stderr, and its result on stdout."""

    def __init__(self, *, show_bar: bool, quiet: bool) -> None:
        self._show_bar = show_bar and not quiet
        self._quiet = quiet
        self._bar: tqdm | None = None
        self._lock = threading.Lock()

    def __call__(self, event: Event) -> None:
        with self._lock:
            match event:
                case Stage():
                    self._close()
                    if self._show_bar:
                        words = STAGE_WORDS.get(event.name, event.name)
                        unit = "step" if event.name == "adapt" else "frame"
                        self._bar = _open_bar(total=event.frame_count, desc=words, unit=unit)
                case FramesDone():
                    if self._bar is not None:
                        self._bar.update(event.frame_count)
                        if self._bar.n >= self._bar.total:
                            self._close()
                case Notice() if not self._quiet:
                    self._close()
                    note(event.message)
                case Finished() if not self._quiet:
                    tell(describe(event))

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def describe(event: Finished) -> str:
    """Write the one line that a person reads when all is done."""
    rate = event.frame_count / event.render_seconds
    return (
        f"wrote {event.output}: {event.frame_count} frames, {event.duration_seconds:.2f} s"
        f" ({RENDERERS[event.renderer].report}; {event.wall_seconds:.1f} s in all,"
        f" {rate:.0f} frames/s while rendering)"
    )


class CountBar:
    """A bar for work that is counted; nothing where stderr is no terminal."""

    def __init__(self, words: str, *, unit: str, quiet: bool, total: int | None = None) -> None:
        self._show = sys.stderr.isatty() and not quiet
        self._settings: dict[str, Any] = {"desc": words, "unit": unit, "total": total}
        self._bar: tqdm | None = None

    def __enter__(self) -> Self:
        if self._show:
            self._bar = _open_bar(**self._settings)
        return self

    def __exit__(self, *_error: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def advance(self, count: int, total: int | None = None) -> None:
        """Count so many more as done; `total` tells of how many, if that is known only now."""
        if self._bar is not None:
            self._bar.total = total or self._bar.total
            self._bar.update(count)


@contextmanager
def long_wait(words: str, *, quiet: bool) -> Iterator[None]:
    """Say what is waited for, and on a terminal for how long already, while the block runs."""
    if quiet or not sys.stderr.isatty():
        note(words, quiet=quiet)
        yield
        return
    ended = threading.Event()

    def show() -> None:
        began = time.monotonic()
        while not ended.wait(0.5):  # s: often enough for a clock of whole seconds
            click.echo(f"\r{words}: {time.monotonic() - began:.0f} s", err=True, nl=False)
        # as many blanks as the longest time would take
        click.echo("\r" + " " * (len(words) + 12) + "\r", err=True, nl=False)

    clock = threading.Thread(target=show, daemon=True)
    clock.start()
    try:
        yield
    finally:
        ended.set()
        clock.join()
