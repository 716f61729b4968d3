"""Who is let in."""

from __future__ import annotations

import asyncio
import json
from concurrent.futures import Future
from typing import Any

import pytest

pytest.importorskip("starlette", reason="needs the `preview` extra")

from starlette.testclient import TestClient

from motion_transfer.preview.dropped import MOST_FILE_BYTES
from motion_transfer.preview.local import MOST_BODY_BYTES, Guard
from motion_transfer.preview.server import make_app

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
    "host",
    [
        *("evil.example", "127.0.0.1.evil.example:8000", "", "0.0.0.0:8000", "[", "a@b"),
        *("evil.com@127.0.0.1", "127.0.0.1/evil", "127.0.0.1#evil.com", "127.0.0.1?x", "[::1"),
        *("127.0.0.1:", "127.0.0.1:8000:1", "127.0.0.1:x", "127.0.0.1:³", "127.0.0.1 ", "::1"),
    ],
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


@pytest.mark.parametrize(
    ("path", "kind", "length", "status"),
    [
        (f"/{TOKEN}/files/source/1/a.png", "application/octet-stream", MOST_FILE_BYTES, 200),
        (f"/{TOKEN}/files/source/1/a.png", "application/octet-stream", MOST_FILE_BYTES + 1, 413),
        (f"/{TOKEN}/files/source/1/a.png", "multipart/form-data", 9, 415),
        (f"/{TOKEN}/options", "application/octet-stream", 9, 415),
        ("/wrong/files/source/1/a.png", "application/octet-stream", 9, 404),
    ],
)
def test_files_are_sent_as_no_form_can(path: str, kind: str, length: int, status: int) -> None:
    headers = {"content_type": kind, "content_length": str(length)}
    assert ask(path, "POST", **headers)[0] == status
    assert ask(path, "POST", origin="http://evil.example", **headers)[0] == 403


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


@pytest.mark.parametrize("length", ["", "³", "-1", "1e3", "9" * 5000])
def test_lengths_that_are_none(length: str) -> None:
    status = ask(method="POST", content_type="application/json", content_length=length)[0]
    assert status == (413 if length.startswith("9") else 411)


@pytest.mark.parametrize("bounds", ["bytes=-", f"bytes={'9' * 5000}-", "bytes=0-1,2-3", "lines=1"])
def test_ranges_that_are_none(bounds: str) -> None:
    assert ask(range=bounds)[0] == 416
    assert ask(range="bytes=0-")[0] == ask(range="bytes=-5")[0] == 200


class Idle:
    """A session that takes whatever it is asked."""

    revision = 0

    def change(self, texts: dict[str, str]) -> None:
        self.texts = texts

    def state(self) -> dict[str, int]:
        return {"revision": 0}

    def ask_frame(self, index: int, *_: object, **__: object) -> Future[bytes]:
        future: Future[bytes] = Future()
        future.set_result(str(index).encode())
        return future


def client() -> TestClient:
    session: Future[Any] = Future()
    session.set_result(Idle())
    app = Guard(make_app(session, TOKEN, lambda: True), TOKEN)
    return TestClient(app, base_url="http://127.0.0.1:8000", raise_server_exceptions=False)


def test_frames_are_known_by_numbers() -> None:
    assert client().get(f"/{TOKEN}/frame/12/result").content == b"12"
    for index in ("9" * 5000, "³", "1_0", "x", "%00"):
        answer = client().get(f"/{TOKEN}/frame/{index}/result")
        assert (answer.status_code, list(answer.json())) == (404, ["error"])


@pytest.mark.parametrize(
    "body",
    [
        *(b"", b"[", b"[" * 50000, b"1" * 5000, b"\xff", b"null", b"[]", b"NaN", b'{"a": NaN}'),
        *(b'{"a": []}', b'{"a": {}}', b'{"a": null}', b'{"a": "\\u0000"}', b'{"a": "\\ud800"}'),
        *(b'{"a": 1, "a": 2}', b'{"a": ' + b"9" * 5000 + b"}", b'{"a": ' + b'{"a":' * 9000),
    ],
)
def test_bodies_that_are_no_options(body: bytes) -> None:
    answer = client().post(
        f"/{TOKEN}/options", content=body, headers={"content-type": "application/json"}
    )
    assert (answer.status_code, "error" in answer.json()) == (422, True)
