"""What is said on a terminal: one line each, whatever the names in it hold."""

from __future__ import annotations

import click


def printable(words: str) -> str:
    """Write out what a terminal would obey instead of showing: line breaks, escapes, lone bytes.

    File names may hold all of them.
    """
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode()
        for c in words
    )


PLURALS = {"person": "people"}


def counted(count: int, thing: str) -> str:
    """Say how many: `1 frame`, `2 frames`."""
    return f"{count} {thing if count == 1 else PLURALS.get(thing, f'{thing}s')}"


def note(words: str, *, quiet: bool = False) -> None:
    """Say something that a person should know, though the work goes on."""
    if not quiet:
        click.echo(f"mt: note: {printable(words)}", err=True)


def tell(words: str) -> None:
    """Say a result, on one line."""
    click.echo(printable(words))
