"""What commands say while they work: a bar and sentences for a person, or JSON for a program."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import click

from motion_transfer.cli.bars import Bar, is_interactive, open_bar
from motion_transfer.cli.event_lines import AnyEvent, write_line
from motion_transfer.cli.terminal import counted, note, tell
from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.events import Event, Finished, FramesDone, Listener, Notice, Stage

STAGE_WORDS = {
    "adapt": "learning the person",
    "compare": "comparing bodies",
    "estimate": "finding the driver's person",
    "track": "finding the driver's person",
    "draw": "drawing the driver's motion",
    "background": "taking the driver's person out",
    "scan": "reading driver",
    "render": "rendering",
}


def choose_listener(*, quiet: bool, as_json: bool) -> Listener:
    """Choose JSON lines, nothing, or progress and sentences."""
    return JsonPrinter() if as_json else Reporter(quiet=quiet)


class JsonPrinter:
    """Prints events of any kind on stdout, one JSON object a line, see `event_lines`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()  # events come from any thread

    def __call__(self, event: AnyEvent) -> None:
        with self._lock:
            click.echo(write_line(event))


class Reporter:
    """Shows the progress of a run on stderr, and its result on stdout."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._bar: Bar | None = None
        self._lock = threading.Lock()

    def __call__(self, event: Event) -> None:
        with self._lock:
            match event:
                case Stage():
                    self._close()
                    if not self._quiet:
                        words = STAGE_WORDS.get(event.name, event.name)
                        unit = "step" if event.name == "adapt" else "frame"
                        self._bar = open_bar(words, unit=unit, total=event.frame_count)
                case FramesDone():
                    if self._bar is not None:
                        self._bar.update(event.frame_count)
                        if self._bar.n >= (self._bar.total or 0):
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
    # of one frame nobody asks how many there are a second
    rate = f", {speed(event)} while rendering" if event.frame_count > 1 else ""
    return (
        f"wrote {event.output}: {counted(event.frame_count, 'frame')},"
        f" {event.duration_seconds:.2f} s ({RENDERERS[event.renderer].report};"
        f" {event.wall_seconds:.1f} s in all{rate})"
    )


def speed(event: Finished) -> str:
    """Say how fast it was drawn, as a rate, or by the frame where that is slow."""
    seconds = max(event.render_seconds, 1e-9) / event.frame_count  # a coarse clock may say 0
    return f"{1 / seconds:.0f} frames/s" if seconds <= 0.5 else f"{seconds:.1f} s a frame"


class CountBar:
    """Progress of work that is counted."""

    def __init__(self, words: str, *, unit: str, quiet: bool, total: int | None = None) -> None:
        self._show = not quiet
        self._words = words
        self._settings: dict[str, Any] = {"unit": unit, "total": total}
        self._bar: Bar | None = None

    def __enter__(self) -> Self:
        if self._show:
            self._bar = open_bar(self._words, **self._settings)
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
    if quiet or not is_interactive():
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
