"""From what was typed to a session and its server."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.errors import InputError
from motion_transfer.people.motion_name import is_motion
from motion_transfer.render.options import RenderOptions, options_from_words

if TYPE_CHECKING:
    from motion_transfer.preview.server import PreviewServer
    from motion_transfer.preview.session import Session


def options_of_words(words: Mapping[str, Any]) -> RenderOptions:
    """Options from the command line. Raises: InputError where source or driver is missing."""
    for name in ("source", "driver"):
        if words.get(name) is None:
            raise InputError(f"--{name} is missing; give a source and a driver, or a manifest")
    return options_from_words({**words, "output": words.get("output") or _output_of(words)})


def options_of_job(manifest: Path, number: int) -> RenderOptions:
    """Those of one job of a manifest. Raises: InputError if it has no such job."""
    from motion_transfer.batch.run import read_batch

    jobs = read_batch(manifest, ()).jobs
    if not 0 <= number < len(jobs):
        raise InputError(f"job {number} asked for, but {manifest} has {len(jobs)}, from 0")
    return jobs[number].options


def open_server(port: int) -> PreviewServer:
    """Raises: InputError where the extra is missing; OutputError for a port that is taken."""
    try:
        from motion_transfer.preview.server import PreviewServer
    except ImportError as error:
        raise InputError(
            f"the page needs {error.name}; pip install 'motion-transfer[preview]'"
        ) from error
    return PreviewServer(port)


def open_session(options: RenderOptions, job_file: Path) -> Session:
    """A session at work. Loads what draws: it takes a second or two."""
    from motion_transfer.preview.session import Session

    return Session(options, job_file)


def _output_of(words: Mapping[str, Any]) -> str:
    """SOURCE_DRIVER.mp4, here."""
    driver = str(words["driver"])
    name = driver.split(":", 1)[1].split(",")[0] if is_motion(driver) else Path(driver).stem
    return f"{Path(words['source']).stem}_{name}.mp4"
