"""Killed at any moment and started again, a run ends with the bytes of one that never was."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from processes import wait_until_gone

from motion_transfer import render_video
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Notice, Stage, Started
from motion_transfer.media.work import Journal, work_path
from motion_transfer.render.plan import CHUNK_FRAMES

FRAMES = 3 * CHUNK_FRAMES + 11
draw = partial(render_video, renderer="texture")
KILLS = int(os.environ.get("MT_KILLS", "2"))  # a long run sets more


def command(studio, output: Path, *more: object) -> list[str]:
    words = [
        *("run", "--renderer", "texture", "--source", studio.folder / "person.png"),
        *("--driver", studio.folder / "driver.npy", "-o", output, "--json", *more),
    ]
    return [sys.executable, "-m", "motion_transfer", *map(str, words)]


@pytest.fixture
def inputs(studio) -> None:
    studio.source()
    studio.array(FRAMES)


def killed(words: list[str], after_events: int) -> int | None:
    """Start a run and kill it after so many events; its exit code if it ended before that."""
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stdout is not None
        for count, _ in enumerate(process.stdout):
            if count == after_events:
                process.kill()
                break
        code = process.wait()
    wait_until_gone(process.pid)
    return None if code == -signal.SIGKILL else code


def content(path: Path) -> dict[str, bytes]:
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return {file.name: file.read_bytes() for file in files}


@pytest.mark.parametrize("name", ["out.mp4", "out"])
def test_kills_change_nothing(studio, inputs, name: str) -> None:
    whole = studio.folder / "whole" / name
    subprocess.run(command(studio, whole), check=True, capture_output=True)
    output = studio.folder / "killed" / name
    moments = random.Random(name)
    for number in range(KILLS):
        code = killed(command(studio, output, "--workers", 1 + number % 3), moments.randrange(190))
        assert code in (None, 0)
        if code == 0:
            break
        assert {item.name for item in output.parent.glob("*")} <= {name, work_path(output).name}
        assert not output.exists() or content(output) == content(whole)
        entries = Journal(work_path(output) / "journal.jsonl").read()
        pieces = [entry["piece"] for entry in entries]
        assert len(set(pieces)) == len(pieces)  # what was finished is not done again
    if not output.exists() or work_path(output).exists():
        subprocess.run(command(studio, output), check=True, capture_output=True)
    assert content(output) == content(whole)
    assert [item.name for item in output.parent.iterdir()] == [name]


def events(studio, output: Path, *more: object) -> list[dict]:
    result = subprocess.run(
        command(studio, output, *more), check=True, capture_output=True, text=True
    )
    return [json.loads(line) for line in result.stdout.splitlines()]


def interrupt_midway(studio, output: Path) -> int:
    """Stop a run by Ctrl-C when at least one chunk is done; how many frames it says are kept."""
    with subprocess.Popen(
        command(studio, output, "--workers", 1),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        assert process.stdout is not None
        rendered, stage, notices = 0, "", []
        for line in process.stdout:
            event = json.loads(line)
            stage = event.get("name", stage)
            notices.append(event.get("message", ""))
            if event["event"] == "frames-done" and stage == "render":
                rendered += event["frame_count"]
                if rendered == 2 * CHUNK_FRAMES + 9:
                    process.send_signal(signal.SIGINT)
        assert process.wait() == 130
    kept = next(words for words in notices if "are kept" in words)
    return int(kept.split()[0])


def test_ctrl_c_keeps_chunks_and_the_next_run_does_only_the_rest(studio, inputs) -> None:
    output = studio.folder / "out.mp4"
    kept = interrupt_midway(studio, output)
    assert kept >= 2 * CHUNK_FRAMES
    assert not output.exists()
    before = (work_path(output) / "000000.nut").stat()
    told = events(studio, output)
    notices = [event["message"] for event in told if event["event"] == "notice"]
    assert notices == [f"{kept} of {FRAMES} frames were finished before; going on there"]
    assert before.st_size > 0
    assert output.exists()
    assert not work_path(output).exists()


def interrupted(studio, output: Path, **more: object) -> int:
    """Stop a run in this process after two chunks; how many frames are kept."""
    kept: list[int] = []
    rendered = 0

    def stop(event: object) -> None:
        nonlocal rendered
        if isinstance(event, Notice):
            kept.append(int(event.message.split()[0]))
        if isinstance(event, Stage):
            rendered = 0
        if isinstance(event, FramesDone):
            rendered += event.frame_count
            if rendered == 2 * CHUNK_FRAMES + 9:
                raise KeyboardInterrupt

    source, driver = studio.folder / "person.png", studio.folder / "driver.npy"
    with pytest.raises(KeyboardInterrupt):
        draw(source, driver, output, workers=1, listener=stop, **more)
    return kept[-1]


@pytest.mark.parametrize("change", ["driver", "source", "option", "restart"])
def test_a_changed_input_is_no_old_result(studio, inputs, change: str) -> None:
    output = studio.folder / "out.mp4"
    kept = interrupted(studio, output)
    more: dict = {}
    expected = 0
    if change == "driver":
        frames = np.load(studio.folder / "driver.npy")
        frames[CHUNK_FRAMES + 3] = frames[CHUNK_FRAMES + 4]
        np.save(studio.folder / "driver.npy", frames)
        expected = kept - CHUNK_FRAMES  # the chunk with the changed frame is drawn again
    elif change == "source":
        studio.source(colours={(2,): (1, 2, 3)})
    else:
        more = {"restart": True} if change == "restart" else {"background": "black"}
    told: list[object] = []
    source, driver = studio.folder / "person.png", studio.folder / "driver.npy"
    draw(source, driver, output, listener=told.append, **more)
    notices = [event.message.split()[0] for event in told if isinstance(event, Notice)]
    assert notices == ([str(expected)] if expected else [])
    fresh = draw(source, driver, studio.folder / "fresh.mp4", **more).output
    assert output.read_bytes() == fresh.read_bytes()


def test_a_held_frame_that_changed_is_drawn_again_wherever_it_is_shown(studio, inputs) -> None:
    """The second chunk begins with frames that repeat the first one's last."""
    output, driver = studio.folder / "out.mp4", studio.folder / "driver.npy"
    frames = np.load(driver)
    frames[CHUNK_FRAMES : CHUNK_FRAMES + 3] = 0
    np.save(driver, frames)
    assert interrupted(studio, output, missing="hold") == 2 * CHUNK_FRAMES
    held = frames[CHUNK_FRAMES - 1]
    held[held[..., 0] == 2, 1] ^= 1  # the same person in the same place
    np.save(driver, frames)
    told: list[object] = []
    source = studio.folder / "person.png"
    draw(source, driver, output, listener=told.append, missing="hold")
    notices = [event.message for event in told if isinstance(event, Notice)]
    assert [words.split(",")[0] for words in notices] == [f"nobody found in 3 of {FRAMES} frames"]
    fresh = draw(source, driver, studio.folder / "fresh.mp4", missing="hold").output
    assert output.read_bytes() == fresh.read_bytes()


def test_what_is_held_is_part_of_what_is_kept(studio, inputs) -> None:
    output, driver = studio.folder / "out.mp4", studio.folder / "driver.npy"
    frames = np.load(driver)
    frames[5] = 0
    np.save(driver, frames)
    kept = interrupted(studio, output, missing="hold")
    told: list[object] = []
    source = studio.folder / "person.png"
    draw(source, driver, output, listener=told.append)
    notices = [event.message for event in told if isinstance(event, Notice)]
    assert notices[0].startswith(f"{kept - CHUNK_FRAMES} of {FRAMES} frames were finished")
    assert "background only" in notices[1]


def test_a_held_frame_that_changes_under_the_run_is_noticed(studio, inputs) -> None:
    frames = studio.walk(CHUNK_FRAMES + 2)
    frames[CHUNK_FRAMES:] = 0
    driver, rendered, stage = studio.driver(frames), 0, ""

    def change(event: object) -> None:
        nonlocal rendered, stage
        if isinstance(event, Stage):
            stage = event.name
        if isinstance(event, FramesDone) and stage == "render":
            rendered += event.frame_count
            if rendered == CHUNK_FRAMES:
                studio.image(f"driver/frame_{CHUNK_FRAMES - 1}_IUV.png", studio.iuv(9, 9))

    with pytest.raises(InputError, match=rf"frame_{CHUNK_FRAMES - 1}_IUV\.png has changed since"):
        draw(
            *(studio.source(), driver, studio.folder / "out.mp4"),
            workers=1,
            missing="hold",
            listener=change,
        )


def test_a_driver_that_changes_under_the_run_is_noticed(studio, inputs, monkeypatch) -> None:
    driver = studio.driver(5)

    def change(event: object) -> None:
        if isinstance(event, Started):
            studio.image("driver/frame_3_IUV.png", studio.iuv(9, 9))

    with pytest.raises(InputError, match=r"frame 3, .*frame_3_IUV.png has changed since"):
        draw(studio.source(), driver, studio.folder / "out.mp4", listener=change)
