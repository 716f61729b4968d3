"""The site's reference, written from the code: all commands, and what is public in Python.

Run by mkdocs, which calls functions by their names.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import is_dataclass
from html import escape
from types import ModuleType

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import motion_transfer
import nhrr_core
from motion_transfer.cli.main import cli

EVERYWHERE = {"--debug", "--help"}
"""Options of all commands, told once."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page of all commands, and one for each package."""
    commands = "\n\n".join(
        [
            "# Commands",
            "What `mt COMMAND --help` says, of all commands. `-h` or `--help` asks for it, and"
            " `--debug` shows after an error where in the program it arose, everywhere.",
            *describe_command(cli, click.Context(cli, info_name="mt")),
        ]
    )
    made = {"commands": commands}
    made |= {each.__name__: describe_package(each) for each in (motion_transfer, nhrr_core)}
    for name, words in made.items():
        files.append(File.generated(config, f"reference/{name}.md", content=words))
    return files


def describe_package(package: ModuleType) -> str:
    """Write a page of the public names of a package, whose docstrings mkdocstrings reads."""
    name = package.__name__
    words = inspect.cleandoc(package.__doc__ or "").replace(">>> ", "    ")
    names = [public for public in package.__all__ if public != "__version__"]
    entries = [_describe_name(f"{name}.{public}", getattr(package, public)) for public in names]
    return "\n\n".join([f"# `{name}`", words, *entries])


def _describe_name(name: str, value: object) -> str:
    """Ask mkdocstrings for a name; fields of a dataclass tell what its signature would repeat."""
    signature = str(not is_dataclass(value)).lower()
    return f"::: {name}\n    options:\n      merge_init_into_class: {signature}"


def describe_command(command: click.Command, context: click.Context) -> Iterator[str]:
    """Give the paragraphs of a command, then those of the commands below it."""
    path = context.command_path
    if context.parent is not None:
        yield f"{'#' * (1 + path.count(' '))} {path}"
    yield f"```text\n{' '.join([path, *command.collect_usage_pieces(context)])}\n```"
    yield from _paragraphs(command.help or "")
    sections: dict[str, list[str]] = {}
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and EVERYWHERE.isdisjoint(parameter.opts):
            flags, words = record
            heading = getattr(parameter, "section", "Options")
            sections.setdefault(heading, []).append(f"`{flags}`\n:   {escape(words, quote=False)}")
    for heading, entries in sections.items():
        yield f"**{heading}**"
        yield from entries
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            if inner is not None and not inner.hidden:
                below = click.Context(inner, info_name=name, parent=context)
                yield from describe_command(inner, below)


def _paragraphs(words: str) -> Iterator[str]:
    """Turn click's help into Markdown: what follows a backspace is commands, kept as they are."""
    for paragraph in inspect.cleandoc(words).split("\n\n"):
        as_it_is = paragraph.startswith("\b\n")
        kept = f"```sh\n{paragraph[2:]}\n```"
        yield kept if as_it_is else escape(paragraph, quote=False)
