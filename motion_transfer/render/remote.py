"""A run whose inputs or outputs are URLs: what is fetched before it, and sent after it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from motion_transfer.errors import FetchError, OutputError
from motion_transfer.events import Event, Finished, Listener, Notice
from motion_transfer.media.files import cache_folder
from motion_transfer.media.iuv.formats import list_clip_iuv_names, list_iuv_names
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES
from motion_transfer.media.remote import Fetched, check_free, name_of, send, shown_url
from motion_transfer.media.work import key_of
from motion_transfer.option import is_url, list_options

OUTPUTS = ("output", "sheet")
PHOTOS = ("source", "garments", "partners")
"""Options beside whose files IUV is looked for."""


def has_urls(words: Mapping[str, Any]) -> bool:
    """Tell whether anything that was written is a URL."""
    return any(map(is_url, _texts(list(words.values()))))


@contextmanager
def local_run(
    options_class: type, words: Mapping[str, Any], listener: Listener
) -> Iterator[tuple[dict[str, Any], Listener]]:
    """Give what was written with local paths in place of URLs; afterwards, send the outputs.

    Inputs are fetched into temporary files, which go however the block ends. An output is made in
    the cache, where a run that was stopped finds its finished chunks, and goes once it was sent.

    Returns: With the words a listener for the run, who hears that it is finished when that is true
        of the URL.
    Raises: InputError, OutputError, FetchError; before the block where that can be known.
    """
    if not has_urls(words):
        yield dict(words), listener
        return
    held: list[Finished] = []

    def listen(event: Event) -> None:
        if isinstance(event, Finished) and event.output in staged:
            held.append(replace(event, output=staged[event.output]))
        else:
            listener(event)

    described = {entry.name: entry for entry in list_options(options_class)}
    staged: dict[Path | str, str] = {}
    local: dict[str, Any] = {}
    with Fetched() as fetched:
        for name, written in words.items():
            if name in OUTPUTS and is_url(written):
                check_free(written, force=bool(words.get("force")))
                local[name] = _stage(written)
                staged[Path(local[name])] = written
        for name, written in words.items():
            if name in described and name not in OUTPUTS:
                local[name] = _bring(fetched, name, written, listener)
            else:
                local.setdefault(name, written)
        if staged:
            local["force"] = True  # what lies there is of a run that could not send it
        yield local, listen
        for path, url in staged.items():
            listener(Notice(f"sending {shown_url(url)}"))
            _deliver(Path(path), url)
        for event in held:
            listener(event)


def beside(photo: str) -> tuple[str, ...]:
    """List the names under which the IUV of a photo or a clip lies beside it."""
    path = Path(name_of(photo))
    is_photo = path.suffix.lower() in PHOTO_SUFFIXES
    names = list_iuv_names(path) if is_photo else list_clip_iuv_names(path)
    return tuple(name.name for name in names)


def _bring(fetched: Fetched, option: str, written: Any, listener: Listener) -> Any:
    """Replace each URL in what was written for an option."""
    match written:
        case str() if is_url(written):
            listener(Notice(f"fetching {shown_url(written)}"))  # it may take long
            around = beside(written) if option in PHOTOS else ()
            return str(fetched.bring(written, option.rstrip("s"), around))
        case list() | tuple():
            return type(written)(_bring(fetched, option, each, listener) for each in written)
        case dict():
            return {key: _bring(fetched, option, each, listener) for key, each in written.items()}
    return written


def _texts(written: Any) -> Iterator[str]:
    match written:
        case str():
            yield written
        case list() | tuple():
            for each in written:
                yield from _texts(each)
        case dict():
            yield from _texts(list(written.values()))


def _stage(url: str) -> str:
    """Say where an output is made until it is sent: always the same place for the same URL."""
    return str(cache_folder() / "outputs" / key_of({"url": url})[:16] / name_of(url))


def _deliver(path: Path, url: str) -> None:
    try:
        send(path, url)
    except (OutputError, FetchError) as error:
        raise type(error)(f"{error}; the finished output is kept as {path}") from error
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    with suppress(OSError):  # the folder of another run of it that began meanwhile
        path.parent.rmdir()
