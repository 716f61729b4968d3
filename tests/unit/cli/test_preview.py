"""What `mt preview` shows, from what was typed."""

from __future__ import annotations

from pathlib import Path

import pytest

from motion_transfer.cli.preview import _options_of_words


def test_what_is_chosen_on_the_page_has_something_in_its_place() -> None:
    options = _options_of_words({"source": (), "driver": None, "output": None})
    assert options.source[0].is_file()
    assert options.output.suffix == ".mp4"
    given = {"source": ("in/anna.png",), "driver": "in/walk.mkv", "output": "out/x.gif"}
    assert _options_of_words(given).output == Path("out/x.gif")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--source", "a.png", "--frame", "1"), "--driver is missing; give a source and a driver"),
        (("--source", "a.png", "--driver", "d", "--frame", "1"), "--frame needs -o FILE.png"),
        (("jobs.yaml", "--driver", "d"), "says what its jobs do; leave out --driver"),
        (("jobs.yaml", "--job", "7"), "job 7 asked for, but jobs.yaml has 1, from 0"),
    ],
)
def test_what_is_refused(mt, tmp_path: Path, monkeypatch, words, reason: str) -> None:
    monkeypatch.chdir(tmp_path)
    job = "{source: a.png, driver: d, output: a.mp4}"
    Path("jobs.yaml").write_text(f"version: 1\njobs: [{job}]\n")
    refused = mt("preview", *words)
    assert (refused.code, refused.out) == (2, "")
    assert reason in refused.err
