"""What all tests share: the commands, a tiny checkpoint, a folder for painted people."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from studio import Studio

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch: images are tiny, cores are shared
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # commands that tests start are compiled once

PREPARE_BODY = "from motion_transfer.people.figure.body import load_body_model; load_body_model()"


def pytest_sessionstart(session: pytest.Session) -> None:
    """Start what takes minutes on a fresh machine, so that it is done when it is needed.

    The process goes on by itself; a test that comes too early waits for it (a lock sees to that).
    """
    is_worker = hasattr(session.config, "workerinput")
    cache = Path(os.environ.get("ANNY_CACHE_DIR", Path.home() / ".cache" / "anny"))
    if not is_worker and find_spec("anny") and not any(cache.glob("v*/build_compact*")):
        process = subprocess.Popen([sys.executable, "-c", PREPARE_BODY], stderr=subprocess.DEVNULL)
        process.returncode = 0  # nobody waits for it, and Popen need not warn of that


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that need the body model come last."""
    items.sort(key=lambda item: "body_model" in getattr(item, "fixturenames", ()))


@pytest.fixture(scope="session")
def body_model():
    """The parametric body; skipped, with the reason, where the extra is not installed."""
    pytest.importorskip("anny", reason="needs the `people` extra")
    from motion_transfer.people.figure.body import load_body_model

    return load_body_model()


@pytest.fixture
def studio(tmp_path: Path) -> Studio:
    return Studio(tmp_path)


@dataclass(frozen=True)
class Outcome:
    """What a command left: exit code and everything printed, by libraries too."""

    code: int
    out: str
    err: str


@pytest.fixture
def mt(capfd: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """The `mt` command, run in this process."""
    from motion_transfer.cli.main import main

    def call(*arguments: object) -> Outcome:
        capfd.readouterr()
        before = signal.getsignal(signal.SIGTERM)
        try:
            code = main([str(argument) for argument in arguments])
        finally:
            signal.signal(signal.SIGTERM, before)
        return Outcome(code, *capfd.readouterr())

    return call


@pytest.fixture
def draft(mt: Callable[..., Outcome]) -> Callable[..., Outcome]:
    """`mt run` with the texture renderer: exact colours, and no network to load."""
    return lambda *arguments: mt("run", "--renderer", "texture", *arguments)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser without a window; skipped, with the reason, where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    names = ("chromium", "chromium-browser", "google-chrome")
    program = next(filter(None, map(shutil.which, names)), None)
    if program is None:
        pytest.skip("needs a chromium")
    with playwright.sync_playwright() as player:
        arguments = ["--headless", "--no-sandbox", "--disable-gpu"]
        browser = player.chromium.launch(executable_path=program, args=arguments)
        yield browser
        browser.close()


@pytest.fixture
def few_frames(monkeypatch: pytest.MonkeyPatch) -> int:
    """The demos, which have no option for it, draw so many of their frames."""
    from motion_transfer.render import run

    whole, count = run.run, 6
    monkeypatch.setattr(run, "run", lambda o, *more: whole(replace(o, frames=(0, count)), *more))
    return count


@pytest.fixture(scope="session")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny untrained model, the same in every run."""
    import torch

    from motion_transfer.weights.checkpoint import save_checkpoint
    from nhrr_core import ModelConfig, NeuralReRenderer

    config = ModelConfig(
        feature_width=4, render_width=4, residual_blocks=1, image_size=64, texture_size=64
    )
    with torch.random.fork_rng():
        torch.manual_seed(0)
        model = NeuralReRenderer(config)
    path = tmp_path_factory.mktemp("weights") / "tiny.safetensors"
    save_checkpoint(path, model, notes={"licence": "CC0"})
    return path


@pytest.fixture(scope="session")
def samples() -> Path:
    """Real photos and drivers, which cannot be shipped."""
    folder = os.environ.get("MT_SAMPLES")
    if not folder or not Path(folder).is_dir():
        pytest.skip("MT_SAMPLES names no folder with sample photos and drivers")
    return Path(folder)


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
