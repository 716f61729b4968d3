"""Faults of the file system in the middle of a run: one line, nothing half-written."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from motion_transfer.drawing.renderers import texture
from motion_transfer.media.work import Journal, work_path
from motion_transfer.render import run as run_module


def full(*_: object, **__: object) -> Any:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture
def render(studio, draft) -> Callable[[], Any]:
    """Render two frames to `out.mkv`, losslessly."""
    source, driver = studio.source(), studio.driver(2)
    output = studio.folder / "out.mkv"
    return lambda: draft(*("--source", source, "--driver", driver, "-o", output, "--codec", "ffv1"))


@pytest.mark.parametrize(
    ("owner", "name", "kept"),
    [
        (Journal, "append", False),
        (run_module, "join_segments", True),
        (run_module.WorkFolder, "publish", True),
    ],
    ids=["journal", "joining", "publishing"],
)
def test_a_disk_that_fills_up_is_one_line_and_work_goes_on(
    studio, render, monkeypatch, owner: object, name: str, kept: bool
) -> None:
    output: Path = studio.folder / "out.mkv"
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, full)
        failed = render()
    message = f"mt: cannot write {output}: the disk is full; free some space or write elsewhere"
    assert (failed.code, failed.err.splitlines()[-1]) == (2, message)
    assert not output.exists()
    assert work_path(output).exists() == kept
    again = render()
    assert again.code == 0
    assert ("2 of 2 frames were finished before" in again.err) == kept
    assert not work_path(output).exists()


def test_a_work_folder_that_is_removed_meanwhile_is_one_line(studio, render, monkeypatch) -> None:
    output: Path = studio.folder / "out.mkv"
    join = run_module.join_segments

    def remove(*arguments: Any) -> None:
        shutil.rmtree(work_path(output))
        join(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "join_segments", remove)
        failed = render()
    assert failed.code == 2
    assert failed.err == (
        f"mt: cannot write {output}: a folder was removed that it is written in; start again\n"
    )
    assert not output.exists()
    assert render().code == 0


def test_memory_that_runs_out_while_drawing_is_one_line_with_a_remedy(render, monkeypatch) -> None:
    def starve(*_: object) -> None:
        raise MemoryError("Unable to allocate 1.42 MiB")

    monkeypatch.setattr(texture.TextureRenderer, "render", starve)
    failed = render()
    assert failed.code == 1
    assert failed.err.startswith("mt: the memory is used up; give fewer --workers, ")
    assert failed.err.count("\n") == 1
