"""The preview as a web page on this machine only; `local` keeps everybody else out."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable
from concurrent.futures import CancelledError, Future
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route

from motion_transfer.errors import InputError, MotionTransferError, OutputError
from motion_transfer.option import read_whole
from motion_transfer.preview.local import LocalServer, read_body
from motion_transfer.preview.queue import StaleError

if TYPE_CHECKING:
    from motion_transfer.preview.session import Session

STATE_SECONDS = 0.1  # between two looks for changes
PATIENCE_SECONDS = 0.1  # between two looks whether somebody still waits for a picture
NOT_WAITED_FOR = 499  # nginx's status for a client that has gone: nobody reads the answer
KEEP = {"Cache-Control": "private, max-age=3600, immutable"}  # a picture's address has its key
PAGE_TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}
STATUSES = {StaleError: 409, OutputError: 409, InputError: 422, Exception: 500}
"""What is answered to an error; the first kind that it is counts."""


class PreviewServer:
    """Serves one session until it is stopped.

    The session loads the libraries that do the work: it is made while the page is already on its
    way, and requests wait for it.
    """

    def __init__(self, port: int) -> None:
        """Open a port; 0 takes any that is free. Raises: OutputError if it is taken."""
        self._session: Future[Session] = Future()
        self._server = LocalServer(port, partial(make_app, self._session))
        self.link = self._server.link

    def serve(self, make_session: Callable[[], Session]) -> None:
        """Answer until a signal comes, which is raised again when everything is closed.

        Raises: Whatever making the session raised.
        """

        def make() -> None:
            try:
                self._session.set_result(make_session())
            except BaseException as error:
                self._session.set_exception(error)
                self._server.stop()

        maker = threading.Thread(target=make, name="session")
        maker.start()
        try:
            self._server.run()
        finally:
            maker.join()
            self._session.result().close()


def make_app(session: Future[Session], token: str, closing: Callable[[], bool]) -> Starlette:
    """Make the app: each route, below the token, has its handler."""
    handlers = _Handlers(session, closing)
    routes = [
        Route("/", handlers.page),
        Route("/events", handlers.events),
        Route("/frame/{index}/{view}", handlers.frame),
        Route("/still/{view}", handlers.still),
        Route("/source/{number}", handlers.source_picture),
        Route("/options", handlers.options, methods=["POST"]),
        Route("/files/{purpose}/{drop}/{name}", handlers.receive, methods=["POST"]),
        Route("/source", handlers.choose_sources, methods=["POST"]),
        Route("/garments", handlers.choose_garments, methods=["POST"]),
        Route("/motion", handlers.choose_motion, methods=["POST"]),
        Route("/motion/{number}", handlers.motion_picture),
        Route("/motion/cancel", handlers.cancel_motion, methods=["POST"]),
        Route("/background/{number}", handlers.background_picture),
        Route("/renders", handlers.render, methods=["POST"]),
        Route("/renders/{number}/{what}", handlers.tell_render, methods=["POST"]),
        Route("/renders/{number}/file", handlers.result),
        Route("/job", handlers.job, methods=["POST"]),
        Route("/{name}", handlers.page),
    ]
    # ours are named: what stands under Exception alone is raised again after the answer, and logged
    kinds: Any = (HTTPException, MotionTransferError, *STATUSES)
    errors = dict.fromkeys(kinds, _explain)
    return Starlette(routes=[Mount(f"/{token}", routes=routes)], exception_handlers=errors)


class _Handlers:
    """The handlers of requests; what may take long happens in other threads."""

    def __init__(self, session: Future[Session], closing: Callable[[], bool]) -> None:
        self._future = session
        self._closing = closing
        folder = files("motion_transfer.preview") / "page"
        self._files = {
            file.name: (file.read_bytes(), PAGE_TYPES[Path(file.name).suffix])
            for file in folder.iterdir()
            if Path(file.name).suffix in PAGE_TYPES
        }

    async def _session(self) -> Session:
        # shielded: a request that is given up does not cancel what the others wait for
        return await asyncio.shield(asyncio.wrap_future(self._future))

    async def page(self, request: Request) -> Response:
        """Send a file of the page."""
        name = request.path_params.get("name", "index.html")
        if name not in self._files:  # a fixed list: no path from the page is ever opened
            raise HTTPException(404, "nothing here")
        data, kind = self._files[name]
        return Response(data, media_type=kind)

    async def events(self, _request: Request) -> Response:
        """Send the state, whenever it has changed, as server-sent events."""
        # a proxy between, such as nginx, is told not to collect them
        return StreamingResponse(
            self._states(), media_type="text/event-stream", headers={"X-Accel-Buffering": "no"}
        )

    async def _states(self) -> AsyncIterator[str]:
        sent, session = -1, await self._session()
        while not self._closing():
            if session.revision != sent:
                state = await run_in_threadpool(_describe, session)
                sent = state["revision"]
                yield f"data: {json.dumps(state)}\n\n"
            await asyncio.sleep(STATE_SECONDS)

    async def frame(self, request: Request) -> Response:
        """Send a view of one frame; it is not drawn if nobody waits for it any more."""
        try:
            index = read_whole(request.path_params["index"])
        except ValueError:
            raise HTTPException(404, "there is no such frame") from None
        view = request.path_params["view"]
        key, draft = request.query_params.get("key", ""), request.query_params.get("draft") == "1"
        future = (await self._session()).ask_frame(index, view, key, draft=draft)
        return await self._picture(request, future)

    async def still(self, request: Request) -> Response:
        """Send a view of the source."""
        future = (await self._session()).ask_still(request.path_params["view"])
        return await self._picture(request, future)

    async def source_picture(self, request: Request) -> Response:
        """Send one of the source's pictures."""
        number = _number(request, "picture")
        small = request.query_params.get("small") == "1"
        future = (await self._session()).ask_source_picture(number, small=small)
        return await self._picture(request, future)

    async def receive(self, request: Request) -> Response:
        """Write a dropped file, and give that by which it can be chosen: a number, or a word."""
        session, words = await self._session(), request.path_params
        know = {
            "source": session.choices.know_photo,
            "motion": session.choices.know_motion,
            "background": session.choices.know_background,
        }.get(words["purpose"])
        if know is None:
            raise HTTPException(404, "files are sent as source, motion or background")
        is_motion = words["purpose"] == "motion"
        with await run_in_threadpool(session.dropped.begin, words["drop"], words["name"]) as upload:
            async for data in request.stream():
                await run_in_threadpool(upload.write, data)
            path = await run_in_threadpool(upload.finish, motion=is_motion)
        return JSONResponse({"known": know(path)})

    async def background_picture(self, request: Request) -> Response:
        """Send a small picture of a background."""
        number = _number(request, "background")
        return await self._picture(request, (await self._session()).ask_background(number))

    async def motion_picture(self, request: Request) -> Response:
        """Send a small picture of a motion."""
        number = _number(request, "motion")
        return await self._picture(request, (await self._session()).ask_motion_picture(number))

    async def choose_sources(self, request: Request) -> Response:
        """Take some of the known sources, the one that leads first; as before if one is unfit."""
        numbers = _numbers(await read_body(request))
        return await self._do("choose_sources", numbers)

    async def choose_garments(self, request: Request) -> Response:
        """Take parts from other photos; as before if one is unfit."""
        chosen = (await read_body(request)).get("garments")
        if not isinstance(chosen, list) or not all(map(_is_garment, chosen)):
            raise InputError("garments are expected, each with its number and its parts")
        return await self._do(
            "choose_garments", [(each["number"], each["parts"]) for each in chosen]
        )

    async def choose_motion(self, request: Request) -> Response:
        """Take a known motion, or several files of one drop as one, maybe seen from elsewhere."""
        body = await read_body(request)
        azimuth = body.get("azimuth", 0)
        if type(azimuth) not in (int, float) or not -360 <= azimuth <= 360:
            raise InputError("an azimuth is expected, degrees in -360..360")
        return await self._do("choose_motion", _numbers(body), float(azimuth))

    async def cancel_motion(self, _request: Request) -> Response:
        """Give up a driver that is being read."""
        return await self._do("cancel_motion")

    async def _do(self, method: str, *words: Any) -> Response:
        """Let the session do something, and send how it stands then."""
        session = await self._session()
        try:
            await run_in_threadpool(getattr(session, method), *words)
        except (CancelledError, asyncio.CancelledError):  # by the server's end, before the queue's
            raise HTTPException(503, "the preview is closing") from None
        return JSONResponse(await run_in_threadpool(_describe, session))

    async def _picture(self, request: Request, future: Future[bytes]) -> Response:
        waiting = asyncio.wrap_future(future)
        try:
            while not waiting.done():
                await asyncio.wait([waiting], timeout=PATIENCE_SECONDS)
                if not waiting.done() and await request.is_disconnected():
                    future.cancel()
                    return Response(status_code=NOT_WAITED_FOR)
            data = waiting.result()
        except (CancelledError, asyncio.CancelledError):
            raise HTTPException(503, "the preview is closing") from None
        kind = "image/png" if data[:4] == b"\x89PNG" else "image/jpeg"
        return Response(data, media_type=kind, headers=KEEP)

    async def options(self, request: Request) -> Response:
        """Change options; all that were sent, or none."""
        words = await read_body(request)
        for name, value in words.items():
            if name == "window":
                words[name] = _window_words(value)
            elif name == "frames" and isinstance(value, list):
                words[name] = ":".join("" if end is None else str(end) for end in value)
        if any(not isinstance(value, str | int | float) for value in words.values()):
            raise InputError("values are text or numbers")
        # a switch comes as true or false, which text would not be
        texts = {n: value if isinstance(value, bool) else str(value) for n, value in words.items()}
        session = await self._session()
        try:
            await run_in_threadpool(session.change, texts)
        except InputError as error:
            option = next(iter(texts), "")
            return JSONResponse({"error": str(error), "option": option}, 422)
        return JSONResponse(await run_in_threadpool(_describe, session))

    async def render(self, request: Request) -> Response:
        """Queue the real run; 409 if its output is in the way and may not be replaced."""
        may_replace, session = await _may_replace(request), await self._session()
        try:
            number = await run_in_threadpool(session.render, replace_output=may_replace)
        except OutputError as error:
            return _in_the_way(error, session.options.output)
        return JSONResponse({"number": number}, 202)

    async def tell_render(self, request: Request) -> Response:
        """Stop a run, let it go on where it was, or forget it."""
        renders = (await self._session()).renders
        tell = {"stop": renders.stop, "resume": renders.resume, "remove": renders.remove}
        if (what := request.path_params["what"]) not in tell:
            raise HTTPException(404, "a render can be told to stop, resume or remove")
        await run_in_threadpool(tell[what], _number(request, "render"))
        return JSONResponse({}, 202)

    async def job(self, request: Request) -> Response:
        """Save a manifest of the run."""
        may_replace, session = await _may_replace(request), await self._session()
        try:
            text = await run_in_threadpool(session.save_job, replace_file=may_replace)
        except OutputError as error:
            return _in_the_way(error, session.job_file)
        return JSONResponse({"path": str(session.job_file), "text": text})

    async def result(self, request: Request) -> Response:
        """Send a finished file, to be shown or, with `download`, to be kept."""
        render = (await self._session()).renders.get(_number(request, "render"))
        output = render.options.output
        if render.status != "done":
            raise HTTPException(404, "it is not rendered yet")
        if not output.is_file():
            raise InputError(f"{output} is a folder of frames, or gone")
        name = output.name if request.query_params.get("download") == "1" else None
        return FileResponse(output, filename=name)  # a name makes it an attachment


def _describe(session: Session) -> dict[str, Any]:
    from motion_transfer.preview.state import describe  # loads what draws: seconds

    return describe(session)


def _number(request: Request, what: str) -> int:
    try:
        return read_whole(request.path_params["number"])
    except ValueError:
        raise HTTPException(404, f"there is no such {what}") from None


def _numbers(body: dict[str, Any]) -> list[int]:
    numbers = body.get("numbers")
    if not isinstance(numbers, list) or any(type(number) is not int for number in numbers):
        raise InputError("numbers are expected, of what can be chosen")
    return numbers


def _is_garment(entry: Any) -> bool:
    return (
        isinstance(entry, dict)
        and type(entry.get("number")) is int
        and isinstance(entry.get("parts"), str)
    )


def _in_the_way(error: OutputError, path: Path) -> Response:
    return JSONResponse({"error": str(error), "exists": path.exists()}, 409)


def _window_words(value: Any) -> str:
    """Write `X,Y,SIDE` of what the page sends; None is automatic."""
    if value is None:
        return "auto"
    if isinstance(value, dict) and value.keys() == {"x", "y", "side"}:
        return ",".join(str(value[name]) for name in ("x", "y", "side"))
    return str(value)


async def _may_replace(request: Request) -> bool:
    return (await read_body(request)).get("replace") is True


def _explain(_request: Request, error: Exception) -> Response:
    if isinstance(error, HTTPException):
        return JSONResponse({"error": error.detail}, error.status_code)
    status = next(STATUSES[kind] for kind in STATUSES if isinstance(error, kind))
    return JSONResponse({"error": str(error) or type(error).__name__}, status)
