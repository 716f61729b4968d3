"""What becomes of runs that are killed, starved, cut off or confused: counted, by public commands.

    python benchmarks/faults.py [kills ray full_disk memory vanishing replaced clock two_runs]

Each fault is tried on real runs of `mt`, in processes of their own, at random moments from a seed.
A try is right if it ends as docs/reliability.md promises. Prints a line for each kind, and one for
each try that was not right; exits with 1 if there was one.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from workload import SOURCE, driver_folder

FRAMES = 144
"""Three chunks, so that a kill finds some of them finished and others not."""

MT = [sys.executable, "-B", "-m", "motion_transfer"]
ON_SMALL_DISK = (
    'mount -t tmpfs -o size="$0" tmpfs "$1" && cd "$1" && shift && "$@"; r=$?; ls -A1; exit $r'
)
"""Runs a command on a file system of its own, and lists what is left there."""

Tries = Iterator[str]
"""What was wrong with each try; nothing if it was right."""


class Bench:
    """A folder with inputs, and the bytes that a run without faults makes of them."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder = folder
        self.random = random.Random(seed)
        self.source = Path(shutil.copy(SOURCE, folder / "person.png"))
        shutil.copy(SOURCE.with_name("source_IUV.png"), folder / "person_IUV.png")
        self.driver = driver_folder(folder, FRAMES)
        began = time.monotonic()
        self.whole = self.run(folder / "whole.mp4").read_bytes()
        self.seconds = time.monotonic() - began

    def words(self, output: Path, *more: object) -> list[str]:
        given = ("--source", self.source, "--driver", self.driver, "-o", output, *more)
        return [*MT, "run", "--renderer", "texture", *map(str, given)]

    def run(self, output: Path, *more: object) -> Path:
        subprocess.run([*self.words(output, *more), "-q"], check=True, capture_output=True)
        return output

    def output(self, name: str) -> Path:
        """Name an output in an empty folder."""
        folder = self.folder / "outputs"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return folder / name

    def kill(self, output: Path, share: float, *more: object) -> bool:
        """Start a run, and kill it after a share of its time; tell whether it had not ended."""
        process = subprocess.Popen(self.words(output, "-q", *more), start_new_session=True)
        time.sleep(self.seconds * share)
        if process.poll() is not None:
            return False
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return [*output.parent.iterdir()] != [output]  # else it was about to leave

    def compare(self, output: Path, **environment: str) -> str:
        """Go on with a run, and hold its output to the one without faults."""
        result = subprocess.run(
            self.words(output),
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | environment,
        )
        if result.returncode:
            return f"going on failed: {result.stderr.strip()}"
        left = [item.name for item in output.parent.iterdir() if item != output]
        if left:
            return f"{left} are left"
        return "" if output.read_bytes() == self.whole else "other bytes"


def kills(bench: Bench) -> Tries:
    """SIGKILL at any moment, then the same command again: the bytes of a run never killed."""
    killed = 0
    while killed < 50:
        output = bench.output("out.mp4")
        # the first third only loads libraries
        share = bench.random.uniform(1 / 3, 1)
        if bench.kill(output, share, "--workers", 1 + killed % 3):
            killed += 1
            yield bench.compare(output)


def ray(bench: Bench) -> Tries:
    """A node at a time, each of which dies when it has finished a chunk, until 20 are lost."""
    try:
        from ray.cluster_utils import Cluster
    except ImportError:
        print("ray: not installed; pip install 'motion-transfer[cluster]'")
        return
    output = bench.output("out.mp4")
    count = 24 * 48
    driver = driver_folder(bench.folder, count)
    words = ("--source", bench.source, "--driver", driver, "-o", bench.folder / "long.mp4", "-q")
    subprocess.run([*MT, "run", "--renderer", "texture", *map(str, words)], check=True)
    job = {"source": str(bench.source), "driver": str(driver), "output": output.name}
    manifest = bench.folder / "lost.json"
    manifest.write_text(
        json.dumps(
            {
                "version": 1,
                "output_root": str(output.parent),
                "retries": 10,
                "jobs": [{**job, "renderer": "texture"}],
            }
        )
    )
    cluster, lost = Cluster(initialize_head=True, head_node_args={"num_cpus": 0}), 0
    try:
        nodes = [cluster.add_node(num_cpus=1)]
        address = ("--engine", "ray", "--address", str(cluster.address), "--workers", "1", "--json")
        with subprocess.Popen(
            [*MT, "batch", "run", str(manifest), *address], stdout=subprocess.PIPE, text=True
        ) as process:
            for line in process.stdout or ():
                if json.loads(line)["event"] == "job-frames" and lost < 20:
                    while len(nodes) < 2:  # the other one takes over
                        nodes.append(cluster.add_node(num_cpus=1))
                    cluster.remove_node(nodes.pop(0), allow_graceful=False)
                    lost += 1
    finally:
        cluster.shutdown()
    same = process.returncode == 0
    same = same and output.read_bytes() == (bench.folder / "long.mp4").read_bytes()
    for _ in range(lost):
        yield "" if same else f"the batch ended with {process.returncode}, or other bytes"


def full_disk(bench: Bench) -> Tries:
    """A disk that is full at ten places: one line says so, and nothing half-written is left."""
    driver = driver_folder(bench.folder, 48)
    run = ["run", "--renderer", "texture", "--source", str(bench.source), "--driver"]
    whole, part = [*run, str(bench.driver)], [*run, str(driver)]
    iuv = ["iuv", "convert", str(driver), "-o"]
    kilobytes = len(bench.whole) >> 10
    places = [
        ("4k", [*whole, "-o", "out.mp4"]),  # the work folder
        (f"{kilobytes // 6}k", [*whole, "-o", "out.mp4"]),  # the first segments
        (f"{kilobytes * 2 // 3}k", [*whole, "-o", "out.mp4"]),  # a later one
        (f"{kilobytes * 3 // 2}k", [*whole, "-o", "out.mp4"]),  # joining
        ("1m", [*whole, "-o", "frames"]),
        ("200k", [*whole, "-o", "out.gif"]),
        ("200k", [*whole, "--codec", "ffv1", "-o", "out.mkv"]),
        ("100k", [*iuv, "iuv"]),
        ("100k", [*iuv, "iuv.mkv"]),
        ("100k", [*iuv, "iuv.npy"]),
        ("60k", [*part, "--sheet", "sheet.png", "-o", "out.mp4"]),
    ]
    for size, words in places:
        disk = bench.output("disk")
        disk.mkdir()
        small = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", ON_SMALL_DISK]
        result = subprocess.run(
            [*small, size, str(disk), *MT, *words, *(["-q"] if words[0] == "run" else [])],
            capture_output=True,
            text=True,
            check=False,
        )
        place = f"{words[-1]} on {size}"
        half = [name for name in result.stdout.split() if not name.startswith(".")]
        if result.returncode != 2 or "disk is full" not in result.stderr:
            yield f"{place}: exit code {result.returncode}, {result.stderr.strip()!r}"
        elif len(result.stderr.splitlines()) > 1 or half:
            yield f"{place}: {result.stderr!r}, {half} left"
        else:
            yield ""


PEAK = """
import re, sys
from motion_transfer.cli.main import main
main(sys.argv[1:])
print(re.search(r"VmPeak:\\s*(\\d+)", open("/proc/self/status").read())[1])
"""
"""Runs a command, and tells the most address space that it had, in KiB."""


def memory(bench: Bench) -> Tries:
    """Ten limits between what libraries need and what a run does: whole, or one line says why."""
    import resource

    def peak(*words: str) -> int:
        command = [sys.executable, "-B", "-c", PEAK, *words]
        result = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        return int(result.stdout.split()[-1]) * 1024

    words = bench.words(bench.output("out.mp4"), "-q", "--force")[len(MT) :]
    least, most = peak(*words, "--frames", "0:1"), peak(*words)
    for number in range(10):
        size = least + (most - least) * number // 10
        output = bench.output("out.mp4")
        result = subprocess.run(
            bench.words(output, "-q"),
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=lambda size=size: resource.setrlimit(resource.RLIMIT_AS, (size, size)),
        )
        lines = result.stderr.splitlines()
        if result.returncode == 0:
            yield "" if output.read_bytes() == bench.whole else "other bytes"
        elif len(lines) != 1 or "memory" not in lines[0] or output.exists():
            yield f"{size >> 20} MiB: exit code {result.returncode}, {lines[:1]}...{lines[-1:]}"
        else:
            yield bench.compare(output)


def at_stage(bench: Bench, stage: str, change: Callable[[], object]) -> tuple[int, list[str]]:
    """Do something when a run has begun a stage; give its exit code and what it complained of."""
    words = bench.words(bench.output("out.mp4"), "--json", "--workers", 1)
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        now = ""
        assert process.stdout is not None and process.stderr is not None
        for line in process.stdout:
            event: dict[str, Any] = json.loads(line)
            now = event.get("name", now) if event["event"] == "stage" else now
            if event["event"] == "frames-done" and event["frame_count"] and now == stage:
                change()
                stage = "-"
        return process.wait(), process.stderr.read().splitlines()


def vanishing(bench: Bench) -> Tries:
    """An input is deleted while the driver is looked through, or drawn: one line names it."""
    yield from disturbed(bench, Path.unlink)


def replaced(bench: Bench) -> Tries:
    """An input is replaced, in place or by renaming: one line names it, and nothing is mixed."""

    def rewrite(file: Path) -> None:
        other = bench.driver / "00100_IUV.png" if file.parent == bench.driver else DRESSED
        file.write_bytes(other.read_bytes())

    def rename(file: Path) -> None:
        copy = file.with_name(f".{file.name}")
        rewrite(copy) if file.parent != bench.driver else shutil.copy(
            bench.driver / "00100_IUV.png", copy
        )
        copy.replace(file)

    yield from disturbed(bench, rewrite)
    yield from disturbed(bench, rename)


DRESSED = SOURCE.with_name("source_IUV.png")
"""A picture of the source's size, in other colours."""


def disturbed(bench: Bench, change: Callable[[Path], object]) -> Tries:
    frames = [bench.driver / f"{number:05d}_IUV.png" for number in (0, FRAMES - 1)]
    tries = [("scan", frames[0]), ("scan", frames[1]), ("render", frames[0])]
    tries += [("render", frames[1]), ("render", bench.source)]
    for stage, file in tries:
        before = file.read_bytes()
        code, lines = at_stage(bench, stage, lambda file=file: change(file))
        file.write_bytes(before)
        if code != 2 or len(lines) != 1 or file.name not in lines[0]:
            yield f"{file.name} during {stage}: exit code {code}, {lines}"
        else:  # the file is as it was, and so has the output to be
            yield bench.compare(bench.folder / "outputs/out.mp4")


JUMPS = """
import time
began, real, real_ns = time.monotonic(), time.time, time.time_ns
hours = lambda: int((time.monotonic() - began) * 5)
time.time = lambda: real() - 3600 * hours()
time.time_ns = lambda: real_ns() - 3600 * 10**9 * hours()
"""
"""A clock that is set back by an hour five times a second."""


def clock(bench: Bench) -> Tries:
    """Files of the future and of the past, and runs while the clock is set back again and again."""
    for year in (1975, 2000, 2060, 2100):
        output = bench.output("out.mp4")
        while not bench.kill(output, 0.8):
            output = bench.output("out.mp4")
        seconds = (year - 1970) * 365 * 86400
        for file in (*bench.driver.iterdir(), bench.source, *output.parent.rglob("*")):
            os.utime(file, (seconds, seconds))
        yield bench.compare(output)
    (bench.folder / "sitecustomize.py").write_text(JUMPS)
    path = os.pathsep.join(filter(None, (str(bench.folder), os.environ.get("PYTHONPATH"))))
    for _ in range(4):
        yield bench.compare(bench.output("out.mp4"), PYTHONPATH=path)


def two_runs(bench: Bench) -> Tries:
    """Two runs of one output at once: one makes it, the other says who is at work."""
    for _ in range(10):
        output = bench.output("out.mp4")
        runs = [
            subprocess.Popen(bench.words(output, "-q"), stderr=subprocess.PIPE, text=True)
            for _ in range(2)
        ]
        errors = [run.communicate()[1] for run in runs]
        codes = sorted(run.returncode for run in runs)
        refusal = "".join(errors)
        if codes != [0, 2] or not ("is at work on it" in refusal or "exists already" in refusal):
            yield f"exit codes {codes}: {refusal}"
        else:
            yield "" if output.read_bytes() == bench.whole else "other bytes"


FAULTS = (kills, ray, full_disk, memory, vanishing, replaced, clock, two_runs)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("faults", nargs="*", help="those to try; all by default")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), arguments.seed)
        for fault in FAULTS:
            if arguments.faults and fault.__name__ not in arguments.faults:
                continue
            began = time.monotonic()
            right = count = 0
            for count, words in enumerate(fault(bench), 1):
                right += not words
                if words:
                    print(f"    {fault.__name__}, try {count}: {words}", flush=True)
                elif count % 10 == 0:
                    print(f"    {fault.__name__}: {right} of {count} so far", flush=True)
            wrong += count - right
            seconds = time.monotonic() - began
            print(f"{fault.__name__}: {right} of {count} right, {seconds:.0f} s", flush=True)
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
