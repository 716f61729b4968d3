"""Readers' answers: files that the page wrote, each whole, of one study and of one reader."""

from __future__ import annotations

import json
import zlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from motion_transfer.errors import InputError
from motion_transfer.evaluation.study.key import (
    ANSWERS_FOLDER,
    KEY_FILE,
    Key,
    Side,
    Strict,
    View,
    read_form,
)
from motion_transfer.media.folders import list_files
from motion_transfer.media.structured import parse_json, read_text, shown

ANSWERS_FORMAT = "mt-study-answers-1"


class Answer(Strict):
    """What a reader said of one comparison.

    Attributes:
        left: The view that stood on the left (above, on a phone).
        repeat: Whether it was shown before, the other way round.
        choices: The side that was chosen, by question.
        ms: How long it took, in milliseconds.
    """

    comparison: str
    left: View
    repeat: bool
    choices: dict[str, Side]
    ms: Annotated[int, Field(ge=0)]

    def chosen(self, question: str) -> View:
        """The view that was chosen."""
        other: View = "b" if self.left == "a" else "a"
        return self.left if self.choices[question] == "left" else other


class Reader(Strict):
    """One reader's answers, signed off.

    Attributes:
        reader: A random name, from which the order of pairs and sides followed.
        name: What the reader wanted to be called; may be empty.
        questions: In the order in which they were asked.
        digest: Of all the rest, so that a slip in an editor or a damaged download is noticed.
    """

    format: Literal["mt-study-answers-1"]
    study: str
    reader: Annotated[str, Field(pattern="^[0-9a-f]{16}$")]
    name: str
    statement: str
    began: str
    signed: str
    screen: str
    questions: list[str]
    answers: list[Answer]
    digest: str

    @property
    def label(self) -> str:
        """What results call the reader."""
        return self.name or self.reader[:6]


def digest_answers(data: dict[str, object]) -> str:
    """Compute the CRC-32 of answers as the page wrote them, without their digest.

    It guards against accidents; no digest that a page computes could guard against more.
    """
    rest = {name: value for name, value in data.items() if name != "digest"}
    # as JavaScript's JSON.stringify has it
    text = json.dumps(rest, ensure_ascii=False, separators=(",", ":"))
    return f"{zlib.crc32(text.encode()):08x}"


def read_answers(path: Path, key: Key) -> Reader:
    """Read a reader's answers. Raises: InputError in one line if they cannot be counted."""
    reader = parse_answers(read_text(path, "answers"), str(path))
    check_answers(reader, key, str(path))
    return reader


def parse_answers(text: str, where: str) -> Reader:
    """Read what the page wrote. Raises: InputError if it is something else, or was changed."""
    data = parse_json(text, where)
    if not isinstance(data, dict) or data.get("format") != ANSWERS_FORMAT:
        raise InputError(f"{where} holds no answers to a study; ask for what the page saved")
    reader = read_form(Reader, data, f"{where} is damaged")
    if reader.digest != digest_answers(data):
        raise InputError(
            f"{where} was changed after it was signed off; ask the reader for it again"
        )
    return reader


def check_answers(reader: Reader, key: Key, where: str) -> None:
    """Refuse answers that are not all those to this study. Raises: InputError."""
    if reader.study != key.study:
        raise InputError(f"{where} answers another study ({shown(reader.study)}, not {key.study})")
    for answer in reader.answers:
        if answer.comparison not in key.comparisons:
            raise InputError(f"{where} answers {shown(answer.comparison)}, which nobody was asked")
        if set(answer.choices) != set(key.questions):
            raise InputError(f"{where} does not answer every question of {answer.comparison}")
    counts = Counter((answer.comparison, answer.repeat) for answer in reader.answers)
    if twice := next((name for (name, _), count in counts.items() if count > 1), None):
        raise InputError(f"{where} answers {twice} twice")
    if sorted(reader.questions) != sorted(key.questions):
        raise InputError(f"{where} names other questions than {' and '.join(key.questions)}")
    if again := next((name for name, repeat in counts if repeat and not counts[name, False]), None):
        raise InputError(f"{where} repeats {again}, which was not shown before")
    first = sum(not answer.repeat for answer in reader.answers)
    if (first, len(reader.answers) - first) != (key.asked, key.repeats):
        raise InputError(
            f"{where} is incomplete: {len(reader.answers)} answers of {key.asked + key.repeats}"
        )


def list_answers(paths: Sequence[Path]) -> list[Path]:
    """List the files that were named; a folder is all its JSON, a study's folder its `answers/`.

    Raises: InputError for a folder without any.
    """
    listed: list[Path] = []
    for path in paths:
        if not path.is_dir():
            listed.append(path)
            continue
        folder = path / ANSWERS_FOLDER if (path / KEY_FILE).is_file() else path
        found = (
            [file for file in list_files(folder) if file.suffix.lower() == ".json"]
            if (folder.is_dir())
            else []
        )
        if not found:
            raise InputError(f"{folder} holds no answers; put what readers sent there, or name it")
        listed += found
    return listed


def find_key(answers: Path) -> Path:
    """Find the key of a study in whose folder answers lie. Raises: InputError."""
    folders = answers.absolute().parents
    key = next((folder / KEY_FILE for folder in folders[:2] if (folder / KEY_FILE).is_file()), None)
    if key is None:
        raise InputError(f"no {KEY_FILE} lies above {answers}; name the study's with --key FILE")
    return key


def read_all(paths: Sequence[Path], key: Key) -> tuple[list[Reader], list[str]]:
    """Read all files; give those that count, and a line for each that does not.

    Of two files of one reader the one that was signed later counts.
    """
    readers: dict[str, tuple[Path, Reader]] = {}
    problems: list[str] = []
    for path in paths:
        try:
            reader = read_answers(path, key)
        except InputError as error:
            problems.append(str(error))
            continue
        before = readers.get(reader.reader)
        if before is None:
            readers[reader.reader] = path, reader
            continue
        (older, _), newer = sorted([before, (path, reader)], key=lambda each: each[1].signed)
        problems.append(f"{older} is of the same reader as {newer[0]}; keep one of them")
        readers[reader.reader] = newer
    return [reader for _, reader in readers.values()], problems
