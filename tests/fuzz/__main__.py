"""Run it: `python -m fuzz [TARGET ...] --seconds 600`, from the folder of the tests.

Every target is read in a process of its own, of limited memory, which is watched: what it was
reading when it died, hung or failed is kept, made as small as can be where it failed.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

MEMORY_BYTES = 6 << 30  # of a reading process: torch alone maps 3
SLOW_SECONDS = 10  # for one small file, on a machine that does other things as well
HANGING_SECONDS = 60
ROUND = 1000  # examples of one run of Hypothesis


def main() -> int:
    arguments = _parse()
    if arguments.into:
        return _read_until(arguments.targets[0], arguments.seconds, arguments.seed, arguments.into)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        found = list(pool.map(lambda name: _watch(name, arguments), arguments.targets))
    return int(any(found))


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="fuzz", description=str(__doc__))
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="default: all")
    parser.add_argument("--seconds", type=float, default=600, help="for each target")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 32))
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="targets at a time")
    parser.add_argument("--keep", type=Path, default=Path("found"), help="folder for what is found")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not arguments.into:
        from fuzz.targets import TARGETS

        if unknown := set(arguments.targets) - set(TARGETS):
            parser.error(f"unknown: {', '.join(unknown)}; there are {', '.join(TARGETS)}")
        arguments.targets = arguments.targets or list(TARGETS)
    return arguments


def _watch(name: str, arguments: argparse.Namespace) -> bool:
    """Have one target read in another process; keep what it does not survive. Returns: if any."""
    with tempfile.TemporaryDirectory() as folder:
        into = Path(folder)
        words = [sys.executable, "-m", "fuzz", name, "--into", folder]
        words += ["--seconds", str(arguments.seconds), "--seed", str(arguments.seed)]
        with (into / "said").open("wb") as said:
            process = subprocess.Popen(words, stdout=said, stderr=subprocess.DEVNULL)
            hangs = False
            while process.poll() is None:
                time.sleep(1)
                pulse = into / "pulse"
                if pulse.exists() and time.time() - pulse.stat().st_mtime > HANGING_SECONDS:
                    hangs = True
                    process.kill()
        last = (into / "said").read_text(errors="replace").strip()
        if process.returncode == 0:
            print(f"{name}: {last}, nothing found (seed {arguments.seed})", flush=True)
            return False
        arguments.keep.mkdir(exist_ok=True)
        input_path = Path((into / "current").read_text())
        kept = arguments.keep / f"{name}-{arguments.seed}{input_path.suffix}"
        shutil.copyfile(input_path, kept)
        how = "hangs" if hangs else f"ends with {process.returncode}"
        print(f"{name}: {how}, input in {kept} (seed {arguments.seed})\n{last}", flush=True)
        return True


def _read_until(name: str, seconds: float, seed: int, into: Path) -> int:
    """Read changed files until the time is over, or one is not read as it should be."""
    import hypothesis
    from hypothesis import HealthCheck, Phase, given, settings
    from hypothesis import strategies as st

    from fuzz.targets import TARGETS

    target = TARGETS[name]
    place = into / "files"
    place.mkdir()
    # all suffixes share one folder: what a file refers to lies beside it
    seeds = [(path.suffix, path.read_bytes()) for path in target.seeds(place)]
    limit = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, limit))
    noise = os.open(into / "noise", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    os.dup2(noise, sys.stderr.fileno())
    count, ends, rounds = 0, time.monotonic() + seconds, 0
    files = st.sampled_from(seeds).flatmap(
        lambda seed: st.tuples(st.just(seed[0]), target.change(seed[1]))
    )

    def read(file: tuple[str, bytes]) -> None:
        nonlocal count
        if time.monotonic() > ends:
            return
        count += 1
        path = place / f"input{file[0]}"
        path.write_bytes(file[1])
        (into / "current").write_text(str(path))
        (into / "pulse").touch()
        _read_one(target.read, path, noise)

    while time.monotonic() < ends:
        rounds += 1
        chosen = settings(
            max_examples=ROUND,
            deadline=None,
            database=None,
            phases=[Phase.generate, Phase.shrink],
            suppress_health_check=tuple(HealthCheck),  # pyright: ignore[reportArgumentType]
        )
        try:
            hypothesis.seed(seed + rounds)(chosen(given(files)(read)))()
        except Exception as error:
            error.__notes__ = []  # the whole file, which is kept anyway
            print(traceback.format_exc(), flush=True)
            return 1
    print(f"{count} files in {seconds:.0f} s")
    return 0


def _read_one(read: object, path: Path, noise: int) -> None:
    """Read a file. Raises: whatever was wrong with the way it was read or refused."""
    from motion_transfer.errors import MotionTransferError

    assert callable(read)
    os.ftruncate(noise, 0)
    began = time.monotonic()
    try:
        read(path)
    except MotionTransferError as error:
        assert error.exit_code == 2, f"refused with exit code {error.exit_code}"
        assert all("\n" not in line for line in error.lines), f"several lines: {error}"
    took = time.monotonic() - began
    assert took < SLOW_SECONDS, f"took {took:.1f} s"
    said = os.pread(noise, 2000, 0).strip(b"\0")
    assert not said, f"on standard error: {said.decode(errors='replace')}"


if __name__ == "__main__":
    sys.exit(main())
