"""Options of commands: made from their one description, and listed under headings."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, reduce
from itertools import chain
from pathlib import Path
from typing import Any

import click

from motion_transfer.errors import InputError, did_you_mean
from motion_transfer.option import Option, list_options, parse_path


class LocalPath(click.Path):
    """A path on this machine."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return parse_path(value)
        except InputError as error:
            self.fail(str(error), param, ctx)


FILE = LocalPath()
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


SECOND_WORDS = {
    "garments": ("PARTS", "Such as torso,upper-legs; `mt info parts` lists the names."),
    "partners": ("WHO", "Whose motion that is: an index from the left, or a box; as --person."),
}
"""What goes with each photo of an option that has two flags, and its help."""


class CommandGroup(click.Group):
    """A group that says which command a mistyped one may have been."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        known = self.list_commands(ctx)
        if args[0] not in known and not args[0].startswith("-") and not ctx.resilient_parsing:
            raise click.UsageError(f"no command {args[0]!r}{did_you_mean(args[0], known)}", ctx)
        return super().resolve_command(ctx, args)


class SectionOption(click.Option):
    """An option that knows under which heading it belongs."""

    def __init__(self, *arguments: Any, section: str = "Options", **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.section = section


def section(heading: str) -> Any:
    """Make an option decorator whose options stand under one heading."""
    return partial(click.option, cls=SectionOption, section=heading)


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


class SectionGroup(SectionCommand, CommandGroup):
    """A command with options under headings, below which other commands stand."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_options(ctx, formatter)
        self.format_commands(ctx, formatter)


class WordsCommand(SectionCommand):
    """A command whose repeatable options take several words at once; arguments come before them.

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
        option, used = "", False  # the repeatable one that is being read; whether it has a value
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


class WordsGroup(WordsCommand, SectionGroup):
    """The same as a command that others stand below."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args[:1] and args[0] in self.commands:  # whose words are its own to spread
            return SectionGroup.parse_args(self, ctx, args)
        return super().parse_args(ctx, args)


def events_option(heading: str = "Output") -> Decorator:
    """Make a decorator that adds `--json`, by which a program hears of failures as well."""

    def remember(context: click.Context, _parameter: click.Parameter, value: bool) -> bool:
        context.find_root().ensure_object(dict)["json"] = value
        return value

    # eager: what is wrong with the other options is said in the same way
    return section(heading)(
        *("--json", "as_json"),
        is_flag=True,
        is_eager=True,
        callback=remember,
        help="Print events as JSON lines (docs/pipelines.md).",
    )


def described_options(options_class: type, *, required: bool = True) -> Decorator:
    """Make a decorator that adds every described option of a dataclass.

    What was not written reaches the command as None (several words: as an empty tuple); a field's
    own default then holds, as `options_from_words` has it.

    Args:
        required: Whether an option without a default has to be given; a manifest may say it.
    """
    entries = list_options(options_class)
    adders = [_decorators(entry, required=required and entry.required) for entry in entries]
    return add_options(list(chain(*adders)))


def add_options(adders: list[Decorator]) -> Decorator:
    """Make a decorator that adds options, in order."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        return reduce(lambda made, add: add(made), reversed(adders), command)

    return decorate


def _decorators(entry: Option, *, required: bool) -> list[Decorator]:
    common: dict[str, Any] = {"cls": SectionOption, "section": entry.section, "help": entry.help}
    if entry.kind in SECOND_WORDS:
        photo, second = entry.flags
        metavar, names = SECOND_WORDS[entry.kind]
        return [
            click.option(photo, entry.name, multiple=True, metavar="PHOTO[,IUV]", **common),
            click.option(second, multiple=True, metavar=metavar, **{**common, "help": names}),
        ]
    if entry.kind == "flag":
        common |= {"is_flag": True, "default": None}
    elif entry.kind == "switch":
        common["default"] = None
    else:
        numbers = {"integer": int, "number": float}
        common |= {"type": numbers.get(entry.kind, str), "metavar": entry.metavar}
        common |= {"required": required, "multiple": entry.kind in ("paths", "words")}
    return [click.option(*entry.flags, entry.name, **common)]


def pair_words(
    photos: tuple[str, ...], words: tuple[str, ...], option: str, name: str
) -> list[dict[str, str]]:
    """Match `PHOTO[,IUV]` with what goes with each, by order, as a manifest would have them.

    Args:
        option: The flag of the photos without dashes; the other's is `option-name`.
    Raises: InputError if one has no partner.
    """
    if len(photos) != len(words):
        raise InputError(
            f"{len(photos)} --{option} but {len(words)} --{option}-{name}; give one for each"
        )
    return [
        dict(zip(("photo", "iuv"), photo.split(",", 1), strict=False)) | {name: word}
        for photo, word in zip(photos, words, strict=True)
    ]
