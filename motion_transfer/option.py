"""How an option is described once: for the command line, manifests, settings files and the API.

A dataclass whose fields are made by `option` describes itself. The command line's flags and help
(`motion_transfer.cli.options`), a manifest's fields and its JSON Schema
(`motion_transfer.batch.manifest`) and the keys of a training run
(`motion_transfer.training.config`) all follow from those descriptions. This module is light, so
that help is instant.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from fractions import Fraction
from functools import cache
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal, TypeVar

from motion_transfer.errors import InputError

Kind = Literal[
    "path",
    "paths",
    "text",
    "words",
    "integer",
    "number",
    "rate",
    "frames",
    "flag",
    "switch",
    "garments",
    "partners",
    "background",
]
Options = TypeVar("Options")

LONGEST_SHOWN = 60  # characters of what a message repeats
LONGEST_NUMBER = 60  # characters: more digits than any machine works with

LONGEST_RATE_TERM = 2**31 - 1
"""FFmpeg's fractions (AVRational) hold no larger numerator or denominator."""

RATE_DENOMINATOR = 100_000
"""A decimal fraction with a longer term is replaced by the nearest one up to this denominator: the
shortest that still tells 30000/1001 from its neighbours."""


@dataclass(frozen=True)
class Option:
    """One option, as a field of a dataclass describes it.

    Attributes:
        name: The field.
        flags: On the command line. The first long one, without dashes, is its word in a manifest.
        section: The heading under which help lists it.
        kind: What is written. A `switch` is yes, no or undecided, a `flag` is off unless it is
            given, `paths` and `words` may be given several times.
        choices: Every allowed value, where there are few.
        metavar: What help shows in the value's place.
        in_manifest: Whether a job of a manifest may set it.
        parse: Turns what was written into the field's value; raises InputError.
    """

    name: str
    flags: tuple[str, ...]
    section: str
    help: str
    kind: Kind
    default: Any
    required: bool
    choices: tuple[str, ...]
    metavar: str | None
    in_manifest: bool
    parse: Callable[[Any], Any]

    @property
    def word(self) -> str:
        """The option's name in a manifest, such as `source_iuv`."""
        if self.kind in ("garments", "partners"):
            return self.name
        long = next(flag for flag in self.flags if flag.startswith("--"))
        return long.split("/")[0].removeprefix("--").replace("-", "_")

    def read(self, written: Any) -> Any:
        """The field's value for what was written, None for nothing. Raises: InputError."""
        several = written if isinstance(written, list | tuple) else [written]
        if self.kind in ("path", "paths") and "" in several:
            raise InputError(f"{self.word.replace('_', ' ')}: {EMPTY_PATH}")
        return self.default if written is None else self.parse(written)


REQUIRED: Any = object()
"""The default of an option that has to be given."""


def option(
    flags: str,
    section: str,
    help: str,
    *,
    kind: Kind = "text",
    default: Any = None,
    choices: tuple[str, ...] = (),
    metavar: str | None = None,
    in_manifest: bool = True,
    parse: Callable[[Any], Any] | None = None,
) -> Any:
    """Make a dataclass field that carries its description.

    Args:
        flags: Separated by blanks, such as `-o --output`.
        parse: Replaces what the kind does with a written value, see `PARSERS`.
    """
    words = {
        "flags": tuple(flags.split()),
        "section": section,
        "help": help,
        "kind": kind,
        "default": None if default is REQUIRED else default,
        "required": default is REQUIRED,
        "choices": choices,
        "metavar": metavar or "|".join(choices) or ("PATH" if kind == "path" else None),
        "in_manifest": in_manifest,
        "parse": parse or PARSERS.get(kind, _unchanged),
    }
    if default is REQUIRED:
        return field(metadata=words)
    return field(default=default, metadata=words)


@cache
def list_options(options_class: type) -> tuple[Option, ...]:
    """List the described fields of a dataclass; other fields are left out.

    They come in their order, or by section where the class has an order of `SECTIONS`.
    """
    described = [entry for entry in fields(options_class) if "flags" in entry.metadata]
    entries = [Option(name=entry.name, **entry.metadata) for entry in described]
    sections = getattr(options_class, "SECTIONS", ())
    if sections:
        entries.sort(key=lambda entry: sections.index(entry.section))
    return tuple(entries)


def options_from_words(options_class: type[Options], words: Mapping[str, Any]) -> Options:
    """Build options from what was written, by field name.

    Raises: InputError for a value that is none of its option's.
    """
    entries = {entry.name: entry for entry in list_options(options_class)}
    return options_class(**{name: entries[name].read(value) for name, value in words.items()})


def part_of(options: Any, part: type[Options]) -> Options:
    """Take some options out of many: those that one of their base classes has.

    Two runs whose parts are equal share whatever is made from that part alone.
    """
    return part(**{entry.name: getattr(options, entry.name) for entry in fields(part)})  # type: ignore[arg-type]


def check_choices(options: Any) -> None:
    """Check that options with few values have one of them. Raises: InputError naming the values."""
    for entry in list_options(type(options)):
        value = getattr(options, entry.name)
        if entry.choices and value != entry.default and value not in entry.choices:
            listed = ", ".join(entry.choices)
            raise InputError(f"{entry.name} is {value!r}; supported are {listed}")


COLOURS = {"white": "#ffffff", "black": "#000000"}
SCENES = ("photo", "driver", "transparent")
"""Backgrounds that are words, and no colour."""


EMPTY_PATH = "a path is empty; name a file or a folder"
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*(::[^/]*)?://")


def is_url(text: object) -> bool:
    """Tell whether a path is a URL; a Windows drive and `people:walk` are none."""
    return _URL.match(str(text)) is not None


def parse_path(text: str | PathLike[str]) -> Path:
    """Read a path on this machine. Raises: InputError for a URL, and for nothing."""
    if is_url(text := fspath(text)):
        raise InputError(f"{text!r} is a URL; only `mt run` and `mt batch run` fetch those")
    return some_path(text)


def some_path(text: str) -> Path:
    """Take a path, or a URL that is fetched later. Raises: InputError for nothing."""
    if not text:  # which would be the folder where we are
        raise InputError(EMPTY_PATH)
    return Path(text)


def parse_colour(text: str) -> tuple[int, int, int] | None:
    """Read the RGB of `white`, `black` or `#rrggbb`; None for `photo`. Raises: InputError."""
    if text == "photo":
        return None
    try:
        return _read_colour(text)
    except ValueError:
        raise InputError(
            f"background {text!r}; supported are white, black, photo and #rrggbb"
        ) from None


def parse_background(text: str) -> tuple[int, int, int] | str | Path:
    """Read a background: the RGB of a colour, a word of `SCENES`, or else a file.

    Raises: InputError for a colour that is none.
    """
    if text in SCENES:
        return text
    try:
        return _read_colour(text)
    except ValueError:
        if text.startswith("#") or not text:
            raise InputError(
                f"background {text[:LONGEST_SHOWN]!r}; write a colour as #rrggbb, white, black,"
                f" {', '.join(SCENES)}, or name a picture or a video"
            ) from None
    return parse_path(text)


def _read_colour(text: str) -> tuple[int, int, int]:
    code = COLOURS.get(text, text)
    if len(code) != 7 or code[0] != "#":
        raise ValueError(text)
    red, green, blue = bytes.fromhex(code[1:])
    return red, green, blue


def parse_range(text: str, what: str) -> tuple[int | None, int | None]:
    """Read `10:50`, `10:`, `:50` or `12` as a half-open range that counts from 0.

    Args:
        what: Names what is counted, for messages.
    Raises: InputError.
    """
    try:
        if ":" not in text:
            return read_whole(text), read_whole(text) + 1
        start, stop = text.split(":")
        ends = read_whole(start) if start else None, read_whole(stop) if stop else None
    except ValueError:
        raise InputError(
            f"{what} {text[:LONGEST_SHOWN]!r}; write START:STOP, such as 10:50, 10: or :50"
        ) from None
    if any(end is not None and end < 0 for end in ends):
        raise InputError(f"{what} {text!r}; {what} count from 0 and never from the end")
    return ends


def parse_frames(text: str | int) -> tuple[int | None, int | None]:
    """Read a half-open range of frames, see `parse_range`. Raises: InputError."""
    return parse_range(str(text), "frames")


def frame_range(frames: tuple[int | None, int | None], count: int, where: str) -> range:
    """Tell the frames of a clip that are asked for. Raises: InputError if it lacks some of them."""
    start, stop = frames[0] or 0, count if frames[1] is None else frames[1]
    if not 0 <= start < stop <= count:
        raise InputError(
            f"frames {start}:{stop} asked for, but {where} has {count}: 0:{count} at most"
        )
    return range(start, stop)


def parse_rate(text: str | float) -> Fraction:
    """Read a rate in frames per second: `25`, `29.97` or `30000/1001`. Raises: InputError."""
    try:
        rate = read_fraction(str(text))
    except (ValueError, ZeroDivisionError):
        raise InputError(
            f"fps {str(text)[:LONGEST_SHOWN]!r}; write a number or a fraction, such as 30000/1001"
        ) from None
    if not 0 < rate <= 1000:
        raise InputError(f"fps {str(text)!r}; it must lie between 0 and 1000")
    if max(rate.numerator, rate.denominator) > LONGEST_RATE_TERM:
        rate = rate.limit_denominator(RATE_DENOMINATOR)  # 29.97002997002997 is 30000/1001
    if not rate:
        raise InputError(f"fps {str(text)!r}; it is too slow for a video")
    return rate


def parse_size(text: str) -> tuple[int, int]:
    """Read `384x512` as (width, height). Raises: InputError."""
    width, _, height = text.lower().partition("x")
    try:
        size = read_whole(width), read_whole(height)
    except ValueError:
        size = -1, -1
    if min(size) < 0:
        raise InputError(f"size {text[:LONGEST_SHOWN]!r}; write WIDTHxHEIGHT, such as 256x256")
    return size


def parse_number(written: str | float) -> float:
    """Read a number. Raises: InputError."""
    try:
        number = float(written)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{str(written)[:LONGEST_SHOWN]!r} is no number; write one, such as 1.5")
    return number


def read_whole(text: str) -> int:
    """Read a whole number as people write one: up to nine of our digits, and a sign.

    Raises: ValueError for anything else that int() takes, and for what it chokes on.
    """
    if not re.fullmatch("-?[0-9]{1,9}", text.strip()):
        raise ValueError(f"{text[:LONGEST_SHOWN]!r} is no whole number that can be used")
    return int(text)


def read_fraction(text: str) -> Fraction:
    """Read a number exactly, a decimal or a fraction.

    Raises: ValueError, ZeroDivisionError. `Fraction` would compute 1e999999999 for hours.
    """
    if len(text) > LONGEST_NUMBER or not all(
        1e-30 < abs(float(term)) < 1e30 or set(term) <= set("+-.0") for term in text.split("/")
    ):
        raise ValueError(f"{text[:LONGEST_SHOWN]!r} is no number that can be used")
    return Fraction(text)


def _unchanged(value: Any) -> Any:
    return value


def _paths(written: str | Sequence[str]) -> tuple[Path, ...]:
    return tuple(parse_path(text) for text in ([written] if isinstance(written, str) else written))


PARSERS: dict[str, Callable[[Any], Any]] = {
    "path": parse_path,
    "paths": _paths,
    "words": tuple,
    "number": parse_number,
    "rate": parse_rate,
    "frames": parse_frames,
}
"""What becomes of a written value, by its kind; other kinds are kept as they are written."""
