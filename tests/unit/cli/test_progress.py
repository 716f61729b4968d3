"""Events as a person sees them, and as a program reads them."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path

import pytest

from motion_transfer.batch import events
from motion_transfer.cli.batch import _reporter
from motion_transfer.cli.progress import CountBar, JsonPrinter, Reporter, choose_listener, describe
from motion_transfer.events import Event, Finished, FramesDone, Notice, Stage, Started

FINISHED = Finished(Path("out.mp4"), 60, 2.0, "texture", 4.0, 3.0)
STORY: list[Event] = [
    Stage("scan", 3),
    FramesDone(3),
    Notice("frames 1:2 show nobody"),
    Started("texture", 3, 64, 96, "25"),
    Stage("render", 3),
    FramesDone(2),
    FramesDone(1),
    FINISHED,
]


def tell(listener) -> None:
    for event in STORY:
        listener(event)


def test_json_is_one_object_a_line(capsys: pytest.CaptureFixture) -> None:
    tell(choose_listener(quiet=False, as_json=True))
    out, err = capsys.readouterr()
    lines = [json.loads(line) for line in out.splitlines()]
    assert [line["event"] for line in lines] == [e.event for e in STORY]
    assert {line["version"] for line in lines} == {1}
    assert lines[-1]["output"] == "out.mp4"
    assert err == ""
    assert isinstance(choose_listener(quiet=True, as_json=True), JsonPrinter)


def test_a_person_reads_notices_and_one_line(capsys: pytest.CaptureFixture) -> None:
    tell(choose_listener(quiet=False, as_json=False))
    assert capsys.readouterr() == (
        "wrote out.mp4: 60 frames, 2.00 s (texture renderer: a draft, no network; 4.0 s in all,"
        " 20 frames/s while rendering)\n",
        "mt: note: frames 1:2 show nobody\n",
    )


def test_quiet_is_silent(capsys: pytest.CaptureFixture) -> None:
    tell(choose_listener(quiet=True, as_json=False))
    assert capsys.readouterr() == ("", "")


def test_the_bar_goes_away(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.StringIO()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.delenv("CI", raising=False)
    tell(Reporter(quiet=False))
    assert "reading driver" in terminal.getvalue()
    assert "rendering" in terminal.getvalue()
    assert terminal.getvalue().split("\r")[-1] == ""


@pytest.mark.parametrize("reason", ["CI", "no terminal", "no columns", "dumb"])
def test_a_log_gets_lines(monkeypatch: pytest.MonkeyPatch, reason: str) -> None:
    """No sooner than after ten seconds and a tenth of the work; and no carriage returns."""
    log = io.StringIO()
    monkeypatch.setattr("sys.stderr", log)
    monkeypatch.setattr(log, "isatty", lambda: reason != "no terminal")
    monkeypatch.setattr(log, "fileno", lambda: 2)
    monkeypatch.setenv("TERM", "dumb" if reason == "dumb" else "xterm")
    monkeypatch.setenv("CI", "true" if reason == "CI" else "")
    columns = 0 if reason == "no columns" else 80
    monkeypatch.setattr("os.get_terminal_size", lambda _file: os.terminal_size((columns, 24)))
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    reporter = Reporter(quiet=False)
    reporter(Stage("render", 200))
    for _ in range(100):
        now += 0.5
        reporter(FramesDone(1))
    assert log.getvalue().splitlines() == [
        "mt: rendering: 20 of 200 frames, 10%, about 1:30 left",
        "mt: rendering: 40 of 200 frames, 20%, about 1:20 left",
        "mt: rendering: 60 of 200 frames, 30%, about 1:10 left",
        "mt: rendering: 80 of 200 frames, 40%, about 1:00 left",
        "mt: rendering: 100 of 200 frames, 50%, about 0:50 left",
    ]
    now += 61  # slow work is not to be taken for stuck
    reporter(FramesDone(1))
    assert "101 of 200 frames" in log.getvalue().splitlines()[-1]
    assert "\r" not in log.getvalue()


@pytest.mark.parametrize(
    ("frames", "seconds", "words"),
    [
        (1, 2.0, "1 frame, 0.04 s (texture renderer: a draft, no network; 4.0 s in all)"),
        (30, 60.0, "in all, 2.0 s a frame while rendering)"),
        (30, 15.0, "in all, 2 frames/s while rendering)"),
        (30, 0.0, "30 frames"),
    ],
)
def test_words_fit_their_numbers(frames: int, seconds: float, words: str) -> None:
    assert words in describe(Finished(Path("a"), frames, frames / 25, "texture", 4.0, seconds))


def test_a_batch_says_what_failed_even_if_it_is_to_be_quiet(capsys: pytest.CaptureFixture) -> None:
    story = [
        events.BatchStarted(2, 1),
        events.JobPlanned("a.mp4", 3, 0),
        events.JobFrames("a.mp4", 3),
        events.JobNotice("a.mp4", "nobody found"),
        events.JobDone("a.mp4", Path("out/a.mp4"), 3, 1.5),
        events.JobFailed("b.mp4", "it is gone"),
        events.BatchFinished(1, 0, 1, 0, 2.0, 1),
    ]
    failed = "mt: failed: b.mp4: it is gone\n"
    for quiet, out, err in (
        (
            False,
            "wrote out/a.mp4: 3 frames (1.5 s of work)\n"
            "1 done, 0 up to date, 1 failed, 0 left; 2.0 s, 1 source prepared\n",
            f"mt: note: a.mp4: nobody found\n{failed}",
        ),
        (True, "", failed),
    ):
        with CountBar("", unit="frame", quiet=quiet) as bar:
            listener = _reporter(bar, quiet=quiet)
            for event in story:
                listener(event)
        assert capsys.readouterr() == (out, err)
