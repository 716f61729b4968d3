"""A study's page served, and the answers that are taken."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="needs the `preview` extra")

from starlette.testclient import TestClient

from motion_transfer.evaluation.study.answers import ANSWERS_FORMAT, digest_answers, read_answers
from motion_transfer.evaluation.study.key import Comparison, Key
from motion_transfer.preview.local import Guard
from motion_transfer.preview.study import make_study_app

TOKEN = "secret"
KEY = Key(
    study="0123456789abcdef",
    pairs=[["x", "y"]],
    questions=["realism"],
    asked=1,
    repeats=0,
    comparisons={"c": Comparison(item="i", a="x", b="y")},
    files={},
)


@pytest.fixture
def client(tmp_path: Path) -> TestClient:
    (tmp_path / "page/media").mkdir(parents=True)
    (tmp_path / "page/index.html").write_text('<!doctype html>\n<html lang="en">')
    (tmp_path / "page/study.js").write_text("1")
    (tmp_path / "page/media/a.mp4").write_bytes(bytes(range(100)))
    (tmp_path / "key.json").write_text("which is which")
    app = Guard(make_study_app(tmp_path, KEY, TOKEN), TOKEN)
    return TestClient(app, base_url="http://127.0.0.1:8000", raise_server_exceptions=False)


def signed(side: str = "left", **changes: Any) -> dict[str, Any]:
    answer = {
        "comparison": "c",
        "left": "a",
        "repeat": False,
        "choices": {"realism": side},
        "ms": 1,
    }
    content = {
        "format": ANSWERS_FORMAT,
        "study": KEY.study,
        "reader": "0" * 16,
        "questions": ["realism"],
        "answers": [answer],
        **dict.fromkeys(("statement", "began", "signed", "screen"), ""),
        "name": "Zoë",
        **changes,
    }
    return {**content, "digest": digest_answers(content)}


def test_the_page_knows_that_answers_are_taken(client: TestClient) -> None:
    assert 'data-answers="answers"' in client.get(f"/{TOKEN}/").text
    assert client.get(f"/{TOKEN}/study.js").headers["content-type"].startswith("text/javascript")
    part = client.get(f"/{TOKEN}/media/a.mp4", headers={"range": "bytes=10-19"})
    assert (part.status_code, part.content) == (206, bytes(range(10, 20)))


@pytest.mark.parametrize(
    "path", ["key.json", "../key.json", "%2e%2e/key.json", "media", "answers/"]
)
def test_the_key_is_not_served(client: TestClient, path: str) -> None:
    answer = client.get(f"/{TOKEN}/{path}")
    assert answer.status_code in (404, 405)
    assert "which is which" not in answer.text


def test_answers_are_kept_once_for_each_reader(client: TestClient, tmp_path: Path) -> None:
    for side in ("left", "right"):
        assert client.post(f"/{TOKEN}/answers", json=signed(side)).status_code == 200
    (kept,) = (tmp_path / "answers").iterdir()
    reader = read_answers(kept, KEY)
    assert (reader.name, reader.answers[0].choices) == ("Zoë", {"realism": "right"})


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({**signed(), "name": "Zoe"}, "changed after it was signed off"),
        (signed(study="f" * 16), "another study"),
        (signed(answers=[]), "incomplete"),
        (signed(reader="../../../x"), "damaged"),
        ({}, "no answers"),
    ],
)
def test_what_cannot_be_counted_is_not_kept(
    client: TestClient, tmp_path: Path, content: dict, words: str
) -> None:
    answer = client.post(
        f"/{TOKEN}/answers",
        content=json.dumps(content),
        headers={"content-type": "application/json"},
    )
    assert answer.status_code == 422
    assert words in answer.json()["error"]
    assert not (tmp_path / "answers").exists()
