"""The page of `mt preview` in a browser, served by the real command."""

from __future__ import annotations

import base64
import http.client
import json
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import av
import pytest
from PIL import Image

from motion_transfer.estimate.fetching import missing_models

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
expect = playwright.expect
expect.set_options(timeout=90_000)  # ms; the network draws a frame in 1 s on two idle cores

DEMO = Path(str(files("motion_transfer.demo")))
FRAMES, SIDE_PX = 120, 320  # of the demo's driver
START_SECONDS = 60
VIEWS = {
    "Result": "result",
    "Compare": "result",
    "Side by side": "beside",
    "IUV": "iuv",
    "Person": "source",
    "Partial texture": "texture",
    "Feature map": "map",
    "Feature image": "features",
}
"""What each of the buttons shows in the upper layer."""
UNTOUCHED = {
    "renderer": "texture",
    "background": "white",
    "person": "largest",
    "unseen_legs": "jeans",
    "driver_person": "largest",
    "frames": [0, FRAMES],
    "frame_rate": "15",
    "window": None,
    "compare": False,
    "missing": "",
}
CONTROLS = "[...document.querySelectorAll('button, input, select, [role=slider], summary')]"
DROP = """([files, over, target]) => {
  const data = new DataTransfer();
  for (const [name, text] of files) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    data.items.add(new File([bytes], name));
  }
  const how = { dataTransfer: data, bubbles: true, cancelable: true };
  document.querySelector(over).dispatchEvent(new DragEvent("dragover", how));
  const shown = document.querySelector(target).checkVisibility();
  document.querySelector(target).dispatchEvent(new DragEvent("drop", how));
  return shown;
}"""
PIXEL = """(image, [x, y]) => {
  const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  return [...context.getImageData(x, y, 1, 1).data.slice(0, 3)];
}"""


class Preview:
    """A running `mt preview`."""

    def __init__(self, link: str, folder: Path) -> None:
        self.link, self.folder = link, folder
        self.address = urlsplit(link)

    def ask(
        self, method: str, path: str, body: Any = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """Send a request to a path of the server; returns status, headers and body."""
        assert self.address.hostname is not None
        connection = http.client.HTTPConnection(
            self.address.hostname, self.address.port, timeout=60
        )
        if body is not None:
            headers = {"Content-Type": "application/json", **headers}
        try:
            connection.request(method, path, None if body is None else json.dumps(body), headers)
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()
        finally:
            connection.close()

    def post(self, path: str, body: Any, **headers: str) -> int:
        return self.ask("POST", self.address.path + path, body, **headers)[0]


@contextmanager
def previewing(folder: Path, *arguments: object) -> Iterator[Preview]:
    """Run `mt preview`; it has to end by itself when it is interrupted."""
    command = [sys.executable, "-m", "motion_transfer", "preview", "--no-open", "--port", "0"]
    command += ["--folder", str(folder / "home")]
    process = subprocess.Popen(
        [*command, *map(str, arguments)], cwd=folder, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    watchdog = threading.Timer(START_SECONDS, process.kill)  # a line that never comes
    watchdog.start()
    try:
        lines = iter(process.stdout.readline, "")
        found = next(filter(None, (re.search(r"http://\S+", line) for line in lines)), None)
        watchdog.cancel()
        assert found is not None, "no link was printed"
        yield Preview(found[0], folder)
    finally:
        watchdog.cancel()
        process.send_signal(signal.SIGINT)
        try:
            process.wait(30)
        finally:
            process.kill()
            process.wait()
            process.stdout.close()


@pytest.fixture(scope="module")
def preview(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Preview]:
    source, driver = DEMO / "source.png", DEMO / "driver.mkv"
    folder = tmp_path_factory.mktemp("preview")
    inputs = ("--source", source, "--driver", driver, "-o", "out.webm")
    with previewing(folder, *inputs, "--renderer", "texture") as running:
        yield running


@pytest.fixture
def open_page(browser: Any) -> Iterator[Callable[..., Any]]:
    """A page that shows its first picture; what it complains about fails the test."""
    pages, complaints = [], []

    def open_link(link: str, *, first: str = "#over[data-view=result]", **how: Any) -> Any:
        page = browser.new_page(**how)
        pages.append(page)
        page.set_default_timeout(90_000)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complain(message))
        page.goto(link)
        page.wait_for_selector(first)
        return page

    def complain(message: Any) -> None:
        # A frame that cannot be shown is answered by 422, which the browser notes by itself.
        if message.type == "error" and not re.search(r"status of (422|409)", message.text):
            complaints.append(message.text)

    yield open_link
    for page in pages:
        page.close()
    assert complaints == []


@pytest.fixture
def page(preview: Preview, open_page: Callable[..., Any]) -> Any:
    assert preview.post("options", UNTOUCHED) == 200
    return open_page(preview.link, viewport={"width": 1280, "height": 800})


def shows(page: Any, frame: int, view: str = "result", layer: str = "over") -> None:
    """Wait until the picture of a frame is there, and is a picture."""
    image = page.locator(f"#{layer}")
    expect(image).to_have_attribute("data-frame", str(frame))
    expect(image).to_have_attribute("data-view", view)
    expect(image).to_be_visible()
    until(lambda: image.evaluate("image => image.complete && image.naturalWidth > 0"))


def pixel(page: Any, x: int, y: int) -> list[int]:
    """Colour of the picture's own pixel."""
    image = page.locator("#over")
    until(lambda: image.evaluate("image => image.complete"))
    return image.evaluate(PIXEL, [x, y])


def until(holds: Callable[[], bool], seconds: float = 60) -> None:
    """Wait for what no locator can tell; the page's policy lets no script look out for it."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.03)


def shown_frame(page: Any) -> int:
    return int(page.locator("#over").get_attribute("data-frame"))


def drag(page: Any, start: tuple[float, float], stop: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*((a + b) / 2 for a, b in zip(start, stop, strict=True)))
    page.mouse.move(*stop)
    page.mouse.up()


def press(page: Any, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


def forget_renders(page: Any, preview: Preview) -> None:
    """Begin without a result: what another test rendered is neither on the page nor on the disk."""
    for button in page.get_by_role("button", name="Forget out.webm").all():
        button.click()
    expect(page.locator("#renders li")).to_have_count(0)
    (preview.folder / "out.webm").unlink(missing_ok=True)


def drop(page: Any, target: str, *paths: Path) -> None:
    """Drop files on one of the places that the page shows while they are dragged over it."""
    files = [(path.name, base64.b64encode(path.read_bytes()).decode()) for path in paths]
    assert page.evaluate(DROP, [files, "#stage", target]), "it says where they can be dropped"
    expect(page.locator("#drops")).not_to_be_visible()


def demo_frames(folder: Path, count: int, *, empty: tuple[int, ...] = ()) -> Path:
    """Write the first frames of the demo's driver, of which some show nobody, as pictures."""
    folder.mkdir()
    with av.open(str(DEMO / "driver.mkv")) as container:
        for index, frame in zip(range(count), container.decode(video=0), strict=False):
            pixels = frame.to_ndarray(format="rgb24") * (index not in empty)
            Image.fromarray(pixels).save(folder / f"{index:03d}_IUV.png")
    return folder


def unfold(page: Any) -> None:
    """Show the rest of the output's options."""
    page.get_by_text("Quality, sound, command").click()


def test_the_page_says_what_it_shows(page) -> None:
    shows(page, 0)
    expect(page.locator("#subject")).to_have_text("source.png in the motion of Dance")
    expect(page.get_by_label("The same as a command")).to_contain_text("--renderer texture")


def test_dragging_the_slider_changes_the_frame(page) -> None:
    slider = page.get_by_role("slider", name="Driver frame")
    box = slider.bounding_box()
    before = page.locator("#over").get_attribute("src")
    middle = box["y"] + box["height"] / 2
    drag(page, (box["x"] + 8, middle), (box["x"] + box["width"] / 2, middle))
    frame = int(slider.input_value())
    assert abs(frame - FRAMES / 2) <= 1
    shows(page, frame)
    assert page.locator("#over").get_attribute("src") != before
    assert page.get_by_label("Frame", exact=True).input_value() == str(frame)


def test_keys_step_jump_and_set_in_and_out(page) -> None:
    for key, frame in [
        ("ArrowRight", 1),
        ("Shift+ArrowRight", 11),
        ("ArrowLeft", 10),
        ("End", FRAMES - 1),
        ("Shift+ArrowLeft", FRAMES - 11),
        ("Home", 0),
    ]:
        page.keyboard.press(key)
        shows(page, frame)
    page.get_by_role("slider", name="Driver frame").focus()
    page.keyboard.press("Shift+ArrowRight")
    shows(page, 10)
    page.keyboard.press("i")
    expect(page.locator(".mark.chosen")).to_have_attribute("data-range", f"10:{FRAMES}")
    page.get_by_label("Frame", exact=True).fill("50")
    shows(page, 50)
    press(page, "Set out here")
    expect(page.locator(".mark.chosen")).to_have_attribute("data-range", "10:51")
    expect(page.get_by_label("Out", exact=True)).to_have_value("50")
    expect(page.get_by_label("The same as a command")).to_contain_text("--frames 10:51")


def test_playing_moves_on_in_time_and_stops(page) -> None:
    frame = page.get_by_label("Frame", exact=True)
    page.clock.install(time=0)
    page.clock.pause_at(1000)  # from here on it is ours, however busy the machine is
    page.keyboard.press("Space")
    page.clock.run_for(100)
    assert page.get_by_role("button", name="Pause").is_visible()
    first = int(frame.input_value())
    page.clock.run_for(2000)
    assert int(frame.input_value()) == first + 30, "15 frames a second"
    page.clock.resume()
    until(lambda: shown_frame(page) >= first + 38)  # pictures keep up, or are skipped
    page.keyboard.press("Space")
    stopped = int(frame.input_value())
    shows(page, stopped)
    page.wait_for_timeout(300)
    assert int(frame.input_value()) == stopped


def test_playing_goes_from_out_to_in(page, preview) -> None:
    assert preview.post("options", {"frames": [20, 24]}) == 200
    expect(page.locator(".mark.chosen")).to_have_attribute("data-range", "20:24")
    page.get_by_label("Frame", exact=True).fill("22")
    press(page, "Play")
    until(lambda: shown_frame(page) == 20)
    press(page, "Pause")


def test_the_wipe_is_moved_by_mouse_and_keys(page) -> None:
    press(page, "Compare")
    wipe = page.get_by_role("slider", name="Wipe")
    shows(page, 0, "iuv", "base")
    expect(wipe).to_have_attribute("aria-valuenow", "50")
    box = page.locator("#frame").bounding_box()
    middle = box["y"] + box["height"] / 2
    drag(
        page,
        (box["x"] + box["width"] / 2, middle),
        (box["x"] + box["width"] / 4, middle),
    )
    expect(wipe).to_have_attribute("aria-valuenow", "25")
    expect(page.locator("#over")).to_have_css("clip-path", "inset(0px 0px 0px 25%)")
    wipe.press("Shift+ArrowRight")
    expect(wipe).to_have_attribute("aria-valuenow", "35")
    wipe.press("Home")
    expect(wipe).to_have_attribute("aria-valuenow", "0")
    shows(page, 0)  # the arrow keys were the wipe's, not the frames'


def test_each_view_shows_its_own_picture(page, preview) -> None:
    assert preview.post("options", {"renderer": "nhrr"}) == 200
    page.get_by_label("Frame", exact=True).fill("40")
    shown = set()
    press(page, "Inside")
    for name, view in VIEWS.items():
        press(page, name)
        expect(page.get_by_role("button", name=name, exact=True)).to_have_attribute(
            "aria-pressed", "true"
        )
        shows(page, 40, view)
        assert page.get_by_alt_text(re.compile(".+")).count() >= 1
        shown.add(page.locator("#over").get_attribute("src"))
    assert len(shown) >= len(VIEWS) - 1


def test_a_motion_is_chosen_by_its_picture(page) -> None:
    tiles = page.get_by_role("button", name=re.compile("^Motion: "))
    dance = page.get_by_role("button", name="Motion: Dance", exact=True)
    expect(dance).to_have_attribute("aria-pressed", "true")
    for picture in tiles.locator("img").all():
        picture.scroll_into_view_if_needed()
        until(lambda picture=picture: picture.evaluate("image => image.naturalWidth") == 120)
    assert tiles.locator("img").count() == tiles.count()


def test_all_three_are_seen_and_written_side_by_side(page, preview) -> None:
    """What the view shows is what the file holds: the photo, the IUV, the result."""
    forget_renders(page, preview)
    assert preview.post("options", {"frames": [0, 2]}) == 200
    press(page, "Side by side")
    shows(page, 0, "beside")
    expect(page.locator("#quality")).to_have_text("draft")
    wide = page.locator("#over").evaluate("image => [image.naturalWidth, image.naturalHeight]")
    unfold(page)
    box = page.get_by_label("Photo, IUV and result side by side")
    box.check()
    expect(page.get_by_label("The same as a command")).to_contain_text("--compare")
    press(page, "Render")
    expect(page.locator("#renders li").last).to_contain_text("Done in")
    with av.open(str(preview.folder / "out.webm")) as container:
        assert [container.streams.video[0].width, container.streams.video[0].height] == wide
    page.get_by_role("button", name="Background: None").click()
    expect(box).to_be_disabled()
    expect(box).not_to_be_checked()


def test_photos_are_dropped_looked_at_and_removed(page, preview, tmp_path) -> None:
    photo = shutil.copy(DEMO / "source.png", tmp_path / "again.png")
    iuv = shutil.copy(DEMO / "source_IUV.png", tmp_path / "again_IUV.png")
    tiles = page.locator("#photos li")
    expect(tiles).to_have_count(1)
    drop(page, "#drop-add", photo, iuv)
    expect(tiles).to_have_count(2)
    command = page.get_by_label("The same as a command")
    dropped = preview.folder / "home" / "inputs" / "1" / "again.png"
    expect(command).to_contain_text(f"--source {dropped}")
    assert dropped.is_file()
    page.get_by_role("button", name="Show again.png").click()
    expect(page.locator("#which")).to_have_text("2 of 2 · again.png")
    shows(page, 0, "source")
    drop(page, "#drop-add", Path(__file__))
    fault = page.locator("#sources-fault")
    expect(fault).to_contain_text("test_preview.py is no video, and is not a picture")
    expect(tiles).to_have_count(2)
    press(page, "Let it lead")
    expect(page.locator("#which")).to_have_text("1 of 2 · again.png · leads")
    expect(fault).not_to_be_visible()
    page.get_by_role("button", name="Remove again.png").click()
    expect(page.locator("#subject")).to_have_text("source.png in the motion of Dance")
    expect(tiles).to_have_count(1)


def test_a_motion_is_seen_from_another_side(page, body_model) -> None:
    side = page.get_by_label("Seen from")
    expect(side).not_to_be_visible()  # IUV is what one camera saw
    page.get_by_role("button", name="Motion: Walk").click()
    expect(side).to_have_value("0")
    side.select_option("their left side")
    command = page.get_by_label("The same as a command")
    expect(command).to_contain_text("--driver people:walk,azimuth=90")
    expect(side).to_have_value("90")
    shows(page, 0)
    page.get_by_role("button", name="Motion: Dance", exact=True).click()
    expect(side).not_to_be_visible()


def test_a_draft_gives_way_to_the_network(page) -> None:
    badge = page.locator("#quality")
    expect(badge).to_have_text("draft")
    page.get_by_label("Frame", exact=True).fill("33")
    shows(page, 33)
    draft = page.locator("#over").get_attribute("src")
    page.get_by_label("Renderer").select_option("nhrr")
    expect(badge).to_have_text("network")
    shows(page, 33)
    assert page.locator("#over").get_attribute("src") != draft
    expect(page.locator(".mark.cached[data-range='33:34']")).to_have_count(1)


def test_a_background_shows_at_once(page) -> None:
    assert pixel(page, 5, 5) == pytest.approx([255, 255, 255], abs=4)
    black = page.get_by_role("button", name="Background: Black")
    black.click()
    until(lambda: max(pixel(page, 5, 5)) < 8)
    expect(black).to_have_attribute("aria-pressed", "true")
    page.get_by_label("Background colour").fill("#20c040")
    until(lambda: pixel(page, 5, 5) == pytest.approx([0x20, 0xC0, 0x40], abs=12))
    expect(page.get_by_label("The same as a command")).to_contain_text("#20c040")


def test_a_scene_is_set(page, preview, tmp_path) -> None:
    Image.new("RGB", (64, 64), (200, 40, 90)).save(tmp_path / "wall.png")
    page.locator("#background-file").set_input_files(tmp_path / "wall.png")
    until(lambda: pixel(page, 5, 5) == pytest.approx([200, 40, 90], abs=8))
    command = page.get_by_label("The same as a command")
    expect(command).to_contain_text(f"--background {preview.folder / 'home' / 'inputs'}")
    tile = page.get_by_role("button", name="Background: wall.png")
    expect(tile).to_have_attribute("aria-pressed", "true")
    until(lambda: tile.locator("img").evaluate("image => image.naturalWidth > 0"))
    page.get_by_label("Place").fill("0.2,0.5")
    page.get_by_label("Place").press("Enter")
    expect(page.locator("#fault-place")).to_contain_text("write X,Y,SCALE")
    page.get_by_label("Place").fill("0.2,0.5,0.5")
    page.get_by_label("Place").press("Enter")
    expect(command).to_contain_text("--place 0.2,0.5,0.5")
    page.get_by_label("Shadow at the feet").check()
    expect(command).to_contain_text("--shadow")
    page.get_by_role("button", name="Background: None").click()
    expect(command).to_contain_text("--background transparent")
    until(lambda: pixel(page, 5, 5) in ([255] * 3, [204] * 3))
    page.get_by_label("Place").fill("")
    page.get_by_label("Place").press("Enter")
    expect(command).not_to_contain_text("--place")
    assert preview.post("options", {"shadow": False, "background": "white"}) == 200


def test_a_value_that_cannot_be_is_refused_in_words(page) -> None:
    rate = page.get_by_label("Frames/s")
    rate.fill("fast")
    rate.press("Enter")
    expect(page.locator("#fault-frame_rate")).to_contain_text("fast")
    expect(rate).to_have_attribute("aria-invalid", "true")
    rate.fill("25")
    rate.press("Enter")
    expect(page.locator("#fault-frame_rate")).to_have_count(0)
    expect(page.locator("#length")).to_have_text("120 frames, 4.80 s")


def test_a_window_is_drawn_typed_and_given_back(page) -> None:
    expect(page.locator("#outline")).not_to_be_visible()  # it holds all of the frame
    press(page, "Draw a window")
    box = page.locator("#frame").bounding_box()
    scale = box["width"] / SIDE_PX
    drag(
        page,
        (box["x"] + 80 * scale, box["y"] + 60 * scale),
        (box["x"] + 280 * scale, box["y"] + 200 * scale),
    )
    outline = page.locator("#outline .line")
    for name, value in {"x": 80, "y": 60, "width": 200}.items():
        expect(outline).to_have_attribute(name, re.compile(rf"^({value - 1}|{value}|{value + 1})$"))
    expect(page.locator("#window-words")).to_contain_text("by hand")
    side = page.get_by_label("Side", exact=True)
    side.fill("160")
    side.press("Enter")
    expect(outline).to_have_attribute("width", "160")
    expect(page.get_by_label("The same as a command")).to_contain_text(",160")
    press(page, "Automatic")
    expect(page.locator("#window-words")).to_contain_text("Automatic")
    expect(page.locator("#outline")).not_to_be_visible()


def test_a_window_that_cannot_be_is_given_back_and_not_rendered(page) -> None:
    side, automatic = (
        page.get_by_label("Side", exact=True),
        page.get_by_role("button", name="Automatic"),
    )
    before = side.input_value()
    expect(automatic).to_be_disabled()
    side.fill("3")
    side.press("Enter")
    expect(page.locator("#fault-window")).to_contain_text("between 16 and")
    press(page, "Render")
    expect(page.locator("#render-words")).to_contain_text("refused")
    expect(page.get_by_label("Left")).to_be_focused()
    automatic.click()
    expect(page.locator("#fault-window")).to_have_count(0)
    expect(side).to_have_value(before)


def test_the_video_is_rendered_and_plays(page, preview) -> None:
    forget_renders(page, preview)
    assert preview.post("options", {"frames": [0, 30]}) == 200
    expect(page.locator("#length")).to_contain_text("30 frames")
    press(page, "Render")
    press(page, "Watch out.webm")
    film = page.locator("#film")
    expect(film).to_be_visible()
    until(lambda: film.evaluate("film => film.readyState") >= 3)
    assert film.evaluate("film => film.duration") == pytest.approx(2, abs=0.1)
    until(lambda: film.evaluate("film => film.currentTime") > 0.2)
    press(page, "Close")
    expect(film).not_to_be_visible()
    expect(page.locator("#renders li")).to_contain_text("Done in")
    with av.open(str(preview.folder / "out.webm")) as container:
        assert sum(1 for _ in container.decode(video=0)) == 30
    (preview.folder / "out.webm").unlink()
    assert preview.post("options", UNTOUCHED) == 200
    expect(page.locator("#renders li")).to_contain_text("no longer there")
    expect(page.get_by_role("button", name="Watch out.webm")).to_have_count(0)


def test_an_output_is_replaced_only_if_somebody_says_so(page, preview) -> None:
    output = preview.folder / "out.webm"
    output.write_bytes(b"mine")
    press(page, "Render")
    expect(page.get_by_role("dialog")).to_contain_text("out.webm")
    press(page, "Keep it")
    expect(page.get_by_role("dialog")).to_have_count(0)
    assert output.read_bytes() == b"mine"


def test_a_run_is_stopped(page, preview) -> None:
    forget_renders(page, preview)
    assert preview.post("options", {"renderer": "nhrr"}) == 200
    expect(page.get_by_label("Renderer")).to_have_value("nhrr")
    press(page, "Render")
    expect(page.get_by_role("progressbar", name="Rendering out.webm")).to_be_visible()
    press(page, "Stop out.webm")
    expect(page.get_by_role("button", name="Resume out.webm")).to_be_visible()
    assert not (preview.folder / "out.webm").exists()
    press(page, "Forget out.webm")
    expect(page.locator("#renders li")).to_have_count(0)


def test_a_saved_job_is_what_a_batch_runs(page, preview, mt) -> None:
    forget_renders(page, preview)
    (preview.folder / "preview.yaml").unlink(missing_ok=True)
    assert preview.post("options", {"frames": [5, 9], "background": "black"}) == 200
    expect(page.locator("#length")).to_contain_text("4 frames")
    unfold(page)
    press(page, "Save job")
    expect(page.locator("#saved-words")).to_contain_text("preview.yaml")
    expect(page.get_by_label("The saved job")).to_contain_text("background: black")
    press(page, "Close")
    batch = mt("batch", "run", preview.folder / "preview.yaml")
    assert batch.code == 0, batch.err
    with av.open(str(preview.folder / "out.webm")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 4
    assert frames[0][5, 5].max() < 20


def test_the_command_is_copied(page, preview) -> None:
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    unfold(page)
    press(page, "Copy command")
    expect(page.get_by_role("button", name="Copied")).to_be_visible()
    command = page.evaluate("navigator.clipboard.readText()")
    assert command.startswith("mt run --source ")
    assert command == page.get_by_label("The same as a command").text_content()


def test_the_keys_are_told(page) -> None:
    page.keyboard.press("?")
    keys = page.get_by_role("dialog")
    expect(keys).to_contain_text("full screen")
    assert keys.evaluate("dialog => dialog.scrollHeight <= innerHeight")
    page.keyboard.press("Escape")
    expect(keys).to_have_count(0)


def test_the_picture_is_zoomed(page) -> None:
    frame = page.locator("#frame")
    fits = frame.bounding_box()["width"]
    press(page, "Zoom in")
    assert frame.bounding_box()["width"] == pytest.approx(1.5 * fits, abs=1)
    page.keyboard.press("0")
    assert frame.bounding_box()["width"] == pytest.approx(fits, abs=1)


def test_a_person_stands_in_the_same_place_in_every_view(page, preview) -> None:
    """Where the output is the square around the person, so is what is shown of the driver."""
    window = {"x": 80, "y": 60, "side": 160}
    assert preview.post("options", {"size": "crop", "window": window}) == 200
    expect(page.locator("#window-words")).to_contain_text("by hand")
    press(page, "IUV")
    shows(page, 0, "iuv")
    frame, image = page.locator("#frame").bounding_box(), page.locator("#over").bounding_box()
    scale = frame["width"] / window["side"]
    assert image["width"] == pytest.approx(SIDE_PX * scale, rel=0.01)
    assert frame["x"] - image["x"] == pytest.approx(window["x"] * scale, rel=0.02)
    assert preview.post("options", {"size": "driver"}) == 200


def test_from_a_dropped_photo_to_a_downloaded_video(tmp_path, open_page) -> None:
    """Nothing is given on the command line, and no terminal is needed from there on."""
    with previewing(tmp_path) as running:
        page = open_page(running.link, first="#welcome:not([hidden])")
        for name in ("Render", "Compare", "Inside", "Set in here"):
            expect(page.get_by_role("button", name=name, exact=True)).to_be_disabled()
        expect(page.locator("#welcome-words")).to_contain_text(str(tmp_path / "home"))
        drop(page, "#drop-replace", DEMO / "source.png", DEMO / "source_IUV.png")
        shows(page, 0)
        expect(page.locator("#welcome")).not_to_be_visible()
        drop(page, "#drop-motion", DEMO / "wave.mkv")
        expect(page.locator("#subject")).to_have_text("source.png in the motion of wave.mkv")
        expect(page.locator("#clock")).to_contain_text("of 30")
        page.get_by_label("Renderer").select_option("texture")
        drop(page, "#drop-garment", DEMO / "source.png", DEMO / "source_IUV.png")
        parts = page.get_by_role("group", name="Parts from source.png")
        feet = parts.get_by_role("button", name="feet")
        feet.click()
        expect(feet).to_have_attribute("aria-pressed", "true")
        command = page.get_by_label("The same as a command")
        expect(command).to_contain_text("--garment-parts")
        name = page.get_by_label("Name of the file")
        name.fill("my wave")
        name.press("Enter")
        page.get_by_label("Format").select_option(".webm")
        expect(command).to_contain_text("my_wave.webm")
        press(page, "Render")
        link = page.get_by_role("link", name="Download my_wave.webm")
        with page.expect_download() as downloading:
            link.click()
        downloading.value.save_as(tmp_path / "got.webm")
        assert downloading.value.suggested_filename == "my_wave.webm"
        page.close()  # before the server ends, which it would complain of
    with av.open(str(tmp_path / "got.webm")) as container:
        assert sum(1 for _ in container.decode(video=0)) == 30
    with previewing(tmp_path) as again:  # what was made is still at hand
        page = open_page(again.link, first="#renders li")
        expect(page.get_by_role("link", name="Download my_wave.webm")).to_be_visible()
        page.close()


@pytest.mark.skipif(bool(missing_models()), reason="needs `mt models fetch`")
def test_a_clip_is_estimated_with_time_left_and_can_be_given_up(tmp_path, open_page, mt) -> None:
    """A raw photo and a raw clip; what is found for the page is not searched again to render."""
    clip, demo = tmp_path / "clip.mp4", ("--driver", DEMO / "driver.mkv", "--renderer", "texture")
    made = mt("run", "--source", DEMO / "source.png", *demo, "--frames", "0:24", "-o", clip)
    assert made.code == 0, made.err
    with previewing(tmp_path, "--renderer", "texture") as running:
        page = open_page(running.link, first="#welcome:not([hidden])")
        drop(page, "#drop-replace", DEMO / "astronaut.jpg")
        shows(page, 0)
        drop(page, "#drop-motion", clip)
        expect(page.locator("#work-words")).to_contain_text("Finding the person")
        press(page, "Cancel")
        expect(page.locator("#subject")).to_have_text("astronaut.jpg in the motion of Dance")
        shows(page, 0)
        press(page, "Motion: clip.mp4")
        expect(page.get_by_role("button", name="Clip", exact=True)).to_be_visible(timeout=120_000)
        shows(page, 0)
        press(page, "Render")
        expect(page.locator("#renders li")).to_contain_text("Done in", timeout=120_000)
        assert "searched" not in page.locator("#renders li").inner_text()
        page.close()


def test_a_broken_frame_says_so_and_the_others_work(tmp_path, open_page, browser) -> None:
    driver = demo_frames(tmp_path / "frames", 8)
    (driver / "003_IUV.png").write_bytes(b"not a picture")
    inputs = ("--source", DEMO / "source.png", "--driver", driver, "--renderer", "texture")
    with previewing(tmp_path, *inputs) as running:
        page = open_page(running.link)
        expect(page.locator(".mark.broken")).to_have_attribute("data-range", "3:4")
        press(page, "Broken 3: go there")
        expect(page.locator("#trouble")).to_be_visible()
        expect(page.locator("#trouble")).to_contain_text("003_IUV.png")
        expect(page.locator("#over")).not_to_be_visible()
        page.keyboard.press("ArrowRight")
        shows(page, 4)
        expect(page.locator("#trouble")).not_to_be_visible()
    # The server is gone: the page has to say so rather than stand still.
    expect(page.get_by_role("alert")).to_contain_text("does not answer")
    page.goto("about:blank")  # else it goes on asking, which the browser notes as errors


def test_gaps_are_shown_and_filled(tmp_path, open_page) -> None:
    """A clip in which the person is away for a while: what its frames show can be chosen."""
    driver = demo_frames(tmp_path / "frames", 6, empty=(3, 4))
    inputs = ("--source", DEMO / "source.png", "--driver", driver, "--renderer", "texture")
    with previewing(tmp_path, *inputs) as running:
        page = open_page(running.link)
        expect(page.locator(".mark.missing")).to_have_attribute("data-range", "3:5")
        page.get_by_label("Frame", exact=True).fill("4")
        shows(page, 4)
        nobody = page.locator("#over").get_attribute("src")
        page.get_by_label("Where nobody is").select_option("hold")
        expect(page.get_by_label("The same as a command")).to_contain_text("--missing hold")
        shows(page, 4)
        until(lambda: page.locator("#over").get_attribute("src") != nobody)
        until(lambda: pixel(page, SIDE_PX // 2, SIDE_PX // 2) != [255] * 3)
        page.close()


def test_a_motion_that_is_read_again_keeps_the_place(preview, open_page) -> None:
    """Between two states of the same motion there may be one without any."""
    frames = open_page(preview.link).evaluate(
        """async () => {
            const { Looking } = await import(new URL("looking.js", document.baseURI));
            const looking = new Looking();
            const receive = (revision, motion, driver) =>
                looking.receive({ revision, motion, driver, sources: [], options: {} });
            receive(1, 0, { frame_count: 6 });
            looking.look({ frame: 4 });
            receive(2, 0, null);
            looking.look({ frame: looking.frame + 1 });
            receive(3, 0, { frame_count: 6 });
            const kept = looking.frame;
            receive(4, 1, null);
            receive(5, 1, { frame_count: 6 });
            return [kept, looking.frame];
        }"""
    )
    assert frames == [4, 0]


def test_without_the_token_nothing_is_told(preview) -> None:
    for path in ("/", "/events", "/wrong/", "/wrong/events", "/wrong/frame/0/iuv", "/page.js"):
        status, _, body = preview.ask("GET", path)
        assert status in (403, 404)
        for secret in (preview.address.path.strip("/"), str(DEMO), "source.png"):
            assert secret.encode() not in body
    assert preview.ask("GET", preview.address.path)[0] == 200


def test_other_hosts_and_origins_are_refused(preview) -> None:
    path = preview.address.path
    assert preview.ask("GET", path, Host="evil.example")[0] in (400, 403, 421)
    for origin in ("http://evil.example", "null", f"https://{preview.address.netloc}"):
        assert preview.post("options", {"background": "black"}, Origin=origin) == 403
        assert preview.post("render", {"replace": True}, Origin=origin) == 403
    assert preview.post("options", {}, **{"Content-Type": "text/plain"}) in (403, 415)
    assert preview.post("options", {}, Origin=f"http://{preview.address.netloc}") == 200


def test_the_page_loads_nothing_from_elsewhere(preview) -> None:
    _, headers, _ = preview.ask("GET", preview.address.path)
    policy = {name.lower(): value for name, value in headers.items()}["content-security-policy"]
    assert "default-src 'none'" in policy
    assert not re.search(r"https?:|\*|unsafe", policy)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_all_of_it_without_scrolling_sideways(
    preview, open_page, scheme: str
) -> None:
    phone = {"width": 390, "height": 844}
    page = open_page(preview.link, viewport=phone, color_scheme=scheme)
    for name in list(VIEWS)[:4]:
        press(page, name)
        page.wait_for_timeout(100)
        assert page.evaluate("document.documentElement.scrollWidth") <= phone["width"]
    for control in page.locator("button:visible, input:visible, select:visible").all():
        control.scroll_into_view_if_needed()
        box = control.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= phone["width"]


def test_every_control_has_a_name_and_is_reached_by_tab(page) -> None:
    press(page, "Compare")
    named = sum(
        page.get_by_role(role, name=re.compile(r"\S")).count()
        for role in ("button", "slider", "spinbutton", "combobox", "checkbox", "textbox")
    )
    anonymous = sum(
        page.get_by_role(role, name=re.compile(r"^\s*$")).count()
        for role in ("button", "slider", "spinbutton", "combobox", "checkbox", "textbox")
    )
    controls = page.locator("button:visible, input:visible, select:visible, [role=slider]:visible")
    assert (named, anonymous) == (controls.count(), 0)
    wanted = page.evaluate(f"{CONTROLS}.filter(e => e.checkVisibility() && !e.disabled).length")
    page.evaluate("document.activeElement.blur()")
    reached = set()
    for _ in range(wanted + 12):
        page.keyboard.press("Tab")
        reached.add(page.evaluate(f"{CONTROLS}.indexOf(document.activeElement)"))
    assert len(reached - {-1}) == wanted
