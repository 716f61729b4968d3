"""Peak memory of whole runs, each in a process of its own, at two lengths.

    python benchmarks/memory.py [--frames 300 3000] [--weights FILE] [--scene]

Prints medians of the peak resident size and their ratio: it should be near 1. Single runs spread by
a tenth and more, because threads share memory out differently each time.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import statistics
import tempfile
from pathlib import Path

from scene import write_clip
from workload import SOURCE, driver_folder


def peak_mib(driver: Path, output: Path, weights: Path | None, behind: Path | None) -> float:
    """Run in a fresh process and report its peak resident size."""
    from motion_transfer import render_video

    renderer = "nhrr" if weights else "texture"
    scene = {"background": behind, "shadow": True} if behind else {}
    render_video(SOURCE, driver, output, renderer=renderer, weights=weights, **scene)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs=2, default=(300, 3000))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--weights", type=Path, help="measure nhrr instead of texture")
    parser.add_argument("--scene", action="store_true", help="with a video of that length behind")
    arguments = parser.parse_args()
    peaks: dict[int, list[float]] = {count: [] for count in arguments.frames}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for index in range(arguments.rounds):
            for count in arguments.frames:
                output = folder / f"{count}_{index}.mp4"
                clip = folder / f"{count}.mp4"
                if arguments.scene and not clip.exists():
                    write_clip(clip, count)
                behind = clip if arguments.scene else None
                job = (driver_folder(folder, count), output, arguments.weights, behind)
                with multiprocessing.get_context("spawn").Pool(1) as pool:
                    peaks[count].append(pool.apply(peak_mib, job))
    medians = [statistics.median(peaks[count]) for count in arguments.frames]
    for count, median in zip(arguments.frames, medians, strict=True):
        spread = f"{min(peaks[count]):.0f} to {max(peaks[count]):.0f}"
        print(f"{count} frames: peak, median of {arguments.rounds}: {median:.0f} MiB ({spread})")
    print(f"ratio: {medians[1] / medians[0]:.3f}")


if __name__ == "__main__":
    main()
