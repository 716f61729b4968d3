"""Imports point downwards: the contracts hold, and would notice if they did not."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINT = "from importlinter.cli import lint_imports; import sys; sys.exit(lint_imports())"


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", LINT],
        cwd=folder,
        env={"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The packages and their contracts, free to be broken."""
    for package in ("motion_transfer", "nhrr_core"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=lambda *_: {"__pycache__"})
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_the_contracts_hold(copy: Path) -> None:
    result = lint(copy)
    assert result.returncode == 0, result.stdout
    assert "0 broken" in result.stdout


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("motion_transfer/media/image.py", "import motion_transfer.render.options"),
        ("motion_transfer/weights/checkpoint.py", "import motion_transfer.cli.main"),
        ("motion_transfer/render/run.py", "import motion_transfer.api"),
        ("motion_transfer/render/sheet.py", "import motion_transfer.training.metrics"),
        ("motion_transfer/training/pairs.py", "import motion_transfer.evaluation.protocol"),
        ("motion_transfer/evaluation/sheet.py", "import PIL.Image"),
        ("motion_transfer/errors.py", "import motion_transfer.media.image"),
        ("motion_transfer/training/step.py", "import accelerate"),
        ("motion_transfer/batch/schedule.py", "import ray"),
        ("motion_transfer/render/content.py", "import motion_transfer.batch.run"),
        ("motion_transfer/cli/run.py", "import av"),
        ("motion_transfer/render/sheet.py", "import PIL.Image"),
        ("nhrr_core/texture.py", "import numpy"),
        ("nhrr_core/config.py", "import motion_transfer.errors"),
    ],
)
def test_a_forbidden_import_is_noticed(copy: Path, module: str, line: str) -> None:
    with (copy / module).open("a") as file:
        file.write(f"\n{line}\n")
    result = lint(copy)
    assert result.returncode == 1, result.stdout
    assert "1 broken" in result.stdout or "2 broken" in result.stdout
