"""The report of a batch: what it tells of each job, and that it is good to look at."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from motion_transfer.batch.report import _duration, write_report
from motion_transfer.batch.run import read_batch


@pytest.fixture
def report(tmp_path: Path) -> Path:
    """Of three jobs: a video, a picture, and one that failed; nothing of it was ever rendered."""
    for name in ("photos", "out"):
        (tmp_path / name).mkdir()
    photo = {"source": "photos/../photos/me.png", "driver": "people:walk"}
    jobs = [
        {**photo, "output": "a <b>.mp4", "frames": "3:9", "background": "photo"},
        {**photo, "output": "still.png", "driver": "/far/away/from/here.mkv"},
        {**photo, "output": "bad.mp4"},
    ]
    manifest = tmp_path / "shoot.json"
    manifest.write_text(json.dumps({"version": 1, "output_root": "out", "jobs": jobs}))
    batch = read_batch(manifest)
    told = [
        {"status": "done", "frames": 1, "seconds": 3725.0, "poster": True},
        {"status": "done", "frames": 80, "seconds": 26.6},
        {"status": "failed", "seconds": 0.4, "error": "no & never", "ended": "2026-01-02T03:04:05"},
    ]
    for job, record in zip(batch.jobs, told, strict=True):
        output = job.options.output
        if record["status"] == "done":
            output.write_bytes(b"")
        batch.state.records[str(output)] = {"output": str(output), "name": job.name, **record}
    return write_report(batch.jobs, batch.state)


def test_facts_are_told_from_the_manifests_folder(report: Path) -> None:
    facts = json.loads((report.parent / "report.json").read_text())
    assert facts["format"] == "batch-report-2"
    assert (facts["manifest"], facts["frames"], facts["seconds"]) == ("shoot.json", 81, 3752.0)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]\d\d:\d\d", facts["made"])
    video, still, bad = facts["jobs"]
    assert (video["source"], video["driver"]) == ("photos/me.png", "people:walk")
    assert video["options"] == {"frames": "3:9", "background": "photo"}
    assert still["driver"] == "/far/away/from/here.mkv"
    assert still["options"] == {}
    assert [job["plays"] for job in facts["jobs"]] == ["video", "picture", "video"]
    assert (bad["error"], bad["ended"]) == ("no & never", "2026-01-02T03:04:05")


def test_the_page_plays_results_and_escapes_what_it_tells(report: Path) -> None:
    page = report.read_text()
    assert re.search(r'<video [^>]*preload="none" src="../a%20%3Cb%3E.mp4" poster="pict', page)
    assert '<img loading="lazy" src="../still.png"' in page
    assert "a &lt;b&gt;.mp4" in page
    assert "no &amp; never" in page
    assert "1 frame, 1:02:05 h of work" in page
    assert "81 frames, 1:02:32 h of work" in page
    assert page.count("<video") == 1  # a job that failed has nothing to play
    assert not re.search(r'(src|href)="(https?:)?//', page)  # it is looked at without a network


def test_durations_are_words() -> None:
    assert [_duration(s) for s in (0, 59.94, 185, 7385)] == [
        *("0.0 s", "59.9 s", "3:05 min", "2:03:05 h"),
    ]


def test_it_fits_a_phone_and_filters(report: Path, browser) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.goto(report.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    counted = page.locator("#filter output")
    page.fill("input[type=search]", "NEVER no")
    assert counted.inner_text() == "1 of 3"
    assert page.locator("article:visible h2").all_inner_texts() == ["bad.mp4"]
    page.fill("input[type=search]", "")
    page.select_option("select", "done")
    assert counted.inner_text() == "2 of 3"
