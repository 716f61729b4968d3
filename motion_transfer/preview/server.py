"""The preview as a web page on this machine only."""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import threading
from collections.abc import AsyncIterator, Callable
from concurrent.futures import CancelledError, Future
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route

from motion_transfer.errors import InputError, MotionTransferError, OutputError
from motion_transfer.preview.draw_queue import StaleError
from motion_transfer.preview.guard import Guard

if TYPE_CHECKING:
    from motion_transfer.preview.session import Session

HOST = "127.0.0.1"
PAGE_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
STATE_SECONDS = 0.1  # between two looks for changes
SHORT_PATIENCE = 0.1  # s, between two looks whether somebody still waits for a picture
KEEP = {"Cache-Control": "private, max-age=3600, immutable"}  # a picture's address has its key


class PreviewServer:
    """Serves one session until it is stopped.

    The session loads the libraries that do the work: it is made while the page is already on its
    way, and requests wait for it.
    """

    def __init__(self, port: int) -> None:
        """Raises: OutputError if the port is taken; 0 takes any that is free."""
        self._session: Future[Session] = Future()
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
        app = Guard(make_app(self._session, self._token, self._is_closing), self._token)
        config = uvicorn.Config(
            app,
            log_level="error",
            lifespan="off",
            server_header=False,
            timeout_keep_alive=60,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)

    @property
    def link(self) -> str:
        """Where the page is, token included."""
        return f"http://{HOST}:{self._socket.getsockname()[1]}/{self._token}/"

    def serve(self, make_session: Callable[[], Session]) -> None:
        """Answer until a signal comes, which is raised again when everything is closed.

        Raises: whatever making the session raised.
        """

        def make() -> None:
            try:
                self._session.set_result(make_session())
            except BaseException as error:
                self._session.set_exception(error)
                self._server.should_exit = True

        maker = threading.Thread(target=make, name="session")
        maker.start()
        try:
            self._server.run(sockets=[self._socket])
        finally:
            maker.join()
            self._session.result().close()

    def _is_closing(self) -> bool:
        return self._server.should_exit


def make_app(session: Future[Session], token: str, closing: Callable[[], bool]) -> Starlette:
    """The routes below the token; see each handler."""
    handlers = _Handlers(session, closing)
    routes = [
        Route("/", handlers.page),
        Route("/events", handlers.events),
        Route("/frame/{index:int}/{view}", handlers.frame),
        Route("/still/{view}", handlers.still),
        Route("/options", handlers.options, methods=["POST"]),
        Route("/render", handlers.render, methods=["POST"]),
        Route("/render/stop", handlers.stop, methods=["POST"]),
        Route("/job", handlers.job, methods=["POST"]),
        Route("/result", handlers.result),
        Route("/{name}", handlers.page_file),
    ]
    errors: dict[Any, Any] = {
        StaleError: _explain(409),
        OutputError: _explain(409),
        InputError: _explain(422),
        MotionTransferError: _explain(500),
        HTTPException: _explain_status,
        Exception: _explain(500),
    }
    return Starlette(routes=[Mount(f"/{token}", routes=routes)], exception_handlers=errors)


class _Handlers:
    def __init__(self, session: Future[Session], closing: Callable[[], bool]) -> None:
        self._future = session
        self._closing = closing
        folder = files("motion_transfer.preview") / "page"
        self._files = {
            file.name: file.read_bytes()
            for file in folder.iterdir()
            if file.name[file.name.rfind(".") :] in PAGE_TYPES
        }

    async def _session(self) -> Session:
        return await asyncio.shield(asyncio.wrap_future(self._future))

    async def page(self, _request: Request) -> Response:
        return self._file("index.html")

    async def page_file(self, request: Request) -> Response:
        return self._file(request.path_params["name"])

    def _file(self, name: str) -> Response:
        if name not in self._files:  # a fixed list: no path from the page is ever opened
            raise HTTPException(404, "nothing here")
        return Response(self._files[name], media_type=PAGE_TYPES[name[name.rfind(".") :]])

    async def events(self, _request: Request) -> Response:
        """The state, whenever it has changed, as server-sent events."""
        return StreamingResponse(
            self._states(), media_type="text/event-stream", headers={"X-Accel-Buffering": "no"}
        )

    async def _states(self) -> AsyncIterator[str]:
        sent, session = -1, await self._session()
        while not self._closing():
            if session.revision != sent:
                state = await run_in_threadpool(session.state)
                sent = state["revision"]
                yield f"data: {json.dumps(state)}\n\n"
            await asyncio.sleep(STATE_SECONDS)

    async def frame(self, request: Request) -> Response:
        """A view of one frame; drawing is given up when nobody waits for it any more."""
        view, query = request.path_params["view"], request.query_params
        session = await self._session()
        future = session.ask_frame(
            request.path_params["index"],
            view,
            query.get("key", ""),
            draft=query.get("draft") == "1",
        )
        return await self._picture(request, future)

    async def still(self, request: Request) -> Response:
        """A view of the source."""
        future = (await self._session()).ask_still(request.path_params["view"])
        return await self._picture(request, future)

    async def _picture(self, request: Request, future: Future[bytes]) -> Response:
        waiting = asyncio.wrap_future(future)
        try:
            while not waiting.done():
                await asyncio.wait([waiting], timeout=SHORT_PATIENCE)
                if not waiting.done() and await request.is_disconnected():
                    future.cancel()
                    return Response(status_code=499)
            data = waiting.result()
        except (CancelledError, asyncio.CancelledError):
            raise HTTPException(503, "the preview is closing") from None
        kind = "image/png" if data[:4] == b"\x89PNG" else "image/jpeg"
        return Response(data, media_type=kind, headers=KEEP)

    async def options(self, request: Request) -> Response:
        """Change options; all that were sent, or none."""
        words = await _body(request)
        for name, value in words.items():
            if name == "window":
                words[name] = _window_words(value)
            elif name == "frames" and isinstance(value, list):
                words[name] = ":".join("" if end is None else str(end) for end in value)
        if any(not isinstance(value, str | int | float) for value in words.values()):
            raise InputError("values are text or numbers")
        texts = {name: str(value) for name, value in words.items()}
        session = await self._session()
        try:
            await run_in_threadpool(session.change, texts)
        except InputError as error:
            option = next(iter(texts), "")
            return JSONResponse({"error": str(error), "option": option}, 422)
        return JSONResponse(await run_in_threadpool(session.state))

    async def render(self, request: Request) -> Response:
        """Begin the real run."""
        body, session = await _body(request), await self._session()
        try:
            await run_in_threadpool(session.render, replace_output=body.get("replace") is True)
        except OutputError as error:
            return _in_the_way(error, session.options.output)
        return JSONResponse({}, 202)

    async def stop(self, _request: Request) -> Response:
        """Stop the run; begun again, it goes on where it was."""
        (await self._session()).rendering.stop()
        return JSONResponse({}, 202)

    async def job(self, request: Request) -> Response:
        """Save a manifest of the run."""
        body, session = await _body(request), await self._session()
        try:
            text = await run_in_threadpool(
                session.save_job, replace_file=body.get("replace") is True
            )
        except OutputError as error:
            return _in_the_way(error, session.job_file)
        return JSONResponse({"path": str(session.job_file), "text": text})

    async def result(self, _request: Request) -> Response:
        """The finished video."""
        rendering = (await self._session()).rendering
        if rendering.progress.status != "done" or rendering.options is None:
            raise HTTPException(404, "nothing is rendered yet")
        output = rendering.options.output
        if not output.is_file():
            raise InputError(f"{output} is a folder of frames, or gone")
        return FileResponse(output)


def _in_the_way(error: OutputError, path: Path) -> Response:
    return JSONResponse({"error": str(error), "exists": path.exists()}, 409)


def _window_words(value: Any) -> str:
    """`X,Y,SIDE` of what the page sends; None is automatic."""
    if value is None:
        return "auto"
    if isinstance(value, dict) and value.keys() == {"x", "y", "side"}:
        return ",".join(str(value[name]) for name in ("x", "y", "side"))
    return str(value)


async def _body(request: Request) -> dict[str, Any]:
    """Its size was checked before. Raises: InputError for anything but a mapping."""
    try:
        body = await request.json()
    except ValueError:
        raise InputError("the body is not JSON") from None
    if not isinstance(body, dict):
        raise InputError("the body has to be an object")
    return body


def _explain(status: int) -> Callable[[Request, Exception], Response]:
    def answer(_request: Request, error: Exception) -> Response:
        words = str(error) or type(error).__name__
        if isinstance(error, StaleError):
            words = "something has changed since; ask again with the new key"
        return JSONResponse({"error": words}, status)

    return answer


def _explain_status(_request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return JSONResponse({"error": error.detail}, error.status_code)
