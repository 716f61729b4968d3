"""Pages of this machine: the link is told, a browser opened, and the page served until Ctrl-C."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable

import click

from motion_transfer.cli.terminal import tell


def serve_page(link: str, serve: Callable[[], object], *, open_browser: bool) -> None:
    """Tell a page's link, and serve it until the user ends that."""
    tell(link)
    sys.stdout.flush()  # whoever reads it from a pipe waits for it
    if open_browser:
        click.launch(link)
    with contextlib.suppress(KeyboardInterrupt):  # the way to end it
        serve()
