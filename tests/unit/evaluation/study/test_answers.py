"""Which answers are counted, and the one line for each that is not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.study.answers import (
    digest_answers,
    find_key,
    list_answers,
    read_all,
    read_answers,
)


def write(path: Path, content: Any, indent: int | None = 1) -> Path:
    path.write_text(json.dumps(content, indent=indent, ensure_ascii=False))
    return path


def signed_anew(content: dict[str, Any]) -> dict[str, Any]:
    return {**content, "digest": digest_answers(content)}


def test_what_the_page_saved_is_read(key, answer, tmp_path: Path) -> None:
    content = answer(lambda *_: "ours", name='Zoë "Z" \u2028 😀')
    for indent in (None, 1):
        assert (
            read_answers(write(tmp_path / "a.json", content, indent), key).label == content["name"]
        )


def test_a_change_is_noticed(key, answer, tmp_path: Path) -> None:
    content = answer(lambda *_: "ours")
    content["answers"][2]["choices"]["realism"] = "left"
    content["answers"][3]["choices"]["realism"] = "left"
    with pytest.raises(InputError, match="was changed after it was signed off"):
        read_answers(write(tmp_path / "a.json", content), key)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"study": "f" * 16}, "answers another study"),
        ({"format": "x"}, "holds no answers"),
        ({"reader": "../../etc"}, "is damaged: reader"),
        ({"extra": 1}, "is damaged: extra"),
        ({"questions": ["realism"]}, "names other questions"),
    ],
)
def test_answers_to_something_else(key, answer, tmp_path: Path, change: dict, words: str) -> None:
    content = signed_anew({**answer(lambda *_: "ours"), **change})
    with pytest.raises(InputError, match=words) as caught:
        read_answers(write(tmp_path / "a.json", content), key)
    assert len(caught.value.lines) == 1


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda answers: answers.pop(), "incomplete: 4 answers of 5"),
        (lambda answers: answers.append(answers[0]), "answers c0 twice"),
        (lambda answers: answers[1].update(comparison="x"), "which nobody was asked"),
        (lambda answers: answers[1]["choices"].pop("realism"), "not answer every question of c1"),
        (lambda answers: answers[1]["choices"].update(realism="up"), "is damaged: answers.1"),
        (lambda answers: answers[1].update(ms=-1), "is damaged: answers.1.ms"),
        (lambda answers: answers.pop(0), "repeats c0, which was not shown before"),
    ],
)
def test_answers_that_are_not_all(key, answer, tmp_path: Path, spoil: Any, words: str) -> None:
    content = answer(lambda *_: "ours")
    spoil(content["answers"])
    with pytest.raises(InputError, match=words):
        read_answers(write(tmp_path / "a.json", signed_anew(content)), key)


def test_of_one_reader_the_later_counts(key, answer, tmp_path: Path) -> None:
    late = write(tmp_path / "a.json", answer(lambda *_: "ours", 1, signed="2026-02-01"))
    early = write(tmp_path / "b.json", answer(lambda *_: "theirs", 1))
    other = write(tmp_path / "c.json", answer(lambda *_: "ours", 2))
    readers, problems = read_all([late, early, other], key)
    assert [reader.signed[:10] for reader in readers] == ["2026-02-01", "2026-01-01"]
    assert problems == [f"{early} is of the same reader as {late}; keep one of them"]


def test_where_answers_and_their_key_are_looked_for(tmp_path: Path) -> None:
    study = tmp_path / "study"
    (study / "answers").mkdir(parents=True)
    (study / "key.json").write_text("{}")
    with pytest.raises(InputError, match="holds no answers"):
        list_answers([study])
    file = write(study / "answers/a.json", {})
    assert list_answers([study]) == list_answers([file.parent]) == list_answers([file]) == [file]
    assert find_key(file) == study / "key.json"
    with pytest.raises(InputError, match="--key FILE"):
        find_key(tmp_path / "elsewhere/a/b.json")
