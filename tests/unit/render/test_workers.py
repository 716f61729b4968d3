"""Worker processes: they do not hear Ctrl-C, are replaced when they die, and end when told."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
from processes import die_in_mid_result

from motion_transfer.render.workers import LocalWorkers


def test_workers_hear_no_ctrl_c_and_are_replaced(tmp_path: Path) -> None:
    workers = LocalWorkers(1, tmp_path / "scratch")
    try:
        answer = workers.submit(0, os.getpid)
        (child,) = multiprocessing.active_children()
        assert child.pid is not None
        os.kill(child.pid, signal.SIGINT)  # it has only just begun
        assert answer.result(300) == child.pid
        with pytest.raises(BrokenProcessPool):
            workers.submit(0, os._exit, 9).result(300)
        blob = workers.share("blob", b"content")
        assert workers.submit(0, blob).result(300) == b"content"
        workers.submit(0, time.sleep, 600)
    finally:
        began = time.monotonic()
        workers.stop(now=True)
    assert time.monotonic() - began < 300
    assert multiprocessing.active_children() == []
    assert not (tmp_path / "scratch").exists()


def test_half_a_result_is_not_waited_for(tmp_path: Path) -> None:
    workers = LocalWorkers(1, tmp_path / "scratch")
    try:
        with pytest.raises(BrokenProcessPool):
            workers.submit(0, die_in_mid_result).result(100)
        assert workers.submit(0, abs, -1).result(100) == 1
    finally:
        workers.stop(now=True)
