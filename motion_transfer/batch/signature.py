"""Whether the files that an output was made from are still the same, without decoding them.

Like a version control system's index: size and times that did not change mean content that did not
change; where they did, the content itself decides.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError
from motion_transfer.media.work import digest_of, key_of
from motion_transfer.people.motion_name import is_motion
from motion_transfer.render.beside import find_iuv_beside
from motion_transfer.render.option import list_options
from motion_transfer.render.options import NO_AUDIO, RenderOptions
from motion_transfer.version import __version__

NOT_DRAWN = ("workers", "restart", "force")
Signature = dict[str, Any]
Files = dict[str, list[str]]
"""Path -> what its status is, and the digest of its content."""


def source_files(options: RenderOptions) -> Iterator[Path]:
    """What a source's appearance is made from. Raises: InputError if a photo is missing."""
    photos = [(options.source, options.source_iuv)]
    photos += [(garment.photo, garment.iuv) for garment in options.garments]
    for photo, given in photos:
        yield photo
        if iuv := given or find_iuv_beside(photo):
            yield iuv
    for model in (options.weights_file, options.estimator_model):
        if model is not None:
            yield model


def driver_files(options: RenderOptions) -> Iterator[Path]:
    """The driver, unless it is a motion."""
    if not is_motion(options.driver):
        yield options.driver


def audio_files(options: RenderOptions) -> Iterator[Path]:
    """The sound, if a file is named."""
    if options.audio is not None and str(options.audio) != NO_AUDIO:
        yield options.audio


def sign_files(paths: Iterable[Path]) -> Files:
    """Status and digest of files and folders; sign before reading. Raises: InputError."""
    try:
        return {str(path): [_status(path), digest_of(path)] for path in paths}
    except FileNotFoundError as error:
        raise InputError(f"{error.filename} does not exist") from None


def check_unchanged(files: Files) -> None:
    """Raises: InputError if a file is not what it was when it was signed."""
    for name, (status, digest) in files.items():
        path = Path(name)
        try:
            unchanged = status == _status(path) or digest == digest_of(path)
        except FileNotFoundError:
            raise InputError(f"{path} does not exist") from None
        if not unchanged:
            raise InputError(f"{path} has changed since the batch began; start it again")


def sign(options: RenderOptions, files: Files) -> Signature:
    """What is remembered of a published output, to know it again. Raises: OSError."""
    return {"options": _options_key(options), "files": files, "output": _status(options.output)}


def is_current(options: RenderOptions, signature: Signature, statuses: dict[Path, str]) -> bool:
    """Whether the output is there, untouched, and made from these options and this content.

    Args:
        statuses: of inputs, looked up here and noted; for jobs that share them.
    """

    def status(path: Path) -> str:
        if path not in statuses:
            statuses[path] = _status(path)
        return statuses[path]

    try:
        if signature["options"] != _options_key(options):
            return False
        if signature["output"] != _status(options.output):
            return False
        parts = (driver_files(options), source_files(options), audio_files(options))
        paths = {str(path): path for part in parts for path in part}
        return paths.keys() == signature["files"].keys() and all(
            signature["files"][name][0] == status(path)
            or signature["files"][name][1] == digest_of(path)
            for name, path in paths.items()
        )
    except (OSError, InputError, KeyError):
        return False


def is_ours(options: RenderOptions, signature: Signature) -> bool:
    """Whether the output is the one that the signature's job made, whatever it was made from."""
    try:
        return signature.get("output") == _status(options.output)
    except OSError:
        return False


def _options_key(options: RenderOptions) -> str:
    names = [e.name for e in list_options(RenderOptions) if e.name not in NOT_DRAWN]
    return key_of({"version": __version__, **{name: getattr(options, name) for name in names}})


def _status(path: Path) -> str:
    files = sorted(f for f in path.iterdir() if f.is_file()) if path.is_dir() else [path]
    return key_of({f.name: [(s := f.stat()).st_size, s.st_mtime_ns, s.st_ino] for f in files})
