"""Structured text: one value and one line for each place, whatever language says it."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from motion_transfer.errors import InputError
from motion_transfer.media.structured import (
    DEEPEST,
    LARGEST_BYTES,
    parse_structured,
    read_structured,
    shown,
)

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**17), 10**17) | st.text("ab é7:#-'", max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("abc", max_size=3), inner),
    max_leaves=12,
)


def read(text: str, suffix: str = ".yaml") -> Any:
    return parse_structured(text, suffix, "x").data


def refusal(text: str | bytes, folder: Path, suffix: str = ".yaml") -> str:
    path = folder / f"m{suffix}"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    began = time.process_time()
    with pytest.raises(InputError) as caught:
        read_structured(path, "manifest")
    assert time.process_time() - began < 2
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message.replace(str(folder), "FOLDER")


@given(PLAIN)
def test_what_was_written_is_read(value: Any) -> None:
    assert read(json.dumps(value), ".json") == value
    assert read(yaml.safe_dump(value)) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("10:50", "10:50"),  # 650 to YAML 1.1
        ("010", "010"),
        ("1_000", "1_000"),
        ("1e3", 1000.0),
        ("-.5", -0.5),
        ("0x10", "0x10"),
        (".nan", ".nan"),
        ("No", False),
        ("'no'", "no"),
        ("~", None),
        ("a: &x [1, 2]\nb: *x", {"a": [1, 2], "b": [1, 2]}),
        ("a: &x {c: 1, d: 2}\nb: {<<: *x, d: 3}", {"a": {"c": 1, "d": 2}, "b": {"c": 1, "d": 3}}),
        (
            "a: &x {c: 1}\nb: &y {c: 2, d: 2}\nz: {<<: [*x, *y]}",
            {"a": {"c": 1}, "b": {"c": 2, "d": 2}, "z": {"c": 1, "d": 2}},
        ),
        ("yes: 1\n7: 2\n", {"yes": 1, "7": 2}),
        ("a: 1\r\nb: 2\r\n", {"a": 1, "b": 2}),
        ("a: !!str 5", {"a": "5"}),
        ("", None),
    ],
)
def test_what_yaml_means(text: str, value: Any) -> None:
    assert read(text) == value


def test_dates_of_toml_are_text() -> None:
    assert read("a = 2020-01-02\nb.c = [1, {d = 2.5}]", ".toml") == {
        "a": "2020-01-02",
        "b": {"c": [1, {"d": 2.5}]},
    }


LINED = {
    ".yaml": "version: 1\njobs:\n  - output: a\n  -\n    output: b\n    parts:\n      - x\n",
    ".json": '{"version": 1,\n"jobs":\n[{"output": "\\ud83d\\ude00"},\n\n{"output": "b",\n'
    '"parts":\n["x"]}]}',
    ".toml": 'version = 1\n\n[[jobs]] # one\noutput = "a"\n[[jobs]]\noutput = "b"\nparts = ["x"]\n',
}
LINES = {".yaml": (2, 3, 5, 7, 6), ".json": (2, 3, 5, 7, 6), ".toml": (None, 4, 6, 7, 7)}


@pytest.mark.parametrize("suffix", LINED)
def test_every_place_has_its_line(suffix: str) -> None:
    text = parse_structured(LINED[suffix], suffix, "x")
    places = [("jobs",), ("jobs", 0, "output"), ("jobs", 1, "output")]
    places += [("jobs", 1, "parts", 0), ("jobs", 1, "parts")]
    assert tuple(text.line(place) for place in places) == LINES[suffix]
    assert text.line(("jobs", 1, "output", "beyond")) == LINES[suffix][2]
    assert text.line(("nothing",)) is None


LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 10)
)
CHAIN = "- &a0 [x]\n" + "".join(f"- &a{k} [*a{k - 1}]\n" for k in range(1, DEEPEST + 1))
LEVELS = f"lists and mappings lie in each other more than {DEEPEST} deep"

REFUSED = {
    "laughs": (LAUGHS, ".yaml", "m.yaml:7: more than 2,000,000 values"),
    "lists": ("[" * 50000, ".yaml", f"m.yaml:1: {LEVELS}"),
    "maps": ("{a: " * 15000, ".yaml", f"m.yaml:1: {LEVELS}"),
    "indents": ("- " * 5000, ".yaml", f"m.yaml:1: {LEVELS}"),
    "chain": (CHAIN, ".yaml", LEVELS),
    "json lists": ("[" * 60000, ".json", f"m.json:1: {LEVELS}"),
    "json maps": ('\n{"a":' * 60000, ".json", f"m.json:{DEEPEST + 2}: {LEVELS}"),
    "toml lists": ("a = " + "[" * 20000, ".toml", "m.toml: lists and tables lie in each other"),
    "toml key": ("v = 1\na" + ".a" * 20000 + " = 1", ".toml", "m.toml:2: a key of more than"),
    "toml tables": (f"a = {'[' * 70}{']' * 70}", ".toml", f"m.toml:1: {LEVELS}"),
    "twice": ("v: 1\njobs: []\nv: 2\n", ".yaml", "m.yaml:3: v stands here, and in line 1, too"),
    "twice in one": ("a: [{b: 1,\n b: 2}]", ".yaml", "m.yaml:2: b stands here, and in line 1, too"),
    "json twice": ('{"v": 1,\n"v": 1}', ".json", "m.json:2: v stands here, and in line 1, too"),
    "toml twice": ("v = 1\nv = 1\n", ".toml", "m.toml: Cannot overwrite a value (at line 2"),
    "cycle": ("a: &a [*a]", ".yaml", "m.yaml:1: *a stands for nothing that was said"),
    "unknown": ("a: *a", ".yaml", "m.yaml:1: *a stands for nothing that was said"),
    "python": ("a: !!python/name:os.system x", ".yaml", "m.yaml:1: the tag 'tag:yaml.org,2002:pyt"),
    "binary": ("a: !!binary abc", ".yaml", "m.yaml:1: the tag 'tag:yaml.org,2002:binary' means"),
    "set": ("a: !!set {b}", ".yaml", "m.yaml:1: the tag 'tag:yaml.org,2002:set' means nothing"),
    "date": ("a: 2020-99-99", ".yaml", "m.yaml:1: 2020-99-99 is a date to YAML"),
    "merge": ("a: {<<: 3}", ".yaml", "m.yaml:1: << takes a mapping or a list of them"),
    "key": ("v: 1\n? [a]\n: x", ".yaml", "m.yaml:2: a key has to be a word or a number"),
    "documents": ("a: 1\n---\nb: 1\n", ".yaml", "m.yaml:2: a second document begins here"),
    "nul": ("a: s\0", ".yaml", "m.yaml: unacceptable character"),
    "escaped nul": ('v: 1\na: "s\\0"', ".yaml", "m.yaml:2: 's\\x00' holds a character that no"),
    "json nul": ('{"a":\n"\\u0000"}', ".json", "m.json:2: '\\x00' holds a character that no"),
    "surrogate": ('["\\ud800"]', ".json", "m.json:1: '\\ud800' holds a character that no name"),
    "toml nul": ('a = "\\u0000"', ".toml", "m.toml:1: '\\x00' holds a character that no name"),
    "digits": ("a: 1\nv: " + "9" * 5000, ".yaml", "m.yaml:2: '999999999"),
    "json digits": (f"[\n{'9' * 5000}]", ".json", "m.json:2: '9999999"),
    "toml digits": (f"a = {'9' * 5000}", ".toml", "m.toml: a whole number here has more digits"),
    "toml integer": (f"a = 1\nb = {10**400}", ".toml", "m.toml:2: '1000000000"),
    "infinite": ("[1e400]", ".json", "m.json:1: '1e400' is no number that can be used"),
    "nan": ("[NaN]", ".json", "m.json:1: 'NaN' is no number that can be used"),
    "toml nan": ("a = nan", ".toml", "m.toml:"),
    "tab": ("a:\n\t- 1", ".yaml", "m.yaml:2: found character that cannot start any token"),
    "odd key": ('{"a\\nb": 1, "a\\nb": 2}', ".json", r"m.json:1: 'a\nb' stands here"),
    "comma": ('{"a": 1,}', ".json", "m.json:1: Expecting property name enclosed in double"),
    "utf-16": ("a: é".encode("utf-16"), ".yaml", "m.yaml:1: manifest is not text in UTF-8"),
    "latin-1": ("v: 1\na: é".encode("latin-1"), ".yaml", "m.yaml:2: manifest is not text in UTF-8"),
    "large": (b" " * (LARGEST_BYTES + 1), ".json", "manifest FOLDER/m.json is larger than 16 MiB"),
    "ending": ("", ".ini", "m.ini: unknown ending; supported are .yaml"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_meant_is_one_line(case: str, tmp_path: Path) -> None:
    text, suffix, words = REFUSED[case]
    assert words in refusal(text, tmp_path, suffix)


def test_a_mark_at_the_beginning_is_no_content(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(b"\xef\xbb\xbf[1]")
    assert read_structured(path, "manifest").data == [1]


def test_pipes_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(InputError, match="is a device or a pipe"):
        read_structured(tmp_path / "a.json", "manifest")


def test_what_is_long_is_shown_in_part() -> None:
    assert shown("a\nb") == r"'a\nb'"
    assert shown("x" * 1000) == "'" + "x" * 56 + "..."


def test_a_long_word_of_toml_takes_no_longer_than_others() -> None:
    began = time.perf_counter()
    with pytest.raises(InputError, match="x"):
        parse_structured("[a]\n" + "9" * 200_000 + "\n", ".toml", "x")
    assert time.perf_counter() - began < 5  # the square of its length took minutes
