"""No room for the output: one line that says so, and nothing left behind."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

FULL = ["out.mp4", "out"]
LIMITED = ["out.mkv", "out.gif", "out"]
LIMIT_BYTES = 200


def run(studio, output: Path, **settings) -> subprocess.CompletedProcess[str]:
    arguments = ["run", "--renderer", "texture", "--source", studio.source()]
    arguments += ["--driver", studio.driver(20), "-o", output]
    if output.suffix == ".mkv":
        arguments += ["--codec", "ffv1"]
    command = [sys.executable, "-B", "-m", "motion_transfer", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **settings)


@pytest.mark.parametrize("name", FULL)
def test_a_full_disk(studio, tiny_disk: Path, name: str) -> None:
    result = run(studio, tiny_disk / name)
    assert result.returncode == 2
    assert result.stderr == (
        f"mt: cannot write {tiny_disk / name}: the disk is full; free some space or write"
        " elsewhere\n"
    )
    assert list(tiny_disk.iterdir()) == []


@pytest.mark.parametrize("name", LIMITED)
def test_a_limit_on_file_sizes(studio, name: str) -> None:
    folder = studio.folder / "results"
    folder.mkdir()
    result = run(
        studio,
        folder / name,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, LIMIT_BYTES)),
    )
    assert result.returncode == 2
    assert result.stderr == (
        f"mt: cannot write {folder / name}: the file would exceed the largest size allowed here\n"
    )
    assert list(folder.iterdir()) == []
