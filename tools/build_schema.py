"""Write the JSON Schemas of manifests and of events to `jobs/`.

python tools/build_schema.py
"""

from __future__ import annotations

import json
from pathlib import Path

from motion_transfer.batch import manifest
from motion_transfer.cli import event_lines

JOBS = Path(__file__).parents[1] / "jobs"


def main() -> None:
    for name, schema in (("manifest", manifest.schema()), ("events", event_lines.schema())):
        text = json.dumps(schema, indent=1) + "\n"
        (JOBS / f"{name}.schema.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
