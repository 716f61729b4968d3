"""What became of every job: a page to look at, and the same as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from motion_transfer.batch.expand import Job
from motion_transfer.batch.state import BatchState
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.version import __version__

REPORT_FORMAT = "batch-report-1"
PICTURES = ("source", "result")
PUBLIC = ("seconds", "frames", "duration_seconds", "renderer", "note", "error")


def write_report(jobs: Sequence[Job], state: BatchState) -> Path:
    """Write `index.html` and `report.json`; the pictures are there. Raises: OutputError."""
    folder = state.report
    with explain_disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        entries = [_entry(job, state) for job in jobs]
        counts = {word: sum(e["status"] == word for e in entries) for word in _statuses(entries)}
        facts = {"format": REPORT_FORMAT, "version": __version__, "counts": counts}
        _write(folder / "report.json", json.dumps({**facts, "jobs": entries}, indent=1))
        _write(folder / "index.html", _page({**facts, "jobs": entries}))
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
        "source": str(job.options.source),
        "driver": str(job.options.driver),
        **{f"{k}_picture": f"{stem}-{k}.png" if has_pictures else None for k in PICTURES},
        **({key: record[key] for key in PUBLIC if record.get(key) is not None} if record else {}),
    }


def _statuses(entries: Sequence[dict[str, Any]]) -> list[str]:
    return sorted({entry["status"] for entry in entries})


def _page(facts: dict[str, Any]) -> str:
    from jinja2 import Environment

    template = files("motion_transfer.batch").joinpath("report.html.j2").read_text()
    return Environment(autoescape=True).from_string(template).render(**facts)


def _write(path: Path, text: str) -> None:
    part = path.with_name(f".{path.name}.part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)
