"""Paths that are URLs: fetched into local files before work begins, sent once it is finished.

fsspec knows the places (s3://, gs://, https://, sftp://, memory:// ...), each by a package of its
own. Whatever reads or writes media sees local files only, so that nothing else knows of URLs.
"""

from __future__ import annotations

import logging
import shutil
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any, Self
from urllib.parse import unquote, urlsplit

from motion_transfer.errors import FetchError, InputError, OutputError, first_line
from motion_transfer.extras import require_extra

log = logging.getLogger(__name__)

LARGEST_BYTES = 64 << 30
"""What is fetched for one input: a wrong address is not to fill the disk."""

WHOLE_AT_ONCE = frozenset(("s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "oci", "oss"))
"""Stores in which an object appears when it is complete; elsewhere it is renamed at the end."""


def shown_url(url: str) -> str:
    """Repeat a URL in messages, without passwords and signatures."""
    parts = urlsplit(url)
    host = parts.netloc.rpartition("@")[2]
    return f"{parts.scheme}://{host}{parts.path}" if parts.scheme else url


def name_of(url: str) -> str:
    """Name the file that a URL means. Raises: InputError if it means none."""
    name = PurePosixPath(unquote(urlsplit(url).path) or urlsplit(url).netloc).name
    if name in ("", ".", "..") or "\0" in name:
        raise InputError(f"{shown_url(url)} names no file")
    return name


def url_beside(url: str, name: str) -> str:
    """Spell what lies under another name in the same folder as a URL."""
    folder, slash, _ = url.rstrip("/").rpartition("/")
    return f"{folder}{slash}{name}"


def find_urls(pattern: str) -> list[str]:
    """List what a URL with `*` stands for, in order. Raises: InputError, FetchError."""
    with _explained(pattern, "listed"):
        files, path = _open(pattern)
        found = files.glob(path)
        # a path alone says neither host nor user, and one file is to have one URL
        before, known, after = pattern.partition(path.lstrip("/"))
        if not known:
            return sorted(map(files.unstrip_protocol, found))
        return sorted(f"{before}{name.lstrip('/')}{after}" for name in found)


def exists(url: str) -> bool:
    """Tell whether something is there. Raises: InputError, FetchError."""
    with _explained(url, "looked at"):
        files, path = _open(url)
        return files.exists(path)


def fetch(url: str, target: Path, what: str) -> None:
    """Bring a file, or a folder of files, to `target`, which is there when it is whole.

    Args:
        what: What it is wanted for, such as `driver`, for messages.
    Raises: InputError if there is no such thing, or it is too large; FetchError.
    """
    with _explained(url, "read"):
        files, path = _open(url)
        info = files.info(path)
        folder = info["type"] == "directory"
        found = files.find(path, maxdepth=1, detail=True) if folder else {path: info}
        sizes = {name: each.get("size") for name, each in found.items()}
        expected = sum(size or 0 for size in sizes.values())
        room = shutil.disk_usage(target.parent).free
        if expected > min(LARGEST_BYTES, room):
            limit = "is free on the disk" if room < LARGEST_BYTES else "is fetched"
            raise InputError(
                f"{what} {shown_url(url)} has {expected >> 20:,} MiB, more than {limit}; shorten it"
                " or fetch it yourself"
            )
        log.debug("fetching %s, %.1f MB", shown_url(url), expected / 1e6)
        part = target.with_name(f"{target.name}.part-{uuid.uuid4().hex[:8]}")
        try:
            if folder:
                part.mkdir()
                names = {name: part / PurePosixPath(name).name for name in found}
            else:
                names = {path: part}
            files.get(list(names), list(map(str, names.values())))
            for name, local in names.items():
                size = sizes[name]
                if size is not None and local.stat().st_size != size:
                    raise FetchError(
                        f"{what} {shown_url(url)} changed, or was cut short; try again"
                    )
            part.replace(target)
        finally:
            _remove(part)


def check_free(url: str, *, force: bool) -> None:
    """Refuse a destination where something is. Raises: OutputError, InputError, FetchError."""
    name_of(url)
    if not force and exists(url):
        raise OutputError(f"{shown_url(url)} exists already; choose another name or add --force")


def send(source: Path, url: str) -> None:
    """Put a file, or a folder of files, at a URL; a file is there whole or not at all.

    Raises: OutputError without permission; FetchError for other reasons.
    """
    with _explained(url, "written", OutputError):
        files, path = _open(url)
        log.debug("sending %s to %s", source, shown_url(url))
        if source.is_dir():
            inside = sorted(item for item in source.iterdir() if item.is_file())
            pairs = [(item, f"{path.rstrip('/')}/{item.name}") for item in inside]
        else:
            pairs = [(source, path)]
        files.makedirs(files._parent(pairs[0][1]), exist_ok=True)
        for item, final in pairs:
            _put(files, item, final)


def same_size(source: Path, url: str) -> bool:
    """Tell whether a URL holds a file, or all files of a folder, of the same sizes."""
    with _explained(url, "looked at"):
        files, path = _open(url)
        local = {source.name: source}
        if source.is_dir():
            local = {item.name: item for item in source.iterdir() if item.is_file()}
            path, names = path.rstrip("/"), local
            remote = {name: f"{path}/{name}" for name in names}
        else:
            remote = {source.name: path}
        try:
            return all(
                files.info(remote[name]).get("size") == item.stat().st_size
                for name, item in local.items()
            )
        except FileNotFoundError:
            return False


class Fetched:
    """What was fetched for some work: each URL once, in a folder that goes when the work ends."""

    def __init__(self, folder: Path | None = None) -> None:
        """Take a folder to fetch into; else one is made among the temporary files."""
        self._folder = folder
        self._made: dict[str, Path] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def bring(self, url: str, what: str, beside: tuple[str, ...] = ()) -> Path:
        """Fetch a URL, unless that was done before; give the local file or folder.

        Args:
            beside: Names that are fetched as well, if they are there: the IUV of a photo.
        """
        if url not in self._made:
            if self._folder is None:
                self._folder = Path(tempfile.mkdtemp(prefix="mt-remote-"))
            place = self._folder / str(len(self._made))  # of one URL: names may be the same
            place.mkdir(parents=True, exist_ok=True)
            target = place / name_of(url)
            fetch(url, target, what)
            for name in beside:
                other = url_beside(url, name)
                if "?" not in url and exists(other):  # what is signed is signed alone
                    fetch(other, place / name, what)
            self._made[url] = target
        return self._made[url]


def _open(url: str) -> tuple[Any, str]:
    """Find the file system of a URL, and the path in it."""
    require_extra("remote")
    from fsspec.core import url_to_fs

    return url_to_fs(url)


def _put(files: Any, source: Path, final: str) -> None:
    protocols = {files.protocol} if isinstance(files.protocol, str) else set(files.protocol)
    if protocols & WHOLE_AT_ONCE:
        files.put_file(str(source), final)
        return
    parent, _, name = final.rpartition("/")
    part = f"{parent}/.{name}.part-{uuid.uuid4().hex[:8]}"
    try:
        files.put_file(str(source), part)
        if files.exists(final):
            files.rm_file(final)  # not every file system replaces
        files.mv(part, final)
    except BaseException:
        with suppress(Exception):  # the first reason is the one to tell
            files.rm_file(part)
        raise


@contextmanager
def _explained(url: str, done: str, refused: type[InputError] = InputError) -> Iterator[None]:
    """Say in one line what fsspec and the packages behind it say in many ways."""
    shown = shown_url(url)
    try:
        yield
    except (InputError, FetchError):
        raise
    except FileNotFoundError:
        raise InputError(f"{shown} does not exist") from None
    except PermissionError as error:
        raise refused(
            f"{shown} cannot be {done}: no permission; check the keys and rights there"
        ) from error
    except (ImportError, ValueError) as error:  # no package for it; no such protocol
        raise InputError(f"{shown} cannot be {done}: {first_line(error)}") from error
    except Exception as error:  # each package has errors of its own
        raise FetchError(
            f"{shown} cannot be {done}: {type(error).__name__}: {first_line(error)}"
        ) from error


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
