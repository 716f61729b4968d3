"""Help in sections: thirty options under a few headings can be read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from motion_transfer.render.option import Option, list_options


class SectionOption(click.Option):
    """An option that says under which heading it belongs."""

    def __init__(self, *arguments: Any, section: str = "Options", **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.section = section


class SectionCommand(click.Command):
    """A command whose help lists options under their headings, in order of appearance."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        sections: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None and isinstance(parameter, click.Option):
                sections.setdefault(getattr(parameter, "section", "Other"), []).append(record)
        for heading, records in sections.items():
            with formatter.section(heading):
                formatter.write_dl(records)


class WordsCommand(SectionCommand):
    """A command without arguments, whose repeatable options take several words at once.

    `--weights a b --weights c` is `--weights a --weights b --weights c`.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        repeatable = {
            name
            for parameter in self.params
            if isinstance(parameter, click.Option) and parameter.multiple
            for name in parameter.opts
        }
        spread: list[str] = []
        option, used = "", False
        for word in args:
            if word.startswith("-") and len(word) > 1:
                name, _, value = word.partition("=")
                option, used = (name if name in repeatable else ""), bool(value)
            elif option and used:
                spread.append(option)
            else:
                used = True
            spread.append(word)
        return super().parse_args(ctx, spread)


def run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """A decorator: every option of a run, as `RenderOptions` describes it."""
    return _with_run_options(command, required=True)


def loose_run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """As `run_options`, but none has to be given: a manifest may say it."""
    return _with_run_options(command, required=False)


def _with_run_options(command: Callable[..., Any], *, required: bool) -> Callable[..., Any]:
    from motion_transfer.render.options import RenderOptions

    for entry in reversed(list_options(RenderOptions)):
        for decorate in reversed(_decorators(entry, required=required and entry.required)):
            command = decorate(command)
    return command


def _decorators(entry: Option, *, required: bool) -> list[Callable[..., Any]]:
    common: dict[str, Any] = {"cls": SectionOption, "section": entry.section, "help": entry.help}
    if entry.kind == "garments":
        photo, parts = entry.flags
        return [
            click.option(photo, entry.name, multiple=True, metavar="PHOTO[,IUV]", **common),
            click.option(
                parts,
                multiple=True,
                metavar="PARTS",
                **{
                    **common,
                    "help": "Such as torso,upper-legs; `mt info parts` lists the names.",
                },
            ),
        ]
    if entry.kind == "flag":
        common["is_flag"] = True
    elif entry.kind == "switch":
        common["default"] = None
    else:
        common |= {"type": int if entry.kind == "integer" else str, "metavar": entry.metavar}
        common["required"] = required
        if entry.kind == "text":
            common["default"] = entry.default
    return [click.option(*entry.flags, entry.name, **common)]
