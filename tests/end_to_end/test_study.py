"""A user study from results to results: made, answered in a browser, scored."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
expect = playwright.expect
expect.set_options(timeout=30_000)  # ms

DESKTOP = {"viewport": {"width": 1280, "height": 800}}
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
ITEMS, REPEATS = 6, 3
REALISM = "Which looks more realistic?"
KEYS = {"left": "ArrowLeft", "right": "2"}
SERVE_SECONDS = 60

Choose = Callable[[str, str], str]
"""Which method is chosen, for a question and an item."""


@pytest.fixture
def study(studio, mt) -> Path:
    """A study of six items by two methods, with sources."""
    for number in range(ITEMS):
        for method, level in (("bright", 200), ("dark", 50)):
            picture = np.full((96, 64, 3), level + number, np.uint8)
            studio.image(f"{method}/me__pose{number}.png", picture)
    studio.image("photos/me.png", np.full((96, 64, 3), 128, np.uint8))
    folder = studio.folder / "study"
    methods = (studio.folder / "bright", studio.folder / "dark")
    result = mt("eval", "study", *methods, "--sources", studio.folder / "photos", "-o", folder)
    assert (result.code, result.err) == (0, "")
    assert "a reader is shown 6 of 6 pairs, 3 of them twice" in result.out
    return folder


class Reading:
    """A reader in front of the page, who knows the key."""

    def __init__(self, browser: Any, study: Path, address: str = "", **settings: Any) -> None:
        self.files = json.loads((study / "key.json").read_text())["files"]
        self.context = browser.new_context(accept_downloads=True, **settings)
        self.page = self.context.new_page()
        self.faults: list[str] = []
        self.page.on("console", lambda message: self.faults.append(message.text))
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.goto(address or (study / "page/index.html").as_uri())

    def at(self, place: str) -> None:
        """Wait until a question stands there and takes an answer."""
        expect(self.page.locator("#count")).to_have_text(place)
        expect(self.page.locator("#views")).to_have_attribute("aria-busy", "false")

    def sees(self) -> tuple[str, str, list[str]]:
        """The question, the item, and the methods from left to right."""
        question = "realism" if self.page.inner_text("#question") == REALISM else "identity"
        images = self.page.locator(".view .frame img").all()
        shown = [self.files[str(image.get_attribute("src"))].split(": ") for image in images]
        source = self.page.locator("#source img").get_attribute("src")
        assert shown[0][1] == shown[1][1] == self.files[str(source)].removeprefix("source: ")
        return question, shown[0][1], [method for method, _ in shown]

    def answer_all(self, press: Callable[[str], None], choose: Choose, start: int = 1) -> None:
        total = 2 * (ITEMS + REPEATS)
        for number in range(start, total + 1):
            self.at(f"{number} of {total}")
            question, item, methods = self.sees()
            press(("left", "right")[methods.index(choose(question, item))])
        expect(self.page.locator("#signing")).to_be_visible()

    def press(self, side: str) -> None:
        self.page.keyboard.press(KEYS[side])

    def tap(self, side: str) -> None:
        self.page.tap(f".view[data-side={side}]")

    def save(self, folder: Path) -> Path:
        """Sign off and save."""
        expect(self.page.locator("#download")).to_be_disabled()
        self.page.check("#agreed")
        with self.page.expect_download() as download:
            self.page.click("#download")
        file = folder / download.value.suggested_filename
        folder.mkdir(exist_ok=True)
        download.value.save_as(file)
        return file


def test_two_readers_from_files_to_results(studio, mt, browser, study: Path) -> None:
    """At a desk all is `bright`; on a phone `dark` is more realistic once, more alike thrice."""

    def at_the_phone(question: str, item: str) -> str:
        return "dark" if item[-1] in {"realism": "5", "identity": "012"}[question] else "bright"

    answers = study / "answers"
    desk = Reading(browser, study, **DESKTOP)
    desk.page.click("#begin")
    desk.answer_all(desk.press, lambda *_: "bright")
    desk.page.fill("#name", 'Zoë "Z"')
    first = desk.save(answers)

    phone = Reading(browser, study, **PHONE)
    phone.page.tap("#begin")
    phone.at("1 of 18")
    for side in ("left", "right"):  # whole, below each other, and large enough for a thumb
        box = phone.page.locator(f".view[data-side={side}]").bounding_box()
        assert box["width"] > 350
        assert box["height"] > 200
        assert box["y"] + box["height"] <= 844
    phone.answer_all(phone.tap, at_the_phone)
    second = phone.save(answers)
    assert desk.faults == phone.faults == []

    orders = [json.loads(file.read_text())["answers"] for file in (first, second)]
    assert [each["comparison"] for each in orders[0]] != [each["comparison"] for each in orders[1]]

    for answers in orders:
        before = {each["comparison"]: each["left"] for each in answers if not each["repeat"]}
        again = [each for each in answers if each["repeat"]]
        assert len(again) == REPEATS
        assert all(each["left"] != before[each["comparison"]] for each in again)

    scored = mt("eval", "study", "--score", first, second)
    assert (scored.code, scored.err) == (0, "")
    results = json.loads((study / "results/results.json").read_text())
    realism, identity = results["preferences"]
    assert (realism["question"], realism["method"], realism["other"]) == (
        *("realism", "bright", "dark"),
    )
    # by hand: Wilson's of 11 of 12; of two readers with 6 and 5 of 6, three draws are possible
    assert (realism["votes"]["count"], realism["votes"]["total"]) == (11, 12)
    assert realism["votes"]["low"] == pytest.approx(0.64612, abs=1e-4)
    assert realism["votes"]["high"] == pytest.approx(0.98514, abs=1e-4)
    assert realism["readers_interval"] == pytest.approx([10 / 12, 1])
    assert (realism["items_won"], realism["items_lost"], realism["items_tied"]) == (5, 0, 1)
    assert (identity["votes"]["count"], identity["votes"]["total"]) == (9, 12)
    assert identity["readers_interval"] == pytest.approx([0.5, 1])
    assert [each["observed"] for each in results["agreements"]] == [5 / 6, 1 / 2]
    assert [each["repeated"]["count"] for each in results["agreements"]] == [2 * REPEATS] * 2
    assert [reader["label"] for reader in results["readers"]] == ['Zoë "Z"', second.stem[-6:]]
    assert [reader["screen"] for reader in results["readers"]] == ["1280x800", "390x844"]

    lines = scored.out.splitlines()
    assert re.split(r" {2,}", lines[1])[1:4] == ["bright to dark", "11/12", "91.7 %"]
    assert "64.6 - 98.5" in lines[1]
    page = desk.context.new_page()
    page.goto((study / "results/index.html").as_uri())
    expect(page.locator("svg").first).to_have_attribute("aria-label", re.compile("91.7 %"))
    assert page.locator("figure small").first.inner_text().startswith("11 of 12 votes")
    assert 'Zoë "Z"' in page.inner_text("body")


def test_bad_answers_are_told_and_left_out(mt, browser, study: Path, studio) -> None:
    reading = Reading(browser, study, **DESKTOP)
    reading.page.click("#begin")
    reading.answer_all(reading.press, lambda *_: "dark")
    good = reading.save(studio.folder)
    edited, other = studio.folder / "edited.json", studio.folder / "other.json"
    edited.write_text(good.read_text().replace(': "left"', ': "right"', 1))
    other.write_text("{}")
    score = ("eval", "study", "--score", good, edited, other, "--key", study / "key.json")
    refused = mt(*score, "-o", studio.folder / "out")
    assert refused.code == 2
    told = refused.err.splitlines()
    assert len(told) == 3
    assert "edited.json was changed after it was signed off" in told[0]
    assert "other.json holds no answers" in told[1]
    assert not (studio.folder / "out").exists()
    scored = mt(*score, "-o", studio.folder / "out", "--skip-broken")
    assert scored.code == 0
    assert "left out" in scored.err
    assert "0/6" in scored.out
    again = mt(*score, "-o", studio.folder / "out", "--skip-broken")
    assert (again.code, "--force" in again.err) == (2, True)


def test_progress_survives_and_can_be_taken_back(browser, study: Path) -> None:
    reading = Reading(browser, study, **DESKTOP)
    page = reading.page
    page.click("#begin")
    reading.at("1 of 18")
    page.click("#source")
    expect(page.locator("#enlarged")).to_be_visible()
    page.keyboard.press("ArrowLeft")  # answers nothing behind the dialog
    page.keyboard.press("Escape")
    page.dblclick(".view[data-side=left]")  # is one answer
    reading.at("2 of 18")
    page.keyboard.press("ArrowRight")
    reading.at("3 of 18")
    second = reading.sees()
    page.reload()
    reading.at("3 of 18")
    assert reading.sees() == second
    page.keyboard.press("Backspace")
    reading.at("2 of 18")
    page.click("#back")
    reading.at("1 of 18")
    expect(page.locator("#back")).to_be_disabled()
    other = Reading(browser, study, **DESKTOP)
    expect(other.page.locator("#welcome")).to_be_visible()
    assert reading.faults == []


def test_videos_start_together_and_begin_again(studio, mt, browser) -> None:
    for method in ("bright", "dark"):
        (studio.folder / method).mkdir()
        walk = np.stack([studio.dress(iuv) for iuv in studio.walk(20)])
        studio.video(walk, name=f"{method}/me_walk.webm", codec="libvpx-vp9", pixels="yuv420p")
    folder = studio.folder / "study"
    made = mt("eval", "study", studio.folder / "bright", studio.folder / "dark", "-o", folder)
    assert "realism only" in made.err
    reading = Reading(browser, folder, **PHONE)
    page = reading.page
    expect(page.locator("#pair-count")).to_have_text("1 pair of videos")
    page.tap("#begin")
    reading.at("1 of 1")
    times = "() => [...document.querySelectorAll('video')].map((video) => video.currentTime)"
    begun_again, before = False, 0.0
    for _ in range(40):  # two seconds; they last two thirds of one
        one, other = page.evaluate(times)
        assert abs(one - other) < 0.25
        begun_again |= one < before
        before = one
        page.wait_for_timeout(50)
    assert begun_again
    page.tap("#replay")
    reading.tap("left")
    expect(page.locator("#signing")).to_be_visible()
    assert reading.faults == []


def test_a_served_page_takes_answers(browser, study: Path, mt) -> None:
    pytest.importorskip("starlette", reason="needs the `preview` extra")
    command = (*(sys.executable, "-m", "motion_transfer", "eval", "study"), "--no-open")
    process = subprocess.Popen([*command, "--serve", str(study)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        link = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", link)
        reading = Reading(browser, study, link, **DESKTOP)
        reading.page.click("#begin")
        reading.answer_all(reading.press, lambda *_: "dark")
        reading.page.check("#agreed")
        reading.page.click("#send")
        expect(reading.page.locator("#told")).to_contain_text("Sent.")
        reading.page.click("#next-reader")
        reading.page.click("#begin")
        reading.at("1 of 18")
        assert reading.faults == []
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(SERVE_SECONDS)
        finally:
            process.kill()
            process.wait()
            process.stdout.close()
    scored = mt("eval", "study", "--score", study)
    assert scored.code == 0, scored.err
    assert "0/6" in scored.out


def test_uses_that_mean_nothing(mt, study: Path) -> None:
    for words, told in (
        ((), "Give one of RESULTS, --score ANSWERS and --serve STUDY"),
        ((study, "--score", study), "Give one of"),
        (("--score", study, "--base", "x"), "--base means nothing"),
        (("--serve", study, "-o", "x"), "--output means nothing"),
        ((study,), "Missing option '-o'"),
    ):
        result = mt("eval", "study", *words)
        assert (result.code, told.lower() in result.err.lower()) == (2, True), result.err
    result = mt("eval", "-q", "study", study)
    assert "mean nothing to `mt eval study`" in result.err
