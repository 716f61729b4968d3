"""What became of every job: a page to look at, and the same as JSON."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from motion_transfer.batch.expand import Job
from motion_transfer.batch.state import BatchState
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.version import __version__

REPORT_FORMAT = "batch-report-1"
PUBLIC = ("seconds", "frames", "duration_seconds", "renderer", "note", "error")


def write_report(folder: Path, jobs: Sequence[Job], state: BatchState) -> Path:
    """Write `index.html`, `report.json` and their pictures. Raises: OutputError."""
    with explain_disk_errors(folder):
        pictures = folder / "pictures"
        pictures.mkdir(parents=True, exist_ok=True)
        entries = [_entry(job, state, folder) for job in jobs]
        for entry in entries:
            for kind in ("source", "result"):
                name = f"{entry['index']:06d}-{kind}.png"
                if (state.pictures / name).exists() and entry["status"] == "done":
                    shutil.copyfile(state.pictures / name, pictures / name)
                entry[f"{kind}_picture"] = (
                    f"pictures/{name}" if (pictures / name).exists() else None
                )
        counts = {word: sum(e["status"] == word for e in entries) for word in _statuses(entries)}
        facts = {"format": REPORT_FORMAT, "version": __version__, "counts": counts}
        _write(folder / "report.json", json.dumps({**facts, "jobs": entries}, indent=1))
        _write(folder / "index.html", _page({**facts, "jobs": entries}))
    return folder / "index.html"


def _entry(job: Job, state: BatchState, folder: Path) -> dict[str, Any]:
    record = state.records.get(str(job.options.output), {})
    return {
        "index": job.index,
        "name": job.name,
        "status": record.get("status", "to do"),
        "output": os.path.relpath(job.options.output, folder),
        "source": str(job.options.source),
        "driver": str(job.options.driver),
        **{key: record[key] for key in PUBLIC if record.get(key) is not None},
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
