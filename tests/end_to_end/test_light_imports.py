"""What a run does not need is not imported: torch takes a second, SciPy half of one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = (
    "torch",
    "scipy",
    "pydantic",
    "jinja2",
    "starlette",
    "warp",
    "anny",
)
RUN = f"""
import sys
from motion_transfer.cli.main import entry_point
try:
    entry_point()
finally:
    print("imported:", *(name for name in {HEAVY} if name in sys.modules))
"""


def imported_by(*arguments: str | Path) -> list[str]:
    """Run a command in a process of its own; give what it imported of what is heavy."""
    command = [sys.executable, "-c", RUN, *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    told = [line for line in result.stdout.splitlines() if line.startswith("imported:")]
    return told[0].split()[1:]


@pytest.mark.parametrize("several", [False, True])
def test_a_draft_needs_nothing_heavy(studio, several: bool) -> None:
    sources = [studio.source(), *([studio.source("again")] if several else [])]
    told = [word for source in sources for word in ("--source", source)]
    run = ("run", *told, "--driver", studio.driver(2), "-o", studio.folder / "out.mp4")
    assert not imported_by(*run, "--renderer", "texture")


def test_the_network_needs_no_torch(studio, checkpoint: Path) -> None:
    run = ("run", "--source", studio.source(), "--driver", studio.driver(2))
    output = studio.folder / "out.mp4"
    assert not imported_by(*run, "-o", output, "--weights", checkpoint, "--engine", "openvino")


def test_neither_does_keeping_a_source(studio, checkpoint: Path) -> None:
    kept = studio.folder / "me.mtsource"
    save = ("source", "save", kept, "--source", studio.source(), "--weights", checkpoint)
    assert not imported_by(*save)
    run = ("run", "--source", kept, "--driver", studio.driver(2), "--weights", checkpoint)
    assert not imported_by(*run, "-o", studio.folder / "out.mp4", "--engine", "openvino")


def test_neither_does_telling_what_a_file_holds(mt, studio, checkpoint: Path) -> None:
    output = studio.folder / "out.png"
    run = ("run", "--source", studio.source(), "--driver", studio.driver(1), "-o", output)
    mt(*run, "--renderer", "texture", "-q")
    # pydantic reads what an output says of itself
    told = {path: imported_by("inspect", path) for path in (studio.driver(1), checkpoint, output)}
    assert told == {studio.driver(1): [], checkpoint: [], output: ["pydantic"]}
    assert imported_by("info", output) == ["pydantic"]
