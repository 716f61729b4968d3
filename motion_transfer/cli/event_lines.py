"""Events as `--json` prints them: one object a line, whose form is versioned and published.

Within a version events and fields may be added, and none is removed, renamed or given another
meaning; programs pass over what they do not know. `jobs/events.schema.json` says what there is.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from motion_transfer import events
from motion_transfer.batch import events as batch_events

VERSION = 1

AnyEvent = events.Event | batch_events.BatchEvent | events.Failed
EVENTS: tuple[Any, ...] = get_args(AnyEvent)


def write_line(event: AnyEvent) -> str:
    """Write an event as JSON, on one line."""
    fields = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(event).items()}
    return json.dumps({"version": VERSION, "event": event.event, **fields})


def schema() -> dict[str, Any]:
    """Make the JSON Schema of a line, as published in `jobs/events.schema.json`."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "motion-transfer event, a line of --json",
        "oneOf": [_schema_of(event) for event in EVENTS],
    }


def _schema_of(event: Any) -> dict[str, Any]:
    from pydantic import TypeAdapter  # takes a while, and only the schema needs it

    described = TypeAdapter(event).json_schema()
    properties = {"version": {"const": VERSION}, "event": {"const": event.event}}
    return {
        "title": event.event,
        "description": event.__doc__.replace("\n    ", " "),
        "type": "object",
        "properties": properties | described.get("properties", {}),
        "required": [*properties, *described.get("required", [])],
    }
