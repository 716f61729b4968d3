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
        ("motion_transfer/media/work.py", "import motion_transfer.render.options"),
        ("motion_transfer/weights/checkpoint.py", "import motion_transfer.cli.main"),
        ("motion_transfer/render/run.py", "import motion_transfer.api"),
        ("motion_transfer/render/engine.py", "import motion_transfer.evaluation.framing"),
        ("motion_transfer/training/step.py", "import motion_transfer.render.options"),
        ("motion_transfer/drawing/canvas.py", "import motion_transfer.render.options"),
        ("motion_transfer/drawing/source.py", "import motion_transfer.estimate.opening"),
        ("motion_transfer/drawing/window.py", "import motion_transfer.people"),
        ("motion_transfer/estimate/clip.py", "import motion_transfer.people"),
        ("motion_transfer/estimate/clip.py", "import motion_transfer.training.iuv.samples"),
        ("motion_transfer/render/driver.py", "import motion_transfer.people.figure.body"),
        ("motion_transfer/training/iuv/samples.py", "import motion_transfer.people.dataset"),
        ("motion_transfer/people/figure/body.py", "import motion_transfer.people.person"),
        ("motion_transfer/training/pairs.py", "import motion_transfer.evaluation.report"),
        ("motion_transfer/evaluation/report.py", "import PIL.Image"),
        ("motion_transfer/errors.py", "import motion_transfer.media.work"),
        ("motion_transfer/option.py", "import motion_transfer.media.work"),
        ("motion_transfer/training/step.py", "import accelerate"),
        ("motion_transfer/batch/schedule.py", "import ray"),
        ("motion_transfer/render/content.py", "import motion_transfer.batch.run"),
        ("motion_transfer/cli/run.py", "import av"),
        ("motion_transfer/preview/views.py", "import imageio.v3"),
        ("motion_transfer/media/iuv/stream.py", "import motion_transfer.media.iuv.dump"),
        ("nhrr_core/texture.py", "import cv2"),
        ("nhrr_core/config.py", "import motion_transfer.errors"),
    ],
)
def test_a_forbidden_import_is_noticed(copy: Path, module: str, line: str) -> None:
    with (copy / module).open("a") as file:
        file.write(f"\n{line}\n")
    result = lint(copy)
    assert result.returncode == 1, result.stdout
    assert any(f" {count} broken" in result.stdout for count in (1, 2, 3))
