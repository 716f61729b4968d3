"""A study of two methods, and readers who answer it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motion_transfer.evaluation.study.answers import ANSWERS_FORMAT, Reader, digest_answers
from motion_transfer.evaluation.study.key import Comparison, Key

Choose = Callable[[str, str], str]
"""Which label is chosen, for a question and an item."""


@pytest.fixture
def key() -> Key:
    """Four items of `ours` and `theirs`; `ours` is `a` in two of them."""
    comparisons = {
        f"c{number}": Comparison(
            item=f"item {number}",
            a="ours" if number % 2 else "theirs",
            b="theirs" if number % 2 else "ours",
        )
        for number in range(4)
    }
    return Key(
        study="0123456789abcdef",
        pairs=[["ours", "theirs"]],
        questions=["realism", "identity"],
        asked=4,
        repeats=1,
        comparisons=comparisons,
        files={},
    )


@pytest.fixture
def answer(key: Key) -> Callable[..., dict[str, Any]]:
    """Make what the page would save for a reader who chooses by label."""

    def make(
        choose: Choose, number: int = 0, *, again: Choose | None = None, **changes: Any
    ) -> dict[str, Any]:
        answers = []
        for name, repeat in (*((name, False) for name in key.comparisons), ("c0", True)):
            comparison = key.comparisons[name]
            left = "b" if repeat else "a"
            left_label = comparison.b if repeat else comparison.a
            ask = again if repeat and again else choose
            choices = {
                question: "left" if ask(question, comparison.item) == left_label else "right"
                for question in key.questions
            }
            answers.append(
                {"comparison": name, "left": left, "repeat": repeat, "choices": choices, "ms": 2000}
            )
        content: dict[str, Any] = {
            "format": ANSWERS_FORMAT,
            "study": key.study,
            "reader": f"{number:016x}",
            "name": "",
            "statement": "I looked.",
            "began": "2026-01-01T00:00:00.000Z",
            "signed": f"2026-01-01T01:00:0{number}.000Z",
            "screen": "1280x800",
            "questions": key.questions,
            "answers": answers,
        }
        content |= changes
        return {**content, "digest": digest_answers(content)}

    return make


@pytest.fixture
def reader(answer: Callable[..., dict[str, Any]]) -> Callable[..., Reader]:
    """The same, as it is read."""
    return lambda *words, **changes: Reader.model_validate(answer(*words, **changes))
