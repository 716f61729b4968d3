"""What a scene costs: a video behind over a picture behind and over its decoding, light, alpha.

    python benchmarks/scene.py [--rounds 5] [--frames 480] [--renderer texture]

Whole runs of `mt run` of a person into a frame of 1280 x 720, interleaved; medians of seconds and
of CPU seconds of the whole command, and what each adds to a picture behind. `decoding` decodes the
video to RGB and does nothing else, which is the most that a video behind should add.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from workload import SOURCE, driver_folder

from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import write_png

COMMAND = (sys.executable, "-m", "motion_transfer", "run", "--quiet", "--force")
SIZE = (720, 1280)


def write_clip(path: Path, count: int) -> Path:
    """A moving texture in H.264, as a phone would have it: a key frame every 250."""
    random = np.random.default_rng(0)
    wide = random.integers(0, 255, (90, 160 + count // 4, 3), np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=Fraction(30), options={"preset": "veryfast"})
        stream.height, stream.width = SIZE
        stream.pix_fmt = "yuv420p"
        for index in range(count):
            view = np.ascontiguousarray(wide[:, index // 4 : index // 4 + 160])
            frame = av.VideoFrame.from_ndarray(view, format="rgb24")
            container.mux(stream.encode(frame.reformat(SIZE[1], SIZE[0], "yuv420p")))
        container.mux(stream.encode(None))
    return path


def timed(words: list[str]) -> tuple[float, float]:
    """Run a command; its seconds, and its CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - began, cpu


def decode(path: Path) -> tuple[float, float]:
    """Decode a clip to RGB; seconds and CPU seconds."""
    began, cpu = time.perf_counter(), time.process_time()
    for _ in open_pictures(path).read():
        pass
    return time.perf_counter() - began, time.process_time() - cpu


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=480)
    parser.add_argument("--renderer", default="texture")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        clip = write_clip(folder / "behind.mp4", options.frames)
        picture = folder / "behind.png"
        write_png(picture, next(open_pictures(clip).read()))
        driver = driver_folder(folder, options.frames)
        run = [*COMMAND, "--source", str(SOURCE), "--driver", str(driver)]
        run += ["--renderer", options.renderer, "-o", str(folder / "out.mp4")]
        still = ["--background", str(picture), "--size", "background"]
        kinds = {
            "picture": still,
            "video": ["--background", str(clip), "--size", "background"],
            "blurred": [*still, "--background-blur", "1"],
            "shadow": [*still, "--shadow"],
            "light": [*still, "--match-colours"],
        }
        found: dict[str, list[tuple[float, float]]] = defaultdict(list)
        for _ in range(options.rounds):
            found["decoding"].append(decode(clip))
            for kind, words in kinds.items():
                found[kind].append(timed([*run, *words]))
    print(f"{options.frames} frames of {SIZE[1]} x {SIZE[0]}, {len(os.sched_getaffinity(0))} cores")
    for kind, rounds in found.items():
        seconds, cpu = (statistics.median(values) for values in zip(*rounds, strict=True))
        line = f"{kind:9} {seconds:6.2f} s, {cpu:6.2f} s of CPU"
        if kind not in ("decoding", "picture"):
            added = [
                [mine - its for mine, its in zip(a, b, strict=True)]
                for a, b in zip(rounds, found["picture"], strict=True)
            ]
            more, more_cpu = (statistics.median(values) for values in zip(*added, strict=True))
            line += f"; over a picture {more:+.2f} s, {more_cpu:+.2f} s of CPU"
        print(line)


if __name__ == "__main__":
    main()
