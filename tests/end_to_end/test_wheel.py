"""The wheel: what is in it, what it asks for, and what it leaves as it is."""

from __future__ import annotations

import shutil
import subprocess
import sys
from email import message_from_bytes
from email.message import Message
from pathlib import Path
from zipfile import ZipFile

import pytest

pytest.importorskip("packaging")
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
MOST_BYTES = 32 << 20  # 28 MiB of it are weights and the demo
NOT_PACKED = shutil.ignore_patterns("__pycache__")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> ZipFile:
    """Build it from a copy: setuptools leaves things beside what it builds."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in ("motion_transfer", "nhrr_core", "tests", "benchmarks", "tools"):
        shutil.copytree(ROOT / name, folder / name, ignore=NOT_PACKED)
    for name in ("pyproject.toml", "README.md", "LICENSE", "NOTICE"):
        shutil.copy(ROOT / name, folder)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", ".", "-w", "built"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if "setuptools>=77" in done.stderr and done.returncode:
        pytest.skip("building needs an index that has setuptools")
    assert done.returncode == 0, done.stderr
    (built,) = (folder / "built").iterdir()
    return ZipFile(built)


@pytest.fixture(scope="module")
def metadata(wheel: ZipFile) -> Message:
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return message_from_bytes(wheel.read(name))


def test_nothing_stray_is_in_it(wheel: ZipFile) -> None:
    top = {name.split("/")[0] for name in wheel.namelist()}
    assert {name for name in top if not name.endswith(".dist-info")} == {
        "motion_transfer",
        "nhrr_core",
    }
    files = (f for p in ("motion_transfer", "nhrr_core") for f in (ROOT / p).rglob("*"))
    ours = {file.relative_to(ROOT).as_posix() for file in files if file.is_file()}
    packed = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert packed == {name for name in ours if "__pycache__" not in name}


def test_its_size_is_sane(wheel: ZipFile) -> None:
    assert Path(str(wheel.filename)).stat().st_size < MOST_BYTES


def test_licences_are_in_it(wheel: ZipFile) -> None:
    names = [name.partition(".dist-info/")[2] for name in wheel.namelist()]
    assert {"licenses/LICENSE", "licenses/NOTICE"} <= set(names)
    assert "motion_transfer/demo/LICENSE.md" in wheel.namelist()


def test_a_users_torch_stays(metadata: Message) -> None:
    asked = [Requirement(line) for line in metadata.get_all("Requires-Dist", [])]
    (torch,) = (one for one in asked if one.name == "torch")
    for kept in ("2.6.0", "2.7.1+cu126", "2.13.0+cpu", "2.15.0+cu130", "2.20.0"):
        assert kept in torch.specifier
    for refused in ("2.5.1", "3.0.0"):
        assert refused not in torch.specifier


def test_what_is_installed_for_developers_is_one_torch() -> None:
    for lock in ("requirements.lock", "requirements-dev.lock"):
        lines = (ROOT / lock).read_text(encoding="utf-8").splitlines()
        assert "torch==2.13.0" in lines
