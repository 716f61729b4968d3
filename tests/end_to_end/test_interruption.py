"""Stopped midway, a run leaves whole chunks only, and an older output stays as it was."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from processes import members, wait_until_gone

from motion_transfer.media.work import work_path

LENGTH = 4000  # frames; far more than are rendered before the signal comes


def long_driver(studio) -> Path:
    """A folder of three files whose numbering has a gap to be held: long, but small on disk."""
    driver = studio.driver(3)
    studio.image(f"driver/frame_{LENGTH}_IUV.png", studio.iuv())
    return driver


def start(studio, *more: object) -> subprocess.Popen[str]:
    arguments = [
        *("run", "--renderer", "texture", "--source", studio.source()),
        *("--driver", long_driver(studio)),
        *("--missing", "hold", "-o", studio.folder / "new/out.mp4", "--json", *more),
    ]
    command = [sys.executable, "-m", "motion_transfer", *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command,
        stdout=pipe,
        stderr=pipe,
        text=True,
        preexec_fn=heed_interrupts,
        start_new_session=True,
    )


def heed_interrupts() -> None:
    """Ctrl-C works even where the tests themselves run in the background, which ignores it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def wait_for(process: subprocess.Popen[str], stage: str) -> None:
    """Read events until the stage has made progress."""
    assert process.stdout is not None
    current = None
    for line in process.stdout:
        event = json.loads(line)
        if event["event"] == "stage":
            current = event["name"]
        if event["event"] == "frames-done" and current == stage:
            return
    raise AssertionError(f"the run ended before the stage {stage}: {process.communicate()[1]}")


@pytest.mark.parametrize(
    ("number", "code", "word", "stage"),
    [
        (signal.SIGINT, 130, "interrupted", "scan"),
        (signal.SIGINT, 130, "interrupted", "render"),
        (signal.SIGTERM, 143, "terminated", "render"),
    ],
)
def test_nothing_half_written_is_left(
    studio, number: int, code: int, word: str, stage: str
) -> None:
    with start(studio) as process:
        before = {path for path in studio.folder.rglob("*") if "new" not in path.parts}
        wait_for(process, stage)
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == code
    assert errors.splitlines()[-1] == f"mt: {word}, nothing half-written was left behind"
    assert "Traceback" not in errors
    work = work_path(studio.folder / "new/out.mp4")
    kept = {work, work.parent, *work.glob("*.nut")} if stage == "render" else set()
    left = set(studio.folder.rglob("*")) - before - kept
    assert {path.name for path in left} <= {"journal.jsonl", "lock", "owner.json"}
    assert not left or kept
    assert not list(work.glob("*.part-*"))


def test_nobody_outlives_a_run_that_is_killed(studio) -> None:
    with start(studio, "--workers", 3) as process:
        wait_for(process, "render")
        session = os.getsid(process.pid)
        assert len(members(session)) > 3  # itself, and three at least that help
        process.kill()
        process.wait(60)
    wait_until_gone(session)
    again = studio.folder / "new/out.mp4"
    with start(studio, "--workers", 3, "--frames", ":200") as process:
        process.communicate(timeout=300)
    assert process.returncode == 0
    assert list(again.parent.iterdir()) == [again]


def test_an_older_output_survives(studio) -> None:
    output = studio.folder / "new/out.mp4"
    output.parent.mkdir()
    output.write_text("old")
    with start(studio, "--force") as process:
        wait_for(process, "render")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 130
    assert output.read_text() == "old"
    assert set(output.parent.iterdir()) <= {output, work_path(output)}


def test_a_closed_pipe_is_no_traceback(studio) -> None:
    with start(studio, "--frames", ":200") as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr is not None
        errors = process.stderr.read()
        process.wait(60)
    assert process.returncode not in (0, None)
    assert "Traceback" not in errors
    assert not (studio.folder / "new").exists()
