"""Batches: the engine over the bare model, shared sources, memory, and large manifests.

    python benchmarks/batch.py [--frames 96] [--preset lite] [--only manifest]

Prints, each against its own baseline:
* `overhead`: rendering chunks (decode, model, paste, encode) over the model alone, one worker;
* `shared`: feature maps computed for 20 jobs of one source;
* `memory`: peak of the scheduler and of a worker, at 1 and 8 times the frames and the jobs;
* `manifest`: reading and checking 10,000 jobs, and how long until the first of them begins.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as the command does, before torch

from workload import SOURCE, driver_folder, random_checkpoint

MT = [sys.executable, "-m", "motion_transfer", "batch"]
CHILD = """
import json, resource, sys
from pathlib import Path
from motion_transfer.batch.events import BatchFinished
from motion_transfer.batch.run import BatchOptions, run_batch
told = []
run_batch(BatchOptions(manifest=Path(sys.argv[1]), workers=1), told.append)
end = next(event for event in told if isinstance(event, BatchFinished))
peaks = [resource.getrusage(who).ru_maxrss // 1024
         for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
print(json.dumps([end.done_count, end.feature_maps, *peaks]))
"""


def write_manifest(folder: Path, name: str, driver: Path, jobs: int) -> Path:
    path = folder / f"{name}.json"
    entries = [
        {"source": str(SOURCE), "driver": str(driver), "output": f"{name}/{index}.mp4"}
        for index in range(jobs)
    ]
    path.write_text(json.dumps({"version": 1, "jobs": entries}))
    return path


def run_manifest(path: Path) -> list[int]:
    """Jobs done, feature maps, and the peaks of scheduler and worker in MiB."""
    result = subprocess.run(
        [sys.executable, "-c", CHILD, str(path)], check=True, capture_output=True, text=True
    )
    return json.loads(result.stdout.splitlines()[-1])


def overhead(folder: Path, frame_count: int, preset: str, rounds: int) -> None:
    import numpy as np

    from motion_transfer.media.work import WorkFolder
    from motion_transfer.render.engine import TURN_TAKERS, Engine
    from motion_transfer.render.events import ignore
    from motion_transfer.render.options import RenderOptions
    from motion_transfer.render.run import prepare

    options = RenderOptions(
        source=SOURCE,
        driver=driver_folder(folder, frame_count),
        output=folder / "overhead.mp4",
        weights=random_checkpoint(folder, preset),
        compile=True,
    )
    with WorkFolder(options.output) as work:
        prepared, appearance = prepare(options, work, ignore)
    renderer, reader = prepared.recipe.renderer(appearance), prepared.driver.open()
    crops = np.stack([prepared.plan.shots[0].window.cut(iuv, 256) for iuv in reader.read(0, 4)])
    ratios = []
    for index in range(rounds):
        began = time.perf_counter()
        for _ in range(frame_count // len(crops)):
            renderer.render(crops)
        alone = time.perf_counter() - began
        began = time.perf_counter()
        engine = Engine(prepared, reader=reader, renderer=renderer)
        chunks = [(c, folder / f"{index}-{c.index}.nut") for c in prepared.plan.chunks]
        engine.render(chunks, TURN_TAKERS, lambda _chunk, _path: None)
        ratios.append((time.perf_counter() - began) / alone)
    ratios.sort()
    print(
        f"overhead, {preset}: engine over model alone, median {ratios[len(ratios) // 2]:.3f}"
        f" ({ratios[0]:.3f} to {ratios[-1]:.3f})"
    )


def shared(folder: Path) -> None:
    done, maps, *_ = run_manifest(write_manifest(folder, "shared", driver_folder(folder, 8), 20))
    print(f"shared: {done} jobs of one source, {maps} feature map")


def memory(folder: Path) -> None:
    for name, frames, jobs in (("once", 96, 4), ("frames", 768, 4), ("jobs", 96, 32)):
        path = write_manifest(folder, name, driver_folder(folder, frames), jobs)
        _, _, scheduler, worker = run_manifest(path)
        print(f"memory: {jobs} jobs of {frames} frames: scheduler {scheduler}, worker {worker} MiB")


def manifest(folder: Path) -> None:
    path = write_manifest(folder, "large", driver_folder(folder, 8), 10_000)

    def cpu_seconds() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before, began = cpu_seconds(), time.perf_counter()
    subprocess.run([*MT, "validate", str(path)], check=True, capture_output=True)
    wall, used = time.perf_counter() - began, cpu_seconds() - before
    print(f"manifest: 10,000 jobs validate in {wall:.1f} s ({used:.1f} s of a core)")
    began = time.perf_counter()
    with subprocess.Popen(
        [*MT, "run", str(path), "--json", "--workers", "1"], stdout=subprocess.PIPE, text=True
    ) as process:
        if process.stdout is None:
            raise RuntimeError("no pipe")
        process.stdout.readline()
        print(f"manifest: work begins after {time.perf_counter() - began:.1f} s")
        process.kill()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=96)
    parser.add_argument("--preset", default="lite")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", choices=("overhead", "shared", "memory", "manifest"))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        parts = {
            "manifest": lambda: manifest(folder),
            "shared": lambda: shared(folder),
            "overhead": lambda: overhead(
                folder, arguments.frames, arguments.preset, arguments.rounds
            ),
            "memory": lambda: memory(folder),
        }
        for name, part in parts.items():
            if arguments.only in (None, name):
                part()


if __name__ == "__main__":
    main()
