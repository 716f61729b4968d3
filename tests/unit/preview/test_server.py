"""Who is let in."""

from __future__ import annotations

import asyncio
import json

import pytest

pytest.importorskip("starlette", reason="needs the `preview` extra")

from motion_transfer.preview.server import MOST_BODY_BYTES, Guard

TOKEN = "secret"


def ask(
    path: str = f"/{TOKEN}/", method: str = "GET", **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of one request, to an app that says yes to everything."""

    async def app(_scope, _receive, send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"let in"})

    sent = []

    async def send(message) -> None:
        sent.append(message)

    async def receive() -> dict:
        return {"type": "http.request", "body": b""}

    given = {"host": "127.0.0.1:8000", **{k.replace("_", "-"): v for k, v in headers.items()}}
    scope = {
        "type": "http",
        "method": method,
        "path": path,
        "headers": [(k.encode(), v.encode()) for k, v in given.items()],
    }
    asyncio.run(Guard(app, TOKEN)(scope, receive, send))
    start, body = sent[0], b"".join(message.get("body", b"") for message in sent[1:])
    return start["status"], {k.decode(): v.decode() for k, v in start["headers"]}, body


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:1", "localhost", "[::1]:8000"])
def test_this_machine_is_let_in_through_any_port(host: str) -> None:
    assert ask(host=host)[0] == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example:8000", "", "0.0.0.0:8000", "[", "a@b"]
)
def test_other_names_are_refused(host: str) -> None:
    status, _, body = ask(host=host)
    assert status == 403
    assert b"only for the machine" in body


@pytest.mark.parametrize("path", ["/", "/secre/", "/secret2/", "/%73ecret", "//", "/\xff/"])
def test_without_the_token_there_is_nothing(path: str) -> None:
    status, _, body = ask(path)
    assert status == 404
    assert TOKEN not in body.decode()


@pytest.mark.parametrize(
    ("origin", "status"),
    [
        ("http://127.0.0.1:8000", 200),
        ("http://127.0.0.1:9000", 403),
        ("https://127.0.0.1:8000", 403),
        ("http://evil.example", 403),
        ("null", 403),
    ],
)
def test_only_its_own_page_may_ask(origin: str, status: int) -> None:
    assert ask(origin=origin)[0] == status


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"content_type": "application/json", "content_length": "2"}, 200),
        ({"content_type": "application/json; charset=utf-8", "content_length": "2"}, 200),
        ({"content_type": "text/plain", "content_length": "2"}, 415),
        ({"content_length": "2"}, 415),
        ({"content_type": "application/json"}, 411),
        ({"content_type": "application/json", "content_length": str(MOST_BODY_BYTES + 1)}, 413),
    ],
)
def test_what_is_sent_is_json_of_a_bounded_size(headers: dict, status: int) -> None:
    assert ask(method="POST", **headers)[0] == status


@pytest.mark.parametrize("path", [f"/{TOKEN}/", "/nothing"])
def test_every_answer_has_strict_headers(path: str) -> None:
    _, headers, _ = ask(path)
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"


def test_refusals_are_in_words() -> None:
    assert "open the link" in json.loads(ask("/x")[2])["error"]
