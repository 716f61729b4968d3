"""A CUDA device against its table: the network alone, whole runs, and what the cores beside it do.

    python benchmarks/gpu.py [--frames 3000] [--seconds 200]

For `lite`, which ships, and `paper` with random weights, at 256 x 256: frames per second of
`Engine.draw` by as many threads as it has lanes; of a whole `mt run`, decode to encode; how far the
device's frames are from the CPU's in float32; then the draft's whole runs on 1, 2, 4, ... cores.
Stops beginning new parts after so many seconds, as rented devices cost by the second.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from workload import SIDE, SOURCE, demo_crops, driver_folder, weights_of

from motion_transfer.drawing.engines import Execution, open_engine
from motion_transfer.drawing.engines.interface import LANES
from motion_transfer.render.options import SourceOptions
from motion_transfer.render.source import read_source

CUDA = Execution("torch", "bf16", "cuda")
EXACT = Execution("torch", "f32", "cpu")
TIMED_SECONDS = 4.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--frames", type=int, default=3000)
    parser.add_argument("--seconds", type=float, default=200)
    arguments = parser.parse_args()
    end = time.monotonic() + arguments.seconds
    cores = len(os.sched_getaffinity(0))
    print(f"{torch.cuda.get_device_name()}, {cores} cores, torch {torch.__version__}", flush=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        driver = driver_folder(folder, arguments.frames)
        for preset in ("lite", "paper"):
            weights = weights_of(folder, preset)
            if time.monotonic() < end:
                network_alone(weights, preset)
            if time.monotonic() < end:
                flags = ("--weights", weights, "--device", "cuda")
                whole_run(driver, folder, arguments.frames, preset, cores, flags)
        count = 1
        while count <= cores and time.monotonic() < end:
            whole_run(driver, folder, arguments.frames, "draft", count, ("--renderer", "texture"))
            count *= 2


def network_alone(weights: Path, preset: str) -> None:
    began = time.perf_counter()
    engine = open_engine(weights, CUDA)
    engine.prepare([SIDE])
    ready_seconds = time.perf_counter() - began
    batch = engine.batch_size(SIDE)
    crops = demo_crops(SIDE)[:batch]
    source = read_source(SourceOptions(source=(SOURCE,)), engine.config.finest_texture)
    feature_map = engine.encode(source)
    taken = engine.take(feature_map)
    shown = np.stack([crops[number % len(crops)] for number in range(batch)])
    exact = open_engine(weights, EXACT)
    expected = exact.draw(exact.take(feature_map), shown[:2]).astype(float)
    away = engine.draw(taken, shown)[:2] - expected
    psnr = 10 * np.log10(255**2 / max(np.square(away).mean(), 1e-9))

    def draw_until(end: float) -> int:
        calls = 0
        while time.perf_counter() < end:
            engine.draw(taken, shown)
            calls += 1
        return calls

    began = time.perf_counter()
    with ThreadPoolExecutor(LANES) as lanes:
        calls = sum(lanes.map(draw_until, [began + TIMED_SECONDS] * LANES))
    rate = calls * batch / (time.perf_counter() - began)
    print(
        f"{preset}: ready in {ready_seconds:.1f} s, network alone {rate:.0f} frames/s in batches of"
        f" {batch}, {psnr:.0f} dB from float32 on the CPU",
        flush=True,
    )


def whole_run(
    driver: Path, folder: Path, frames: int, name: str, cores: int, flags: tuple[object, ...]
) -> None:
    allowed = sorted(os.sched_getaffinity(0))[:cores]
    output = folder / "out.mp4"
    command = ["-m", "motion_transfer", "run", "--source", SOURCE, "--driver", driver, *flags]
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, *map(str, command), "-o", str(output), "--force", "--quiet"],
        check=True,
        preexec_fn=lambda: os.sched_setaffinity(0, allowed),
    )
    seconds = time.perf_counter() - began
    print(
        f"{name}: whole run of {frames} frames on {cores} cores {frames / seconds:.0f} frames/s",
        flush=True,
    )


if __name__ == "__main__":
    main()
