"""What `-v` shows: this package's log, on stderr, and no library's."""

from __future__ import annotations

import logging
from contextlib import suppress

import click

from motion_transfer.cli.terminal import printable

PACKAGE = "motion_transfer"
FORM = "mt: %(asctime)s.%(msecs)03d %(levelname)s %(module)s: %(message)s"
TIME = "%Y-%m-%dT%H:%M:%S"


class _Lines(logging.Handler):
    """Writes to whatever stderr is at the time: bars and tests replace it."""

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(OSError):  # a log that cannot be written ends no run
            click.echo(printable(self.format(record)), err=True)


def show_log() -> None:
    """Show what is chosen and found, from debug on; called twice, it does nothing more."""
    log = logging.getLogger(PACKAGE)
    log.setLevel(logging.DEBUG)
    log.propagate = False  # a library may have given the root a handler, and say it again
    if not any(isinstance(handler, _Lines) for handler in log.handlers):
        handler = _Lines()
        handler.setFormatter(logging.Formatter(FORM, TIME))
        log.addHandler(handler)
