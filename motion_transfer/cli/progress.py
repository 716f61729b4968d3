"""Events to a person (progress bar, one line at the end) or to a program (JSON lines)."""

from __future__ import annotations

import json
import sys
import threading
from dataclasses import asdict
from pathlib import Path

import click
from tqdm import tqdm

from motion_transfer.render.events import Event, Finished, FramesDone, Listener, Notice, Stage

STAGE_WORDS = {"scan": "reading driver", "render": "rendering"}
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
