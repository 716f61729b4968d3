"""The published form of events is the code's, and what real runs print has it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from motion_transfer.cli.event_lines import EVENTS, schema, write_line
from motion_transfer.events import FramesDone

PUBLISHED = Path(__file__).parents[3] / "jobs" / "events.schema.json"


def test_the_published_schema_is_the_codes() -> None:
    assert json.loads(PUBLISHED.read_text()) == schema(), "`make schema` publishes it"


def test_names_are_those_that_programs_know() -> None:
    """None of these may change or go within version 1."""
    assert {event.event for event in EVENTS} == {
        *("started", "stage", "frames-done", "notice", "finished", "failed"),
        *("batch-started", "job-planned", "job-frames", "job-notice", "job-done", "job-failed"),
        *("batch-stopping", "batch-finished"),
    }
    assert json.loads(write_line(FramesDone(3))) == {
        "version": 1,
        "event": "frames-done",
        "frame_count": 3,
    }


def test_what_runs_print_is_valid(studio, mt) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    check = jsonschema.Draft202012Validator(json.loads(PUBLISHED.read_text())).validate
    draft = ("--source", studio.source(), "--driver", studio.driver(3), "--renderer", "texture")
    output = studio.folder / "out.mp4"
    manifest = studio.folder / "jobs.json"
    job = {"source": str(studio.source()), "driver": str(studio.driver(3)), "renderer": "texture"}
    jobs = [{**job, "output": "a.mp4"}, {**job, "driver": "nowhere", "output": "b.mp4"}]
    manifest.write_text(json.dumps({"version": 1, "jobs": jobs}))
    told = []
    for command, code in (
        (("run", *draft, "-o", output), 0),
        (("run", *draft, "-o", output), 2),  # it is there already
        (("batch", "run", manifest, "--workers", 1), 1),
    ):
        result = mt(*command, "--json")
        assert result.code == code, result.err
        told += [json.loads(line) for line in result.out.splitlines()]
    for line in told:
        check(line)
    assert {line["event"] for line in told} >= {
        *("started", "stage", "frames-done", "finished", "failed"),
        *("batch-started", "job-planned", "job-frames", "job-done", "job-failed"),
        "batch-finished",
    }
    with pytest.raises(jsonschema.ValidationError):
        check({**told[0], "version": 2})
