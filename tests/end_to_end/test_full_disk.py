"""No room for the output: one line that says so, and nothing left behind."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
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


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system that holds one page."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    if os.geteuid() != 0 or mount is None:
        pytest.skip("only root can mount a small file system")
    command = [mount, "-t", "tmpfs", "-o", "size=4k", "tmpfs", str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no small file system can be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


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
