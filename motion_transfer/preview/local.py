"""A page on this machine only.

Every request has to come from the page that this program's user opened. It is reached by a link
with a random token in its path, which other websites in the same browser do not know; names that
resolve to this machine (DNS rebinding) are refused by their Host, and requests that another page
makes by their Origin.
"""

from __future__ import annotations

import logging
import re
import secrets
import socket
from collections.abc import Callable
from typing import Any

import uvicorn
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.structured import parse_json
from motion_transfer.preview.dropped import MOST_FILE_BYTES

HOST = "127.0.0.1"
LOCAL_HOST = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:[0-9]{1,5})?", re.IGNORECASE)
ONE_RANGE = re.compile(r"bytes=([0-9]{1,15}-[0-9]{0,15}|-[0-9]{1,15})")
MOST_BODY_BYTES = 64 * 1024  # a handful of options, or a reader's answers

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:;"
        " media-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none';"
        " frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",  # the link holds the token
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


class Guard:
    """Lets through what is allowed, and sends strict headers with every answer.

    A tunnel may bring the page to another port, so any port will do in Host and Origin; the two
    have to agree.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app = app
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_strictly(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
                headers.setdefault("Cache-Control", "no-store")
            await send(message)

        refusal = self._refuse(scope)
        if refusal is not None:
            status, words = refusal
            await JSONResponse({"error": words}, status)(scope, receive, send_strictly)
            return
        await self._app(scope, receive, send_strictly)

    def _refuse(self, scope: Scope) -> tuple[int, str] | None:
        """Give status and reason for what is not allowed."""
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        # the whole of it, and said once: a URL's parser would find our name in evil@127.0.0.1, too
        if len(headers.getlist("host")) != 1 or not LOCAL_HOST.fullmatch(host):
            return 403, "this page is only for the machine that it runs on"
        if any(origin != f"http://{host}" for origin in headers.getlist("origin")):
            return 403, "another page asked for this"
        token = scope["path"].lstrip("/").split("/", 1)[0]
        # whose time does not tell how much of a guess was right
        if not secrets.compare_digest(token.encode("utf-8", "replace"), self._token.encode()):
            return 404, "nothing here; open the link that mt printed"
        if not all(ONE_RANGE.fullmatch(each) for each in headers.getlist("range")):
            return 416, "only one range of bytes is sent at once"
        if scope["method"] == "POST":
            # no form of another page can send these types without asking first
            is_file = scope["path"].split("/")[2:3] == ["files"]
            wanted = "application/octet-stream" if is_file else "application/json"
            most = MOST_FILE_BYTES if is_file else MOST_BODY_BYTES
            if headers.get("content-type", "").split(";")[0].strip() != wanted:
                return 415, f"the body has to be {wanted}"
            length = headers.get("content-length", "")
            if not re.fullmatch("[0-9]+", length):
                return 411, "the length of the body has to be told"
            if len(length) > 12 or int(length) > most:
                limit = f"{most // 2**30} GiB" if is_file else f"{most} bytes"
                return 413, f"too large; at most {limit} can be sent at once"
        return None


class LocalServer:
    """Serves an app behind a guard until it is stopped.

    Args:
        make_app: Makes the app of the token below which it lies, and of what tells whether the
            server is closing.
    """

    def __init__(self, port: int, make_app: Callable[[str, Callable[[], bool]], ASGIApp]) -> None:
        """Open a port; 0 takes any that is free. Raises: OutputError if it is taken."""
        self._token = secrets.token_urlsafe(24)
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((HOST, port))
            self._socket.listen()  # a browser that is quicker than this program waits
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise OutputError(
                f"port {port} cannot be used ({error}); choose another --port, or 0"
            ) from error
        config = uvicorn.Config(
            Guard(make_app(self._token, lambda: self._server.should_exit), self._token),
            log_level="error",
            lifespan="off",
            server_header=False,
            timeout_keep_alive=60,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)

    @property
    def link(self) -> str:
        """The page's address, token included."""
        return f"http://{HOST}:{self._socket.getsockname()[1]}/{self._token}/"

    def run(self) -> None:
        """Answer until a signal comes, which is raised again when everything is closed."""
        log = logging.getLogger("uvicorn.error")
        log.addFilter(self._is_news)
        try:
            self._server.run(sockets=[self._socket])
        finally:
            log.removeFilter(self._is_news)

    def _is_news(self, _record: logging.LogRecord) -> bool:
        """Tell whether a fault is one: at the end all that is still asked for is given up."""
        return not self._server.should_exit

    def stop(self) -> None:
        """End soon; from any thread."""
        self._server.should_exit = True


async def read_body(request: Request) -> dict[str, Any]:
    """Read a body, whose size was checked before. Raises: InputError for any but a mapping."""
    try:
        text = (await request.body()).decode()
    except UnicodeDecodeError:
        raise InputError("the body is not text in UTF-8") from None
    body = parse_json(text, "the body")
    if not isinstance(body, dict):
        raise InputError("the body has to be an object")
    return body
