"""Structured text that people write: YAML, TOML and JSON, read into plain values with their lines.

Such a file is small and says each thing once, so whatever a reader could choke on is refused with
its line: more bytes, levels or values than any use of it has, aliases that stand for billions of
values, numbers that no machine holds, a key that stands there twice. What is built here is built
without recursion, as libyaml's own composer ends the process where lists lie 50,000 deep.
"""

from __future__ import annotations

import json
import math
import re
import sys
import tomllib
from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from motion_transfer.errors import InputError
from motion_transfer.media.files import check_readable, read_bytes

SUFFIXES = (".yaml", ".yml", ".json", ".toml")
LARGEST_BYTES = 16 * 2**20  # a hundred thousand jobs
DEEPEST = 64  # levels; what is written here has five
MOST_VALUES = 2_000_000  # an alias counts as all that it stands for
LONGEST_INTEGER = 18  # digits: all such numbers have room in 64 bits
LONGEST_SHOWN = 60  # characters of what a message repeats

Place = tuple[int | str, ...]
"""Where a value stands, such as `("jobs", 0, "output")`."""

_Parser = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml's: five times as fast
_UNUSABLE = re.compile("[\0\ud800-\udfff]")  # no name of a file, and no text in UTF-8, holds these
_NUMBER = re.compile(r"[-+]?((0|[1-9][0-9]*)(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
_DATE = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}([Tt \t].*)?")
_YAML_TAG = "tag:yaml.org,2002:"
MERGE = object()
"""The key that lays another mapping under one, written <<."""

_END = object()
_MEANINGS = {None: ("", "~", "null"), True: ("true", "yes", "on"), False: ("false", "no", "off")}
_WORDS = {
    form: meaning
    for meaning, words in _MEANINGS.items()
    for word in words
    for form in (word, word.title(), word.upper())
}
"""What YAML 1.1 means by words without quotes."""

_JSON_TOKEN = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"|[\[\]{}]|[^\s,:\[\]{}"]+|\n')
# from the beginning of a word, and never back: else a long word takes the square of its length
_TOML_DOTS = re.compile(rf"(?<![\w\"'-])[\w\"'-]++(?:[ \t]*+\.[ \t]*+[\w\"'-]++){{{DEEPEST}}}")
_TOML_HEADER = re.compile(r"\s*(\[\[?)([^\[\]]+)\]")
_TOML_KEY = re.compile(r"""\s*(["']?)([^"'\s=.]+)\1\s*[=.]""")


@dataclass(frozen=True)
class Structured:
    """What a text says: values as JSON has them, and the line, from 1, of each place."""

    data: Any
    lines: dict[Place, int]

    def line(self, place: Place) -> int | None:
        """Find the line on which a value stands, or else the nearest thing around it."""
        around = (place[:count] for count in range(len(place), 0, -1))
        return next((self.lines[each] for each in around if each in self.lines), None)


def read_structured(path: Path, what: str) -> Structured:
    """Read a file; its ending says in which of `SUFFIXES`' languages it is written.

    Args:
        what: What the file is wanted for, such as `manifest`, for messages.
    Raises: InputError naming file, line where possible, problem and remedy.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: unknown ending; supported are {', '.join(SUFFIXES)}")
    return parse_structured(read_text(path, what), suffix, str(path))


def read_text(path: Path, what: str) -> str:
    """Read a small text file of UTF-8, with or without a byte order mark. Raises: InputError."""
    check_readable(path, what)
    if path.stat().st_size > LARGEST_BYTES:
        raise InputError(f"{what} {path} is larger than {LARGEST_BYTES >> 20} MiB; split it")
    return _decode(read_bytes(path, what), what, str(path))


def read_stdin(what: str) -> str:
    """Read a small text from standard input, as `read_text` from a file. Raises: InputError."""
    data = sys.stdin.buffer.read(LARGEST_BYTES + 1)
    if len(data) > LARGEST_BYTES:
        raise InputError(
            f"{what} on standard input is larger than {LARGEST_BYTES >> 20} MiB; split it"
        )
    if not data.strip():
        raise InputError(f"{what}: nothing came on standard input")
    return _decode(data, what, "standard input")


def _decode(data: bytes, what: str, where: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{where}:{line}: {what} is not text in UTF-8; save it as that") from None


def parse_structured(text: str, suffix: str, where: str) -> Structured:
    """Read a text, see `read_structured`.

    Args:
        where: Names the text, for messages.
    """
    builder = _Builder()
    feed = {".json": _feed_json, ".toml": _feed_toml}.get(suffix, _feed_yaml)
    try:
        feed(text, builder)
    except _FlawError as flaw:
        line = flaw.line or builder.line
        raise InputError(f"{where}{f':{line}' if line else ''}: {flaw}") from None
    return Structured(builder.data, builder.lines)


def parse_json(text: str, where: str) -> Any:
    """Read JSON. Raises: InputError beginning with `where`, see `parse_structured`."""
    return parse_structured(text, ".json", where).data


def shown(value: Any) -> str:
    """Repeat a value in a message: on one line, and not the whole of a long one."""
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."


def shown_name(name: str) -> str:
    """Repeat a key in a message: as it is, or as `shown` does where that is not one short word."""
    return name if name.isidentifier() and len(name) <= LONGEST_SHOWN else shown(name)


class _FlawError(Exception):
    """What is wrong, and the line if it is not the one that is being read."""

    def __init__(self, reason: str, line: int | None = None) -> None:
        super().__init__(reason)
        self.line = line


class _Known(NamedTuple):
    """A finished value, how many values it is, and how many levels."""

    value: Any
    size: int
    height: int


@dataclass(slots=True)
class _Open:
    """A mapping or list that is being filled.

    Attributes:
        began: How many values there were before it.
        key: What was read of a mapping, and waits for its value.
        height: Levels below it.
        merged: What `<<` lays under its own keys.
    """

    value: Any
    place: Place
    anchor: str | None
    began: int
    key: Any = None
    height: int = 0
    merged: list[dict[str, Any]] = field(default_factory=list)

    @property
    def is_mapping(self) -> bool:
        return isinstance(self.value, dict)


class _Builder:
    """Puts a value together from its parts, which come in the order of the text.

    Attributes:
        line: The one that is being read, for messages; set by whoever brings the parts.
    """

    def __init__(self) -> None:
        self.data: Any = None
        self.lines: dict[Place, int] = {}
        self.line: int | None = None
        self._count = 0
        self._open: list[_Open] = []
        self._anchors: dict[str, _Known] = {}

    def begin(self, value: dict[str, Any] | list[Any], anchor: str | None = None) -> None:
        """Begin a mapping or a list."""
        if anchor:
            self._anchors.pop(anchor, None)  # until it ends: nothing may hold itself
        place = self._next_place(size=1, height=1)
        self._open.append(_Open(value, place, anchor, self._count - 1))

    def end(self) -> None:
        """End the mapping or list that was begun last."""
        done = self._open.pop()
        if done.merged:
            under = {key: value for each in reversed(done.merged) for key, value in each.items()}
            done.value = {**under, **done.value}
        self._put(_Known(done.value, self._count - done.began, done.height + 1), done.anchor)

    def scalar(self, written: str | object, value: Any, anchor: str | None = None) -> None:
        """Add a key, which is what was written, or a value."""
        if self.wants_key:
            self.key(written)
            return
        self._next_place(size=1, height=0)
        self._put(_Known(value, 1, 0), anchor)

    def alias(self, anchor: str) -> None:
        """Add what was said before."""
        known = self._anchors.get(anchor)
        if known is None:
            raise _FlawError(f"*{anchor} stands for nothing that was said, as a whole, before it")
        self._next_place(size=known.size, height=known.height)
        self._put(known, None)

    @property
    def wants_key(self) -> bool:
        """Whether a mapping waits for its next key."""
        return bool(self._open) and self._open[-1].key is None and self._open[-1].is_mapping

    def key(self, key: str | object) -> None:
        """Say what the next value of a mapping is called; `MERGE` lays it under the others."""
        around = self._open[-1]
        place = (*around.place, str(key))
        if key in around.value:
            before = self.lines.get(place)
            also = f"in line {before}" if before else "twice"
            raise _FlawError(
                f"{shown_name(str(key))} stands here, and {also}, too; keep one of them"
            )
        around.key = key
        self._note_line(place)

    def _next_place(self, *, size: int, height: int) -> Place:
        """Tell the place of the next value, and see that it is not too much.

        Args:
            size: How many values it is; `height`: how many levels.
        """
        self._count += size
        if self._count > MOST_VALUES:
            raise _FlawError(f"more than {MOST_VALUES:,} values, aliases spelt out; split it")
        if len(self._open) + height > DEEPEST:
            raise _FlawError(f"lists and mappings lie in each other more than {DEEPEST} deep")
        if not self._open:
            return ()
        if self.wants_key:
            raise _FlawError("a key has to be a word or a number")
        around = self._open[-1]
        if around.is_mapping:
            return (*around.place, str(around.key))
        place = (*around.place, len(around.value))
        self._note_line(place)
        return place

    def _note_line(self, place: Place) -> None:
        if self.line is not None:
            self.lines[place] = self.line

    def _put(self, known: _Known, anchor: str | None) -> None:
        """Put a finished value where it belongs."""
        if anchor:
            self._anchors[anchor] = known
        if not self._open:
            self.data = known.value
            return
        around = self._open[-1]
        around.height = max(around.height, known.height)
        if not around.is_mapping:
            around.value.append(known.value)
        elif around.key is MERGE:
            several = known.value if isinstance(known.value, list) else [known.value]
            if around.merged or not all(isinstance(each, dict) for each in several):
                raise _FlawError("<< takes a mapping or a list of them, once")
            around.merged = several
        else:
            around.value[around.key] = known.value
        around.key = None


def _feed_yaml(text: str, builder: _Builder) -> None:
    documents = 0
    event: Any
    try:
        for event in yaml.parse(text, Loader=_Parser):
            builder.line = event.start_mark.line + 1
            match event:
                case yaml.ScalarEvent():
                    plain = event.implicit[0]  # neither quotes nor a tag
                    _check_tag(event.tag, "str")
                    value = _read_word(event.value) if plain else _check_text(event.value)
                    key = MERGE if plain and event.value == "<<" else event.value
                    builder.scalar(key, value, event.anchor)
                case yaml.MappingStartEvent():
                    _check_tag(event.tag, "map")
                    builder.begin({}, event.anchor)
                case yaml.SequenceStartEvent():
                    _check_tag(event.tag, "seq")
                    builder.begin([], event.anchor)
                case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                    builder.end()
                case yaml.AliasEvent(anchor=str(anchor)):
                    builder.alias(anchor)
                case yaml.DocumentStartEvent():
                    documents += 1
                    if documents > 1:
                        raise _FlawError("a second document begins here; keep one in a file")
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise _FlawError(reason, mark.line + 1 if mark else None) from None


def _check_tag(tag: str | None, usual: str) -> None:
    if tag not in (None, "!", f"{_YAML_TAG}{usual}"):
        raise _FlawError(f"the tag {shown(tag)} means nothing here; leave it out")


def _feed_json(text: str, builder: _Builder) -> None:
    try:  # the grammar; numbers are read below, where their lines are known
        json.loads(text, parse_int=str, parse_float=str, parse_constant=str)
    except json.JSONDecodeError as error:
        raise _FlawError(f"{error.msg} (column {error.colno})", error.lineno) from None
    except RecursionError:
        pass  # what is too deep is found below
    builder.line = 1
    for match in _JSON_TOKEN.finditer(text):
        token = match.group()
        if token == "\n":
            builder.line += 1
        elif token in "{[":
            builder.begin({} if token == "{" else [])
        elif token in "}]":
            builder.end()
        elif token[0] == '"':
            value = _check_text(json.loads(token) if "\\" in token else token[1:-1])
            builder.scalar(value, value)
        else:
            words = {"null": None, "true": True, "false": False}
            builder.scalar(token, words[token] if token in words else _read_number(token))


def _feed_toml(text: str, builder: _Builder) -> None:
    # the parser's time grows with the square of a dotted key's length
    if found := _TOML_DOTS.search(text):
        builder.line = text.count("\n", 0, found.start()) + 1
        raise _FlawError(f"a key of more than {DEEPEST} parts")
    try:
        data = tomllib.loads(text, parse_float=_read_number)
    except tomllib.TOMLDecodeError as error:
        raise _FlawError(str(error)) from None
    except RecursionError:
        raise _FlawError(f"lists and tables lie in each other more than {DEEPEST} deep") from None
    except ValueError:  # of int(), which reads no more than 4300 digits
        raise _FlawError("a whole number here has more digits than any that is meant") from None
    lines = _toml_lines(text)
    waiting: list[tuple[Place, Any]] = [((), data)]
    while waiting:
        place, value = waiting.pop()
        builder.line = lines.get(place, builder.line)
        if value is _END:
            builder.end()
            continue
        if place and builder.wants_key:
            builder.key(place[-1])
        if isinstance(value, dict | list):
            builder.begin({} if isinstance(value, dict) else [])
            items = value.items() if isinstance(value, dict) else enumerate(value)
            inside = [((*place, step), item) for step, item in items]
            waiting += [(place, _END), *reversed(inside)]
        else:
            builder.scalar("", _check_plain(value))
    builder.lines = lines


def _toml_lines(text: str) -> dict[Place, int]:
    """Find the lines of keys and headers, as Python's parser of TOML tells none."""
    lines: dict[Place, int] = {}
    counts: Counter[Place] = Counter()
    table: Place = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _TOML_HEADER.match(line):
            table = tuple(name.strip().strip("\"'") for name in header[2].split("."))
            if header[1] == "[[":
                counts[table] += 1
                table = (*table, counts[table] - 1)
            lines.setdefault(table, number)
        elif key := _TOML_KEY.match(line):
            lines.setdefault((*table, key[2]), number)
    return lines


def _check_plain(value: Any) -> Any:
    """Check a value of TOML's; dates become what was written."""
    if isinstance(value, int | float):
        return value if isinstance(value, bool) else _read_number(str(value))
    return _check_text(str(value))


def _check_text(text: str) -> str:
    if _UNUSABLE.search(text):
        raise _FlawError(f"{shown(text)} holds a character that no name or text can have")
    return text


@lru_cache(maxsize=4096)  # the same few words stand in thousands of jobs
def _read_word(word: str) -> Any:
    """Read a word without quotes, as YAML 1.2 does, but for yes, no, on and off.

    What only YAML 1.1 takes for a number is a text: 10:50 is no 650, and 010 no 8.
    """
    if word in _WORDS:
        return _WORDS[word]
    if _DATE.fullmatch(word):
        raise _FlawError(f"{word} is a date to YAML, and none is meant here; put it in quotes")
    return _read_number(word) if _NUMBER.fullmatch(word) else _check_text(word)


def _read_number(written: str) -> int | float:
    digits = written.lstrip("+-")
    whole = digits.isdecimal()
    if whole and len(digits) <= LONGEST_INTEGER:  # int() takes no more than 4300
        return int(written)
    value = float(written)
    if whole or not math.isfinite(value):
        raise _FlawError(f"{shown(written)} is no number that can be used; none is that large")
    return value
