"""End to end against the model alone, and the draft's frames per second.

    python benchmarks/end_to_end.py [--frames 600] [--preset paper] [--rounds 3]

Prints medians and ratios of one run:
* `texture`: frames per second of a whole run at 256 x 256 (plan, decode, render, encode);
* `nhrr`: time a frame of a whole run's rendering (decode, model, paste, encode) over the model
  alone, on the same frames in the same batches, compiled;
* start-up: `mt --help` as a process.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as the command does, before torch

import numpy as np
from workload import SOURCE, driver_folder, weights_of

from motion_transfer.events import ignore
from motion_transfer.media.work import WorkFolder
from motion_transfer.render.engine import Engine
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.run import prepare, run


def texture_rate(folder: Path, frame_count: int, rounds: int) -> None:
    driver = driver_folder(folder, frame_count)
    options = RenderOptions(
        source=(SOURCE,),
        driver=driver,
        output=folder / "texture.mp4",
        renderer="texture",
        force=True,
    )
    rates = [frame_count / run(options).wall_seconds for _ in range(rounds)]
    print(
        f"texture, 256 x 256, {frame_count} PNG frames, end to end:"
        f" median {statistics.median(rates):.0f} frames/s (of {rounds}: {min(rates):.0f}"
        f" to {max(rates):.0f})"
    )


def nhrr_overhead(folder: Path, frame_count: int, preset: str, rounds: int) -> None:
    driver = driver_folder(folder, frame_count)
    options = RenderOptions(
        source=(SOURCE,),
        driver=driver,
        output=folder / "nhrr.mp4",
        weights=weights_of(folder, preset),
    )
    began = time.perf_counter()
    with WorkFolder(options.output) as work:
        prepared, appearance = prepare(replace(options, compile=True), work, ignore)
    renderer, reader = prepared.recipe.renderer(appearance), prepared.driver.open()
    print(f"nhrr, {preset}: prepared and compiled in {time.perf_counter() - began:.0f} s")
    window = prepared.plan.shots[0].window
    size = renderer.working_size(window.side)
    crops = np.stack([window.cut(iuv, size) for iuv in reader.read(0, renderer.batch_size)])
    ratios = []
    for _ in range(rounds):
        began = time.perf_counter()
        for _ in range(frame_count // renderer.batch_size):
            renderer.render(crops)
        alone = (time.perf_counter() - began) / frame_count
        with tempfile.TemporaryDirectory(dir=folder) as work:
            chunks = [(c, Path(work) / f"{c.index}.nut") for c in prepared.plan.chunks]
            began = time.perf_counter()
            engine = Engine(prepared, reader=reader, renderer=renderer)
            engine.render(chunks, 2, lambda _chunk, _path: None)
            whole = (time.perf_counter() - began) / frame_count
        ratios.append(whole / alone)
        print(f"  model {alone * 1e3:.1f} ms a frame, end to end {whole * 1e3:.1f} ms")
    print(f"nhrr, {preset}: end to end over model alone, median {statistics.median(ratios):.3f}")


def start_up(rounds: int) -> None:
    seconds = []
    for _ in range(rounds):
        began = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "motion_transfer", "--help"], check=True, capture_output=True
        )
        seconds.append(time.perf_counter() - began)
    print(f"mt --help: median {statistics.median(seconds):.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--nhrr-frames", type=int, default=96)
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="keep the made files there")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        start_up(arguments.rounds + 2)
        texture_rate(folder, arguments.frames, arguments.rounds)
        nhrr_overhead(folder, arguments.nhrr_frames, arguments.preset, arguments.rounds)


if __name__ == "__main__":
    main()
