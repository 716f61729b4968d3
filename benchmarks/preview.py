"""The preview: a frame over HTTP against the renderer alone, and its memory after many frames.

    python benchmarks/preview.py [--only start|page|latency|memory] [--renderer nhrr] [--frames 40]

* `start`: from the command to the link, and to the first frame, a draft and the network's;
* `page`: in a Chromium, from following the link of a running preview to the first picture;
* `latency`: each request is a jump to another frame; between requests the same frame is drawn here,
  by the renderer alone, so that both meet the same noise of the machine;
* `memory`: of the server after 500 and after 5,000 frames that were looked at.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any
from urllib.parse import urlsplit

from workload import DEMO, SOURCE

from motion_transfer.events import ignore
from motion_transfer.preview.driver import PreviewedDriver, plan_frames
from motion_transfer.preview.views import Views
from motion_transfer.render.driver import open_driver
from motion_transfer.render.options import RenderOptions

DRIVER = DEMO / "driver.mkv"
LOOKED_AT = (500, 5000)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=("start", "page", "latency", "memory"))
    parser.add_argument("--renderer", default="nhrr")
    parser.add_argument("--frames", type=int, default=40)
    given = parser.parse_args()
    if given.only in (None, "start"):
        for number in range(3):
            measure_start(number)
    if given.only in (None, "page"):
        measure_page()
    if given.only in (None, "latency"):
        measure_latency(given.renderer, given.frames)
    if given.only in (None, "memory"):
        measure_memory()


class Page:
    """What a browser asks of the server, one request after the other."""

    def __init__(self, process: subprocess.Popen) -> None:
        assert process.stdout is not None
        self.link = process.stdout.readline().strip()
        link = urlsplit(self.link)
        self.process, self._path = process, link.path
        self._connection = HTTPConnection(link.hostname or "", link.port, timeout=120)

    def state(self) -> dict[str, Any]:
        """The first message of a fresh stream of events."""
        other = HTTPConnection(self._connection.host, self._connection.port, timeout=120)
        other.request("GET", f"{self._path}events")
        line = other.getresponse().readline()
        other.close()
        return json.loads(line.removeprefix(b"data: "))

    def planned(self) -> dict[str, Any]:
        """The state once the driver has been looked through."""
        while not (state := self.state())["planned"]:
            time.sleep(0.05)
        return state

    def frame(self, index: int, key: str, *, draft: bool = False) -> bytes:
        """A result."""
        query = f"key={key}&draft={int(draft)}"
        self._connection.request("GET", f"{self._path}frame/{index}/result?{query}")
        answer = self._connection.getresponse()
        data = answer.read()
        if answer.status != 200:
            raise RuntimeError(data.decode())
        return data

    def change(self, **options: str) -> dict[str, Any]:
        """Set options; the new state."""
        self._connection.request(
            "POST",
            f"{self._path}options",
            json.dumps(options),
            {"Content-Type": "application/json"},
        )
        return json.loads(self._connection.getresponse().read())

    @property
    def memory_mib(self) -> float:
        """Resident memory of the server now."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        line = next(line for line in status.splitlines() if line.startswith("VmRSS"))
        return int(line.split()[1]) / 1024


@contextmanager
def server(renderer: str) -> Iterator[Page]:
    """A preview of the demo."""
    command = [sys.executable, "-m", "motion_transfer", "preview", "--no-open"]
    command += ["--source", str(SOURCE), "--driver", str(DRIVER), "--renderer", renderer]
    with (
        TemporaryDirectory() as folder,
        subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as process,
    ):
        try:
            yield Page(process)
        finally:
            process.terminate()


def measure_start(number: int) -> None:
    began = time.perf_counter()
    with server("nhrr") as page:
        linked = time.perf_counter() - began
        while (state := page.state())["driver"] is None or not state["shots"]:
            time.sleep(0.02)
        page.frame(0, state["key"], draft=True)
        drafted = time.perf_counter() - began
        page.frame(0, page.state()["key"])
        drawn = time.perf_counter() - began
    print(f"start {number}: link {linked:.2f} s, draft {drafted:.2f} s, network {drawn:.2f} s")


def measure_page(rounds: int = 5) -> None:
    """The first of them meets a server that has drawn nothing yet."""
    from playwright.sync_api import sync_playwright

    with server("nhrr") as page, sync_playwright() as player:
        page.planned()
        browser = player.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        seconds = []
        for _ in range(rounds):
            tab = browser.new_page()
            began = time.perf_counter()
            tab.goto(page.link)
            image = tab.locator("#over[data-view=result]")
            image.wait_for()
            while not image.evaluate("image => image.complete && image.naturalWidth > 0"):
                time.sleep(0.005)
            seconds.append(time.perf_counter() - began)
            tab.close()
        browser.close()
    print(f"page: first picture after {seconds[0]:.2f} s; then median {median(seconds[1:]):.2f} s")


def measure_latency(renderer: str, count: int) -> None:
    options = RenderOptions(
        source=(SOURCE,), driver=DRIVER, output=Path("unused.mp4"), renderer=renderer
    )
    with TemporaryDirectory() as folder, server(renderer) as page:
        driver = PreviewedDriver(open_driver(options, Path(folder), ignore))
        driver.see_all(Event(), lambda _count: None)
        plans, views = plan_frames(driver, options), Views()
        key = page.planned()["key"]
        bare, asked = [], []
        frames = random.Random(0).sample(range(driver.frame_count), count + 2)
        for index in frames:
            iuv = plans.read(index, driver)
            draw = views.prepared(options)[1]
            window = plans.window_at(index)
            crop = window.cut(iuv, draw.working_size(window.side))[None]
            began = time.perf_counter()
            draw.render(crop)
            bare.append(time.perf_counter() - began)
            began = time.perf_counter()
            page.frame(index, key)
            asked.append(time.perf_counter() - began)
        bare, asked = bare[2:], asked[2:]  # both had to warm up
    print(f"latency, {renderer}, {count} jumps:")
    for name, values in (("renderer alone", bare), ("over HTTP", asked)):
        print(f"  {name}: median {1e3 * median(values):.0f} ms, 95 % {1e3 * _most(values):.0f} ms")
    print(f"  ratio of medians {median(asked) / median(bare):.2f}")


def measure_memory() -> None:
    with server("texture") as page:
        state, looked = page.planned(), 0
        while looked < LOOKED_AT[-1]:
            key = page.change(background=f"#{looked % 2**24:06x}")["key"]
            for index in range(state["driver"]["frame_count"]):
                page.frame(index, key)
                looked += 1
                if looked in LOOKED_AT:
                    print(f"memory after {looked} frames: {page.memory_mib:.0f} MiB")


def _most(values: list[float]) -> float:
    return quantiles(values, n=20)[-1]


if __name__ == "__main__":
    main()
