"""Whole runs of the command: how the draft takes to cores, what a network's run adds to it.

    python benchmarks/end_to_end.py [draft] [lite] [paper] [start] [--rounds 3]

Prints medians of interleaved rounds, and lowest to highest; all sections if none is named:
* `draft`: frames per second of `mt run --renderer texture` from the command to its end, on 1, 2, 4,
  ... cores with as many workers, and the share of linear. `--processes 0` and `1` compares threads
  alone with threads and processes.
* `lite`, `paper` (random weights): frames per second of `mt run` in 8 and in 16 bits, from the
  command to its end and while rendering, and the time a frame over that of the network alone, which
  draws the same frames by as many threads as there are cores. Of CPU time the whole command counts,
  start and loading included.
* `start`: `mt --help`, and from `mt run` to the first frame that is written.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as the command does, before torch
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # a user's second run is not compiled again

import numpy as np
from network import calibrated_paper
from workload import SOURCE, driver_folder

from motion_transfer.cores import core_count
from motion_transfer.events import ignore
from motion_transfer.render.composition import compose
from motion_transfer.render.options import RenderOptions
from motion_transfer.weights import find_weights

COMMAND = (sys.executable, "-m", "motion_transfer")
PRECISIONS = ("int8", "bf16")
THREADS_ONLY = "import motion_transfer.render.crew as c; c.LEAST_SHARED = 10**9"
MAIN = "from motion_transfer.cli.main import entry_point; entry_point()"


@dataclass(frozen=True)
class Timing:
    """Seconds of one command: in all, to its first written frame, while rendering, of all cores."""

    whole: float
    first: float
    rendering: float
    cpu: float


def time_run(
    driver: Path, folder: Path, *more: object, cores: int | None = None, processes: bool = True
) -> Timing:
    """Run `mt run` on the first so many cores, with as many workers."""
    chosen = sorted(os.sched_getaffinity(0))[:cores]
    words = ["run", "--source", SOURCE, "--driver", driver, "-o", folder / "out.mp4", "--force"]
    words += ["--json", "--workers", len(chosen), *more]
    command = COMMAND if processes else (sys.executable, "-c", f"{THREADS_ONLY}\n{MAIN}")
    began, stage, first, rendering = time.perf_counter(), "", 0.0, 0.0
    cpu_began = cpu_of_children()
    with subprocess.Popen(
        [*command, *map(str, words)],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=partial(os.sched_setaffinity, 0, chosen),
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            event = json.loads(line)
            if event["event"] == "stage":
                stage = event["name"]
            elif event["event"] == "frames-done" and stage == "render" and event["frame_count"]:
                first = first or time.perf_counter() - began
            elif event["event"] == "finished":
                rendering = event["render_seconds"]
    if process.returncode:
        raise SystemExit(f"mt run failed: {process.returncode}")
    return Timing(time.perf_counter() - began, first, rendering, cpu_of_children() - cpu_began)


def cpu_of_children() -> float:
    """CPU seconds of the commands that have ended; without those of a draft's processes."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def draft(folder: Path, frame_count: int, rounds: int, processes: list[bool]) -> None:
    driver = driver_folder(folder, frame_count)
    most = len(os.sched_getaffinity(0))
    counts = sorted({*(2**power for power in range(most.bit_length())), most})
    rates = defaultdict(list)
    for _ in range(rounds):
        for cores in counts:
            for kind in processes:
                timing = time_run(
                    driver, folder, "--renderer", "texture", cores=cores, processes=kind
                )
                rates[kind, cores].append(frame_count / timing.whole)
    print(f"draft, 256 x 256, {frame_count} PNG frames, from the command to its end:")
    for (kind, cores), values in sorted(rates.items()):
        median, alone = (statistics.median(rates[kind, n]) for n in (cores, 1))
        print(
            f"  {'processes' if kind else 'threads':9} {cores:2} cores {spread(values)} frames/s,"
            f" {median / alone / cores:.2f} of linear"
        )


def network(folder: Path, weights: Path, frame_count: int, rounds: int) -> None:
    driver = driver_folder(folder, frame_count)
    seconds = defaultdict(list)
    for _ in range(rounds):
        for precision in PRECISIONS:
            words = ("--weights", weights, "--precision", precision)
            timing = time_run(driver, folder, *words)
            seconds[precision, "whole"].append(timing.whole)
            seconds[precision, "rendering"].append(timing.rendering)
            seconds[precision, "cpu"].append(timing.cpu)
            alone, cpu = time_network(driver, folder, weights, precision)
            seconds[precision, "network"].append(alone)
            seconds[precision, "network cpu"].append(cpu)
    print(f"{weights.stem}, 256 x 256, {frame_count} PNG frames, {core_count()} cores:")
    for precision in PRECISIONS:
        whole, rendering, alone, cpu, network_cpu = (
            seconds[precision, kind]
            for kind in ("whole", "rendering", "network", "cpu", "network cpu")
        )
        print(
            f"  {precision} {spread([frame_count / each for each in whole], 1)} frames/s in all,"
            f" {spread([frame_count / each for each in rendering], 1)} while rendering; over the"
            f" network alone {over(whole, alone):.2f} and {over(rendering, alone):.2f},"
            f" in CPU time {over(cpu, network_cpu):.2f}"
        )


def time_network(driver: Path, folder: Path, weights: Path, precision: str) -> tuple[float, float]:
    """Draw a run's frames and do nothing else; seconds, and CPU seconds."""
    options = RenderOptions(
        source=(SOURCE,),
        driver=driver,
        output=folder / "network.mp4",
        weights=weights,
        precision=precision,
    )
    composed = compose(options, folder, ignore)
    plan = composed.prepared.plan
    renderer = composed.prepared.recipe.renderer(composed.appearances[0])
    window = plan.shots[0].window
    size = renderer.working_size(window.side)
    frames = composed.prepared.open_people()[0].read(0, len(plan.frames))
    crops = np.stack([window.cut(iuv, size) for iuv in frames])
    step = renderer.batch_size(size)
    crops = np.concatenate([crops, crops[: -len(crops) % step]])  # whole batches, as in a run
    batches = crops.reshape(-1, step, *crops.shape[1:])
    renderer.render(batches[0])
    with ThreadPoolExecutor(core_count()) as pool:
        began, cpu_began = time.perf_counter(), time.process_time()
        for _ in pool.map(renderer.render, batches):
            pass
        return time.perf_counter() - began, time.process_time() - cpu_began


def start_up(folder: Path, rounds: int) -> None:
    driver, helps, firsts = driver_folder(folder, 96), [], defaultdict(list)
    kinds = {"draft": ("--renderer", "texture"), "lite": ("--renderer", "nhrr")}
    for _ in range(rounds):
        began = time.perf_counter()
        subprocess.run([*COMMAND, "--help"], check=True, capture_output=True)
        helps.append(time.perf_counter() - began)
        for kind, words in kinds.items():
            firsts[kind].append(time_run(driver, folder, *words).first)
    print(f"mt --help {spread(helps, 2)} s")
    for kind, values in firsts.items():
        print(f"mt run, {kind}: first frame after {spread(values, 2)} s (96 frames are scanned)")


def spread(values: list[float], digits: int = 0) -> str:
    low, median, high = min(values), statistics.median(values), max(values)
    return f"{median:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def over(ones: list[float], others: list[float]) -> float:
    return statistics.median(one / other for one, other in zip(ones, others, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    sections = ("draft", "lite", "paper", "start")
    parser.add_argument("sections", nargs="*", metavar="section", help=", ".join(sections))
    parser.add_argument("--frames", type=int, default=2400, help="of the draft")
    parser.add_argument("--network-frames", type=int, default=600)
    parser.add_argument("--weights", type=Path, default=Path("lite"), help="instead of lite")
    parser.add_argument("--processes", type=int, nargs="*", default=[1])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="keep the made files there")
    arguments = parser.parse_args()
    chosen = arguments.sections or sections
    if unknown := set(chosen) - set(sections):
        parser.error(f"no section {', '.join(unknown)}")
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        if "start" in chosen:
            start_up(folder, arguments.rounds)
        if "draft" in chosen:
            processes = [bool(each) for each in arguments.processes]
            draft(folder, arguments.frames, arguments.rounds, processes)
        if "lite" in chosen:
            weights = find_weights(arguments.weights)
            network(folder, weights, arguments.network_frames, arguments.rounds)
        if "paper" in chosen:
            network(folder, calibrated_paper(folder), arguments.network_frames, arguments.rounds)


if __name__ == "__main__":
    main()
