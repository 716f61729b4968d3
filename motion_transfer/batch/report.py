"""What became of every job: a page to look at, the same as JSON, and small pictures.

The pictures are made by workers, which have loaded what reads a video; the scheduler, which writes
the page, need not.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

from motion_transfer.batch.job import Job
from motion_transfer.batch.state import BatchState
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import names_file
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.option import list_options
from motion_transfer.render.options import Garment, Partner, RenderOptions
from motion_transfer.version import __version__

REPORT_FORMAT = "batch-report-2"
PICTURES = ("source", "driver", "result")
PUBLIC = ("seconds", "frames", "duration_seconds", "renderer", "ended", "note", "error")
"""What of a job's record the report tells."""

POSTER_PX = 160
"""The longer side of a picture; the page shows them at up to 120 px of height."""


PLAYED = (".mp4", ".webm", ".mov")
SHOWN = (".gif", ".png", ".apng", ".webp")
"""What browsers play, and what they show as a picture, if that moves as well."""

UNTOLD = ("source", "driver", "output", "restart", "force", "workers")
"""Options that the page tells elsewhere, or that decide nothing of the output."""


def write_posters(
    source: Path, driver: UInt8[np.ndarray, "H W 3"], output: Path, stem: Path
) -> bool:
    """Write small pictures of a source, of its driver, and of the middle of an output.

    Args:
        stem: The beginning of their names, which end in `-source.png` and so on.
    Returns: Whether all could be had; no job fails for want of them.
    """
    import cv2

    from motion_transfer.media.pictures.formats import open_pictures
    from motion_transfer.media.pictures.photo import write_png
    from motion_transfer.render.source_pictures import first_picture

    try:
        stem.parent.mkdir(parents=True, exist_ok=True)
        pictures = open_pictures(output)
        middle = next(pictures.play(pictures.frame_count // 2))()
        for name, rgb in zip(PICTURES, (first_picture(source), driver, middle), strict=True):
            scale = min(1, POSTER_PX / max(rgb.shape[:2]))
            size = (max(1, round(rgb.shape[1] * scale)), max(1, round(rgb.shape[0] * scale)))
            small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
            write_png(stem.with_name(f"{stem.name}-{name}.png"), small)
    except (InputError, OSError):
        return False
    return True


def write_report(jobs: Sequence[Job], state: BatchState) -> Path:
    """Write `index.html`, whose path is returned, and `report.json`. Raises: OutputError."""
    folder = state.report
    with explain_disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        entries = [_entry(job, state) for job in jobs]
        counts = dict(sorted(Counter(entry["status"] for entry in entries).items()))
        facts = {
            "format": REPORT_FORMAT,
            "version": __version__,
            "manifest": state.manifest.name,
            "made": datetime.now().astimezone().isoformat(timespec="seconds"),
            "counts": counts,
            "frames": sum(entry.get("frames", 0) for entry in entries),
            "seconds": round(sum(entry.get("seconds", 0) for entry in entries), 3),
            "jobs": entries,
        }
        _write(folder / "report.json", json.dumps(facts, indent=1))
        _write(folder / "index.html", _page(facts))
    return folder / "index.html"


def _entry(job: Job, state: BatchState) -> dict[str, Any]:
    output = job.options.output
    suffix = output.suffix.lower()
    plays = "video" if suffix in PLAYED else "picture" if suffix in SHOWN else None
    record = state.records.get(str(output), {})
    status = state.status_of(output)
    has_pictures = status == "done" and record.get("poster")
    stem = f"pictures/{state.picture_stem(output).name}"
    return {
        "index": job.index,
        "name": job.name,
        "status": status,
        "output": os.path.relpath(output, state.report),
        "plays": plays,
        "source": ", ".join(_told(path, state) for path in job.options.source),
        "driver": _told(job.options.driver, state),
        "options": _options_told(job.options, state),
        **{f"{k}_picture": f"{stem}-{k}.png" if has_pictures else None for k in PICTURES},
        **{key: record[key] for key in PUBLIC if record.get(key) is not None},
    }


def _told(path: Path, state: BatchState) -> str:
    """Tell a path as the manifest would, from its own folder; far away ones, as they are."""
    if not names_file(path):
        return str(path)
    near = os.path.relpath(path, state.manifest.absolute().parent)
    return near if near.count("..") < 3 else os.path.normpath(path)


def _options_told(options: RenderOptions, state: BatchState) -> dict[str, str]:
    """List what a job sets otherwise than by default."""

    def words(value: Any, kind: str = "") -> str:
        match value:
            case (start, stop) if kind == "frames":
                return f"{start or 0}:{'' if stop is None else stop}"
            case Path():
                return _told(value, state)
            case tuple():
                return ", ".join(map(words, value))
            case Garment() | Partner():
                return _told(value.photo, state)
        return str(value)

    return {
        entry.word: words(getattr(options, entry.name), entry.kind)
        for entry in list_options(RenderOptions)
        if entry.name not in UNTOLD and getattr(options, entry.name) != entry.default
    }


def _page(facts: dict[str, Any]) -> str:
    from jinja2 import Environment

    template = files("motion_transfer.batch").joinpath("report.html.j2").read_text("utf-8")
    environment = Environment(autoescape=True, trim_blocks=True)
    environment.filters |= {"duration": _duration, "moment": _moment}
    return environment.from_string(template).render(**facts)


def _duration(seconds: float) -> str:
    """Write a time as people say it: `8.2 s`, `3:05 min`, `2:03:05 h`."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d} h" if hours else f"{minutes}:{rest:02d} min"


def _moment(iso: str) -> str:
    return iso[:16].replace("T", " ")  # without seconds and zone, which the element has


def _write(path: Path, text: str) -> None:
    part = path.with_name(f".{path.name}.part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)  # whoever looks meanwhile sees a whole page
