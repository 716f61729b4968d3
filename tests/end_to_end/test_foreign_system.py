"""The commands where Linux is made to behave as Windows does, see `foreign/sitecustomize.py`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import av
import pytest

ROOT = Path(__file__).parents[2]
FOREIGN = ROOT / "tests" / "foreign"
DEMO = ROOT / "motion_transfer" / "demo"
IMPORT_ALL = """
import importlib, pkgutil
import motion_transfer, nhrr_core
for package in (motion_transfer, nhrr_core):
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:  # an extra may be missing, a system's module may not
            if error.name in ("fcntl", "resource", "termios", "pwd", "grp"):
                raise
"""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="it is Linux that is disguised")


def python(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run Python on a system that is not like Linux, with an old code page for its output."""
    environment = {
        **os.environ,
        "PYTHONPATH": f"{FOREIGN}{os.pathsep}{ROOT}",
        "PYTHONWARNDEFAULTENCODING": "1",
        "PYTHONWARNINGS": "ignore",
        "PYTHONIOENCODING": "cp1252",
    }
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(
        command, env=environment, capture_output=True, encoding="cp1252", check=False
    )


def mt(*arguments: str | Path) -> str:
    done = python("-m", "motion_transfer", *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("attempt", "error"),
    [
        ("import fcntl", "ModuleNotFoundError"),
        ("import os; os.sched_getaffinity(0)", "AttributeError"),
        ("import os; os.open('.', os.O_RDONLY)", "PermissionError"),
        ("import os; os.fsync(os.open(__import__('av').__file__, os.O_RDONLY))", "OSError"),
        ("f = open('a', 'w', encoding='ascii'); import os; os.replace('a', 'b')", "PermissionErr"),
        ("import multiprocessing as m; m.get_context('forkserver')", "ValueError"),
    ],
)
def test_the_disguise_holds(tmp_path: Path, monkeypatch, attempt: str, error: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert error in python("-c", attempt).stderr


def test_every_module_can_be_imported() -> None:
    done = python("-c", IMPORT_ALL)
    assert done.returncode == 0, done.stderr


def test_info_tells_the_cores() -> None:
    assert json.loads(mt("info", "--json"))["device"].endswith(f"{os.cpu_count()} cores")


@pytest.mark.parametrize("renderer", ["texture", "nhrr"])
def test_the_demo_becomes_a_video_and_nothing_else(tmp_path: Path, renderer: str) -> None:
    output = tmp_path / "füße → out.mp4"
    run = ("run", "--source", DEMO / "source.png", "--driver", DEMO / "driver.mkv")
    told = mt(*run, "--frames", ":4", "--renderer", renderer, "-o", output)
    assert r"füße \u2192 out.mp4: 4 frames" in told  # no code page of Windows has arrows
    mt(*run, "--frames", ":4", "--renderer", renderer, "-o", output, "--force")
    assert [item.name for item in tmp_path.iterdir()] == [output.name]
    with av.open(str(output)) as video:
        assert len(list(video.decode(video=0))) == 4


def test_a_batch_runs_in_processes_is_found_done_and_is_cleaned(tmp_path: Path) -> None:
    job = f"source: {DEMO}/source.png\n    driver: {DEMO}/driver.mkv\n    output"
    manifest = tmp_path / "jobs.yaml"
    manifest.write_text(
        "version: 1\noutput_root: out\n"
        'defaults:\n  renderer: texture\n  frames: "0:2"\n'
        f"jobs:\n  - {job}: a.mp4\n  - {job}: below/b.mp4\n",
        encoding="utf-8",
    )
    assert "2 done" in mt("batch", "run", manifest)
    assert "0 done, 2 up to date" in mt("batch", "run", manifest)
    mt("batch", "clean", manifest)
    left = {item.name for item in (tmp_path / "out").iterdir()}
    assert left == {"a.mp4", "below", "jobs.report"}


def test_what_lists_other_files_is_refused(tmp_path: Path) -> None:
    listing = tmp_path / "list.mp4"
    listing.write_text(f"ffconcat version 1.0\nfile {DEMO}/driver.mkv\n", encoding="utf-8")
    run = ("run", "--source", DEMO / "source.png", "--driver", listing, "-o", tmp_path / "out.mp4")
    done = python("-m", "motion_transfer", *run)
    assert done.returncode == 2
    assert "is a list of other files" in done.stderr
