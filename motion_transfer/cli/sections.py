"""Help in sections: thirty options under a few headings can be read."""

from __future__ import annotations

from typing import Any

import click


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
