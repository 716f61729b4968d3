"""Batches: the engine over the bare model, shared sources, memory, workers, large manifests.

    python benchmarks/batch.py [--only manifest] [--frames 96] [--preset lite] [--quick]

Prints, each against its own baseline:
* `manifest`: reading and checking 10,000 jobs, and how long until the first of them begins;
* `shared`: feature maps computed for 20 jobs of one source;
* `overhead`: rendering chunks (decode, model, paste, encode) over the model alone, one worker, each
  with all cores; the model alone in as many threads as the engine's, and one call after the other;
* `workers`: frames a second of the network, by how the cores are shared out between workers and
  their threads; decides the default number of workers;
* `memory`: peak of the scheduler and of a worker, at 1 and 8 times the frames and the jobs.
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
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as the command does, before torch

from workload import SOURCE, driver_folder, weights_of

MT = [sys.executable, "-m", "motion_transfer", "batch"]
JOBS = 10_000
CHILD = """
import json, resource, sys, time
from pathlib import Path
from motion_transfer.batch.events import BatchFinished, JobDone, JobFrames
from motion_transfer.batch.run import BatchOptions, run_batch
told = []
listener = lambda event: told.append((time.perf_counter(), event))
run_batch(BatchOptions(manifest=Path(sys.argv[1]), workers=int(sys.argv[2])), listener)
end = next(event for _, event in told if isinstance(event, BatchFinished))
drawn = [(moment, event.frame_count) for moment, event in told if isinstance(event, JobFrames)]
peaks = [resource.getrusage(who).ru_maxrss // 1024
         for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
# once as many jobs are done as there are workers, all of these are warm
warm = sorted(moment for moment, event in told if isinstance(event, JobDone))[int(sys.argv[2]) - 1]
later = sum(count for moment, count in drawn if moment > warm)
print(json.dumps({"done": end.done_count, "maps": end.feature_maps, "scheduler": peaks[0],
                  "worker": peaks[1], "rate": later / max(1e-9, drawn[-1][0] - warm)}))
"""


@dataclass(frozen=True)
class Sizes:
    """How much is measured."""

    frames: int
    rounds: int
    preset: str
    quick: bool


def write_manifest(
    folder: Path, name: str, driver: Path, jobs: int, *, suffix: str = ".json", **defaults: Any
) -> Path:
    """A manifest of jobs of one source and driver; with the draft renderer if none is named."""
    path = folder / f"{name}{suffix}"
    entries = [
        {"source": str(SOURCE), "driver": str(driver), "output": f"{name}/{index}.mp4"}
        for index in range(jobs)
    ]
    content = {"version": 1, "defaults": {"renderer": "texture", **defaults}, "jobs": entries}
    if suffix == ".json":
        path.write_text(json.dumps(content))
    else:
        import yaml

        path.write_text(yaml.safe_dump(content))
    return path


def run_manifest(path: Path, workers: int = 1) -> dict[str, Any]:
    """Jobs done, feature maps, peaks of scheduler and worker in MiB, frames/s of warm workers."""
    command = [sys.executable, "-c", CHILD, str(path), str(workers)]
    result = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(result.stdout.splitlines()[-1])


def manifest(folder: Path, sizes: Sizes) -> None:
    def cpu_seconds() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    for suffix in (".json", ".yaml"):
        path = write_manifest(folder, "large", driver_folder(folder, 8), JOBS, suffix=suffix)
        walls, used = [], []
        for _ in range(sizes.rounds):
            before, began = cpu_seconds(), time.perf_counter()
            subprocess.run([*MT, "validate", str(path)], check=True, capture_output=True)
            walls.append(time.perf_counter() - began)
            used.append(cpu_seconds() - before)
        print(
            f"manifest: {JOBS} jobs{suffix} validate in {median(walls):.1f} s, median"
            f" ({min(walls):.1f} to {max(walls):.1f}; {median(used):.1f} s of a core)",
            flush=True,
        )
    moments: dict[str, list[float]] = {"batch-started": [], "job-planned": []}
    for _ in range(sizes.rounds):
        began = time.perf_counter()
        command = [*MT, "run", str(folder / "large.json"), "--json", "--workers", "1"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            if process.stdout is None:
                raise RuntimeError("no pipe")
            for line in process.stdout:
                kind = json.loads(line)["event"]
                if kind in moments:
                    moments[kind].append(time.perf_counter() - began)
                if kind == "job-planned":
                    process.kill()
                    break
    print(
        f"manifest: {JOBS} jobs start after {median(moments['batchstarted']):.1f} s, median; the"
        f" first is planned after {median(moments['jobplanned']):.1f} s",
        flush=True,
    )


def shared(folder: Path, sizes: Sizes) -> None:
    weights = str(weights_of(folder, sizes.preset))
    network = {"renderer": "nhrr", "weights": weights, "frames": "0"}
    driver = driver_folder(folder, 8)
    told = run_manifest(write_manifest(folder, "shared", driver, 20, suffix=".json", **network))
    print(f"shared: {told['done']} jobs of one source, {told['maps']} feature map", flush=True)


def overhead(folder: Path, sizes: Sizes) -> None:
    import numpy as np
    import torch

    from motion_transfer.drawing.engines.threads import one_torch_thread
    from motion_transfer.events import ignore
    from motion_transfer.media.work import WorkFolder
    from motion_transfer.render.engine import Engine
    from motion_transfer.render.options import RenderOptions
    from motion_transfer.render.run import prepare

    options = RenderOptions(
        source=(SOURCE,),
        driver=driver_folder(folder, sizes.frames),
        output=folder / "overhead.mp4",
        renderer="nhrr",
        weights=weights_of(folder, sizes.preset),
    )
    with WorkFolder(options.output) as work:
        composed = prepare(options, work, ignore)
    prepared = composed.prepared
    renderer = prepared.recipe.renderer(composed.appearances[0])
    [reader] = prepared.open_people()
    window = prepared.plan.shots[0].window
    side = renderer.working_size(window.side)
    iuv = reader.read(0, renderer.batch_size(side))
    crops = np.stack([window.cut(frame, side) for frame in iuv])
    cores = torch.get_num_threads()
    batches = range(sum(-(-(c.stop - c.start) // len(crops)) for c in prepared.plan.chunks))

    def in_turn() -> None:
        for _ in batches:
            renderer.render(crops)

    def side_by_side() -> None:
        with one_torch_thread(), ThreadPoolExecutor(cores) as threads:
            for _ in threads.map(lambda _: renderer.render(crops), batches):
                pass

    def engine() -> None:
        chunks = [(c, Path(temporary) / f"{c.index}.nut") for c in prepared.plan.chunks]
        whole = Engine(
            prepared, readers=[reader], renderers=[renderer], backdrop=prepared.backdrop.open()
        )
        whole.render(chunks, cores, lambda _chunk, _path: None)

    seconds: dict[Callable[[], None], list[float]] = {in_turn: [], side_by_side: [], engine: []}
    renderer.render(crops)
    for _ in range(sizes.rounds):
        for way, found in seconds.items():
            with tempfile.TemporaryDirectory(dir=folder) as temporary:
                began = time.perf_counter()
                way()
                found.append(time.perf_counter() - began)
    for way, name in ((side_by_side, f"in {cores} threads"), (in_turn, "one call at a time")):
        ratios = [ours / alone for ours, alone in zip(seconds[engine], seconds[way], strict=True)]
        print(
            f"overhead, {sizes.preset}: engine over model alone, {name}"
            f" ({sizes.frames / median(seconds[way]):.1f} frames/s), median {median(ratios):.3f}"
            f" ({min(ratios):.3f} to {max(ratios):.3f})",
            flush=True,
        )


def workers(folder: Path, sizes: Sizes) -> None:
    cores = len(os.sched_getaffinity(0))
    weights = str(weights_of(folder, sizes.preset))
    network = {"renderer": "nhrr", "weights": weights}
    counts = [count for count in (1, 2, 4, 8, 16, 32) if count <= cores]
    driver = driver_folder(folder, sizes.frames)
    rates: dict[int, list[float]] = {count: [] for count in counts}
    for turn in range(sizes.rounds):
        for count in counts:
            name = f"workers{count}_{turn}"
            path = write_manifest(folder, name, driver, 2 * cores, **network)
            rates[count].append(run_manifest(path, count)["rate"])
    for count in counts:
        rate = median(rates[count])
        print(
            f"workers, {sizes.preset}: {count} x {max(1, cores // count)} threads:"
            f" {rate:.1f} frames/s, {rate / median(rates[1]):.2f} times one worker's",
            flush=True,
        )


def memory(folder: Path, sizes: Sizes) -> None:
    base: dict[str, int] = {}
    few, many = (1, 2) if sizes.quick else (4, 32)
    for name, frames, jobs in (
        ("once", sizes.frames, few),
        ("frames", 8 * sizes.frames, few),
        ("jobs", sizes.frames, many),
    ):
        path = write_manifest(folder, name, driver_folder(folder, frames), jobs)
        told = run_manifest(path)
        base = base or told
        print(
            f"memory: {jobs} jobs of {frames} frames: "
            + ", ".join(
                f"{who} {told[who]} MiB ({told[who] / base[who]:.2f} times)"
                for who in ("scheduler", "worker")
            ),
            flush=True,
        )


PARTS: dict[str, Callable[[Path, Sizes], None]] = {
    "manifest": manifest,
    "shared": shared,
    "overhead": overhead,
    "workers": workers,
    "memory": memory,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=96)
    parser.add_argument("--preset", default="lite")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="once, and little")
    parser.add_argument("--only", choices=tuple(PARTS))
    given = parser.parse_args()
    frames, rounds = (8, 1) if given.quick else (given.frames, given.rounds)
    sizes = Sizes(frames, rounds, given.preset, given.quick)
    with tempfile.TemporaryDirectory() as temporary:
        for name, part in PARTS.items():
            if given.only in (None, name):
                part(Path(temporary), sizes)


if __name__ == "__main__":
    main()
