"""Options that take several words at once."""

from __future__ import annotations

import click
import pytest

from motion_transfer.cli.options import WordsCommand


@click.command(cls=WordsCommand)
@click.option("--many", multiple=True)
@click.option("-m", "--more", multiple=True)
@click.option("--one")
@click.option("--yes", is_flag=True)
def command(**values: object) -> None:
    """A command."""


@pytest.mark.parametrize(
    ("line", "many", "more"),
    [
        ("", (), ()),
        ("--many a", ("a",), ()),
        ("--many a b c --one x --more d", ("a", "b", "c"), ("d",)),
        ("--many a b --many c", ("a", "b", "c"), ()),
        ("--many=a b", ("a", "b"), ()),
        ("-m a b --yes", (), ("a", "b")),
        ("--many - --more a", ("-",), ("a",)),
    ],
)
def test_words_are_spread(line: str, many: tuple[str, ...], more: tuple[str, ...]) -> None:
    context = command.make_context("command", line.split())
    assert (context.params["many"], context.params["more"]) == (many, more)


@pytest.mark.parametrize("line", ["stray", "--one a b", "--yes a", "--many"])
def test_stray_words_stay_errors(line: str) -> None:
    with pytest.raises(click.UsageError):
        command.make_context("command", line.split())
