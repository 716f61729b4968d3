"""Write the JSON Schema of manifests to `jobs/manifest.schema.json`.

python tools/build_schema.py
"""

from __future__ import annotations

import json
from pathlib import Path

from motion_transfer.batch.manifest import schema

TARGET = Path(__file__).parents[1] / "jobs" / "manifest.schema.json"


def main() -> None:
    TARGET.write_text(json.dumps(schema(), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
