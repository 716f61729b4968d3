"""Peak memory of whole runs, each in a process of its own, at two lengths.

    python benchmarks/memory.py [--frames 300 3000] [--weights FILE]

Prints the peak resident size of each and their ratio: it should be near 1.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import tempfile
from pathlib import Path

from workload import SOURCE, driver_folder


def peak_mib(driver: Path, output: Path, weights: Path | None) -> float:
    """Run in a fresh process and report its peak resident size."""
    from motion_transfer import render_video

    render_video(SOURCE, driver, output, weights=weights, compile=False)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs=2, default=(300, 3000))
    parser.add_argument("--weights", type=Path, help="measure nhrr instead of texture")
    arguments = parser.parse_args()
    peaks = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for frame_count in arguments.frames:
            driver = driver_folder(folder, frame_count)
            job = (driver, folder / f"{frame_count}.mp4", arguments.weights)
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                peaks.append(pool.apply(peak_mib, job))
            print(f"{frame_count} frames: peak {peaks[-1]:.0f} MiB", flush=True)
    print(f"ratio: {peaks[1] / peaks[0]:.3f}")


if __name__ == "__main__":
    main()
