"""Events to a person (progress bar, one line at the end) or to a program (JSON lines)."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import click
from tqdm import tqdm

from motion_transfer.render.events import Event, Finished, FramesDone, Listener, Notice, Stage

STAGE_WORDS = {
    "compare": "comparing bodies",
    "estimate": "finding the driver's person",
    "scan": "reading driver",
    "render": "rendering",
}
RENDERER_WORDS = {
    "texture": "texture renderer: a draft, no network",
    "nhrr": "nhrr renderer",
}


def choose_listener(*, quiet: bool, as_json: bool) -> Listener:
    """JSON lines, nothing, or a bar and sentences; the bar only on a terminal."""
    if as_json:
        return JsonPrinter()
    return Reporter(show_bar=sys.stderr.isatty(), quiet=quiet)


class JsonPrinter:
    """One JSON object a line on stdout, `event` naming its kind."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def __call__(self, event: Event) -> None:
        fields = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(event).items()}
        with self._lock:
            click.echo(json.dumps({"event": type(event).__name__.lower(), **fields}))


class Reporter:
    """Progress on stderr, the result on stdout."""

    def __init__(self, *, show_bar: bool, quiet: bool) -> None:
        self._show_bar = show_bar and not quiet
        self._quiet = quiet
        self._bar: tqdm | None = None
        self._lock = threading.Lock()

    def __call__(self, event: Event) -> None:
        with self._lock:
            match event:
                case Stage():
                    self._begin(event)
                case FramesDone():
                    if self._bar is not None:
                        self._bar.update(event.frame_count)
                        if self._bar.n >= self._bar.total:
                            self.close()
                case Notice() if not self._quiet:
                    self.close()
                    click.echo(f"mt: note: {event.message}", err=True)
                case Finished() if not self._quiet:
                    click.echo(describe(event))

    def close(self) -> None:
        """Take the bar off the screen."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _begin(self, stage: Stage) -> None:
        self.close()
        if self._show_bar:
            self._bar = tqdm(
                total=stage.frame_count,
                desc=STAGE_WORDS.get(stage.name, stage.name),
                unit="frame",
                leave=False,
                dynamic_ncols=True,
            )


def describe(event: Finished) -> str:
    """The one line that a person reads when all is done."""
    rate = event.frame_count / event.render_seconds
    return (
        f"wrote {event.output}: {event.frame_count} frames, {event.duration_seconds:.2f} s"
        f" ({RENDERER_WORDS[event.renderer]}; {event.wall_seconds:.1f} s in all,"
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
            self._bar = tqdm(**self._settings, leave=False, dynamic_ncols=True)
        return self

    def __exit__(self, *_error: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def advance(self, count: int, total: int | None = None) -> None:
        """So many more are done, of so many where that was not known before."""
        if self._bar is not None:
            self._bar.total = total or self._bar.total
            self._bar.update(count)


@contextmanager
def long_wait(words: str, *, quiet: bool) -> Iterator[None]:
    """Say what is waited for, and on a terminal for how long already, while the block runs."""
    if quiet or not sys.stderr.isatty():
        if not quiet:
            click.echo(f"mt: note: {words}", err=True)
        yield
        return
    ended = threading.Event()

    def show() -> None:
        began = time.monotonic()
        while not ended.wait(0.5):
            click.echo(f"\r{words}: {time.monotonic() - began:.0f} s", err=True, nl=False)
        click.echo("\r" + " " * (len(words) + 12) + "\r", err=True, nl=False)

    clock = threading.Thread(target=show, daemon=True)
    clock.start()
    try:
        yield
    finally:
        ended.set()
        clock.join()
