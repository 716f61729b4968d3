"""What became of every job: a page to look at, the same as JSON, and small pictures.

The pictures are made by workers, which have loaded what reads a video; the scheduler, which writes
the page, need not.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from motion_transfer.batch.expand import Job
from motion_transfer.batch.state import BatchState
from motion_transfer.errors import InputError
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.version import __version__

REPORT_FORMAT = "batch-report-1"
PICTURES = ("source", "result")
PUBLIC = ("seconds", "frames", "duration_seconds", "renderer", "note", "error")
"""What of a job's record the report tells."""

POSTER_PX = 160
"""The longer side of a picture; the page shows them at up to 120 px of height."""


def write_posters(source: Path, output: Path, stem: Path) -> bool:
    """Write small pictures of a source and of the middle of an output.

    Args:
        stem: The beginning of their names, which end in `-source.png` and `-result.png`.
    Returns: Whether both could be had; no job fails for want of them.
    """
    import cv2

    from motion_transfer.media.pictures.formats import open_pictures
    from motion_transfer.media.pictures.photo import write_png
    from motion_transfer.render.source_pictures import first_picture

    try:
        stem.parent.mkdir(parents=True, exist_ok=True)
        pictures = open_pictures(output)
        middle = next(pictures.play(pictures.frame_count // 2))()
        for name, rgb in zip(PICTURES, (first_picture(source), middle), strict=True):
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
        facts = {"format": REPORT_FORMAT, "version": __version__, "counts": counts, "jobs": entries}
        _write(folder / "report.json", json.dumps(facts, indent=1))
        _write(folder / "index.html", _page(facts))
    return folder / "index.html"


def _entry(job: Job, state: BatchState) -> dict[str, Any]:
    output = job.options.output
    record = state.records.get(str(output), {})
    status = state.status_of(output)
    has_pictures = status == "done" and record.get("poster")
    stem = f"pictures/{state.picture_stem(output).name}"
    return {
        "index": job.index,
        "name": job.name,
        "status": status,
        "output": os.path.relpath(output, state.report),
        "source": job.options.source_words,
        "driver": str(job.options.driver),
        **{f"{k}_picture": f"{stem}-{k}.png" if has_pictures else None for k in PICTURES},
        **{key: record[key] for key in PUBLIC if record.get(key) is not None},
    }


def _page(facts: dict[str, Any]) -> str:
    from jinja2 import Environment

    template = files("motion_transfer.batch").joinpath("report.html.j2").read_text("utf-8")
    return Environment(autoescape=True).from_string(template).render(**facts)


def _write(path: Path, text: str) -> None:
    part = path.with_name(f".{path.name}.part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)  # whoever looks meanwhile sees a whole page
