"""The page of a study served on this machine, where readers' answers arrive as files.

For several readers at one screen, or through a tunnel; the page itself needs no server.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route

from motion_transfer.errors import InputError
from motion_transfer.evaluation.study.answers import check_answers, parse_answers
from motion_transfer.evaluation.study.key import (
    ANSWERS_FOLDER,
    KEY_FILE,
    PAGE_FOLDER,
    Key,
    read_key,
)
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.preview.local import LocalServer

ROOT_TAG, MARKED_TAG = '<html lang="en">', '<html lang="en" data-answers="answers">'
"""What the page is told by: that answers are taken, and where."""


def open_study_server(folder: Path, port: int) -> LocalServer:
    """Open a server of a study's folder. Raises: InputError if it is none; OutputError."""
    key, page = read_key(folder / KEY_FILE), folder / PAGE_FOLDER
    if not (page / "index.html").is_file():
        raise InputError(f"{folder} holds no {PAGE_FOLDER}/index.html; make the study anew")
    return LocalServer(port, lambda token, _closing: make_study_app(folder, key, token))


def make_study_app(folder: Path, key: Key, token: str) -> Starlette:
    """Make the app of a study's folder: its page below the token, and where answers go."""
    page = folder / PAGE_FOLDER
    # a fixed list: no path from the page is ever opened
    known = {str(file.relative_to(page)): file for file in page.rglob("*") if file.is_file()}

    async def index(_request: Request) -> Response:
        text = known["index.html"].read_text("utf-8")
        return Response(text.replace(ROOT_TAG, MARKED_TAG, 1), media_type="text/html")

    async def file(request: Request) -> Response:
        path = known.get(request.path_params["path"])
        if path is None:
            raise HTTPException(404, "nothing here")
        return FileResponse(path)

    async def receive(request: Request) -> Response:
        name = await run_in_threadpool(_keep, await request.body(), folder / ANSWERS_FOLDER, key)
        return JSONResponse({"name": name})

    routes = [
        Route("/", index),
        Route("/answers", receive, methods=["POST"]),
        Route("/{path:path}", file),
    ]
    kinds: Any = (HTTPException, InputError)
    handlers: dict[Any, Callable[..., Response]] = dict.fromkeys(kinds, _explain)
    return Starlette(routes=[Mount(f"/{token}", routes=routes)], exception_handlers=handlers)


def _keep(body: bytes, folder: Path, key: Key) -> str:
    """Write a reader's answers, in place of earlier ones of the same reader; give the file's name.

    Raises: InputError for what is none, or not all; OutputError.
    """
    try:
        text = body.decode()
    except UnicodeDecodeError:
        raise InputError("the answers are not text in UTF-8") from None
    reader = parse_answers(text, "what was sent")
    check_answers(reader, key, "what was sent")
    final = folder / f"answers-{key.study[:6]}-{reader.reader}.json"
    with explain_disk_errors(final):
        folder.mkdir(exist_ok=True)
        part = final.with_name(f".{final.name}.part")
        written = json.dumps(json.loads(text), indent=1, ensure_ascii=False)
        part.write_text(written + "\n", encoding="utf-8")
        part.replace(final)
    return final.name


def _explain(_request: Request, error: Exception) -> Response:
    if isinstance(error, HTTPException):
        return JSONResponse({"error": error.detail}, error.status_code)
    return JSONResponse({"error": str(error)}, 422)
