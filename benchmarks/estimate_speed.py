"""How fast `mt iuv` is.

    .venv/bin/python benchmarks/estimate_speed.py [--against CHECKOUT] [--size 854x480]

A clip of the demo's person, who goes to and fro, in H.264. Whole runs, decode to encode, in turns
with those of another checkout of this project; then what each step takes alone.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

from motion_transfer.cores import core_count
from motion_transfer.estimate.blazepose import BlazePoseEstimator
from motion_transfer.estimate.clip import lay_iuv
from motion_transfer.estimate.interface import AT_ONCE
from motion_transfer.estimate.shots import mark_shots
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv
from motion_transfer.media.pictures.formats import open_pictures

ROOT = Path(__file__).parents[1]
PERSON = ROOT / "motion_transfer/demo/source.png"
STEP_FRAMES = 60

RUN = r"""
import re, sys, time
from pathlib import Path
began, stamps = time.perf_counter(), []
from motion_transfer.estimate.run import EstimateOptions, estimate_iuv
options = EstimateOptions(source=Path(sys.argv[1]), output=Path(sys.argv[2]), force=True)
estimate_iuv(options, lambda *_: stamps.append(time.perf_counter()))
ended = time.perf_counter()
# not getrusage's, which begins with the memory of the process that started this one
most = int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1]) / 1024
print((len(stamps) - 1) / (stamps[-1] - stamps[0]), ended - began, time.process_time(), most)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description="The estimator's speed.")
    parser.add_argument("--against", type=Path, metavar="CHECKOUT")
    parser.add_argument("--clip", type=Path, help="instead of the demo's person")
    parser.add_argument("--size", default="854x480")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=5)
    time_runs(parser.parse_args())


def time_runs(options: argparse.Namespace) -> None:
    """Print frames a second of whole runs, and what each step takes alone."""
    with tempfile.TemporaryDirectory() as folder:
        clip = options.clip or make_clip(Path(folder), options.size, options.frames)
        pictures = open_pictures(clip)
        print(
            f"{pictures.width} x {pictures.height}, {pictures.frame_count} frames;"
            f" {core_count()} cores, {cpu_name()}"
        )
        trees = {"here": ROOT, **({"there": options.against.resolve()} if options.against else {})}
        results: dict[str, list[list[float]]] = {name: [] for name in trees}
        for _ in range(options.rounds):
            for name, tree in trees.items():
                command = [sys.executable, "-c", RUN, str(clip), f"{folder}/{name}.mkv"]
                places = {**os.environ, "PYTHONPATH": str(tree)}
                told = subprocess.run(
                    command, cwd=folder, env=places, check=True, capture_output=True, text=True
                )
                results[name].append([float(number) for number in told.stdout.split()])
        for name, rounds in results.items():
            rates, walls, cpus, sizes = zip(*rounds, strict=True)
            each = 1e3 * statistics.median(cpus) / pictures.frame_count
            print(
                f"{name:6} {statistics.median(rates):5.1f} frames/s ({min(rates):.1f} to"
                f" {max(rates):.1f}); {pictures.frame_count / statistics.median(walls):.1f} with"
                f" what it takes to start; {each:.0f} ms of CPU a frame with that; {max(sizes):.0f}"
                " MiB at most"
            )
        if options.against:
            pairs = zip(results["here"], results["there"], strict=True)
            ratios = [here[0] / there[0] for here, there in pairs]
            print(f"{statistics.median(ratios):.2f} times ({min(ratios):.2f} to {max(ratios):.2f})")
        time_steps(clip, Path(folder))


def make_clip(folder: Path, size: str, frames: int) -> Path:
    """The demo's person in front of a blurred wall, to and fro, with a camera's noise."""
    width, height = (int(number) for number in size.split("x"))
    photo = cv2.imread(str(PERSON))
    assert photo is not None
    tall, wide = photo.shape[:2]
    wall = cv2.GaussianBlur(cv2.resize(photo, (width, height)), (0, 0), 25)
    rng = np.random.default_rng(0)
    with av.open(str(folder / "clip.mp4"), "w") as container:
        stream = container.add_stream("libx264", 30, {"crf": "18", "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for index in range(frames):
            turn, grow, go = (np.sin(2 * np.pi * index / n) for n in (51, 69, 150))
            scale = height / tall * (1 + 0.04 * grow)
            matrix = cv2.getRotationMatrix2D((wide / 2, tall / 2), 3 * turn, scale)
            matrix[:, 2] += (width - wide) / 2 + 0.2 * width * go, (height - tall) / 2
            frame = cv2.warpAffine(
                photo, matrix, (width, height), wall.copy(), borderMode=cv2.BORDER_TRANSPARENT
            )
            noisy = frame + rng.normal(0, 3, (height, width, 1))
            picture = noisy.round().clip(0, 255).astype(np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode(None))
    return folder / "clip.mp4"


def time_steps(clip: Path, folder: Path) -> None:
    """Print what each step takes alone of CPU, over the first frames."""
    pictures = open_pictures(clip)
    count = min(STEP_FRAMES, pictures.frame_count)
    estimator = BlazePoseEstimator()
    took: dict[str, float] = {}

    def step(name: str, work: Callable[[], Any]) -> Any:
        began = time.process_time()
        result = work()
        took[name] = 1e3 * (time.process_time() - began) / count
        return result

    frames = step("decode", lambda: list(islice(pictures.read(), count)))
    step("look for cuts", lambda: list(mark_shots(frames)))
    estimator.estimate(frames[0])  # a shot's first frame is searched everywhere, for 0.3 s
    located = step("find people", lambda: [estimator.locate(frame) for frame in frames])
    people = step("paint IUV", lambda: [finish() for finish in located])
    size = frames[0].shape[:2]
    laid = step("lay", lambda: [lay_iuv(each, *size) for each in people])
    settings = IuvOutput(frame_count=count, height=size[0], width=size[1], force=True)
    step("encode", lambda: write_iuv(laid, folder / "steps.mkv", settings))
    total, cores = sum(took.values()), core_count()
    print("ms of CPU a frame: " + ", ".join(f"{name} {ms:.1f}" for name, ms in took.items()))
    print(f"{total:.1f} in all: {1e3 * cores / total:.0f} frames/s, were {cores} cores always busy")
    one_thread = {
        "decode and look for cuts": took["decode"] + took["look for cuts"],
        "paint IUV (half, as two threads do)": took["paint IUV"] / AT_ONCE,
        **{name: took[name] for name in ("find people", "lay", "encode")},
    }
    most = max(one_thread, key=lambda name: one_thread[name])
    limit = 1e3 / one_thread[most]
    print(f"the busiest thread: {most}, {one_thread[most] / total:.0%}; no faster than {limit:.0f}")


def cpu_name() -> str:
    """The processor's name, as far as the system tells."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*:\s*(.+)", info.read_text()) if info.exists() else None
    return found[1] if found else platform.processor()


if __name__ == "__main__":
    main()
