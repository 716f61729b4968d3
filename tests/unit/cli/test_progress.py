"""Events as a person sees them, and as a program reads them."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest

from motion_transfer.batch import events
from motion_transfer.cli.batch import _reporter
from motion_transfer.cli.progress import CountBar, JsonPrinter, Reporter, choose_listener
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
    assert [line["event"] for line in lines] == [type(e).__name__.lower() for e in STORY]
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
    tell(Reporter(show_bar=True, quiet=False))
    assert "reading driver" in terminal.getvalue()
    assert "rendering" in terminal.getvalue()
    assert terminal.getvalue().split("\r")[-1] == ""


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
            "wrote out/a.mp4: 3 frames (2 frames/s)\n"
            "1 done, 0 up to date, 1 failed, 0 left; 2.0 s, 1 sources prepared\n",
            f"mt: note: a.mp4: nobody found\n{failed}",
        ),
        (True, "", failed),
    ):
        with CountBar("", unit="frame", quiet=quiet) as bar:
            listener = _reporter(bar, quiet=quiet)
            for event in story:
                listener(event)
        assert capsys.readouterr() == (out, err)
