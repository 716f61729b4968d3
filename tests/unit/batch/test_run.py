"""One run at a time on a manifest, and on an output; who died holds nothing."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

HOLD = """
import sys, time
from pathlib import Path
from motion_transfer.media.work import locked
with locked(Path(sys.argv[1]), "x"):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def manifest(studio) -> Path:
    studio.source("anna")
    studio.array(2, name="walk.npy")
    path = studio.folder / "shoot.yaml"
    path.write_text("version: 1\njobs: [{source: anna.png, driver: walk.npy, output: a.png}]\n")
    return path


@pytest.fixture
def holder(manifest: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that is at work on the manifest."""
    folder = manifest.parent / ".shoot.batch"
    folder.mkdir()
    command = [sys.executable, "-c", HOLD, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_second_run_is_refused_and_a_stale_lock_is_not_minded(mt, manifest, holder) -> None:
    from motion_transfer.batch.run import read_batch

    refused = mt("batch", "run", manifest)
    assert (refused.code, refused.out) == (2, "")
    assert refused.err.startswith(f"mt: manifest {manifest}: process {holder.pid} on ")
    assert refused.err.endswith(" is at work on it; wait for it, or stop it\n")
    holder.kill()
    holder.wait()
    assert (manifest.parent / ".shoot.batch/lock").exists()
    with read_batch(manifest).state.held():
        pass


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--jobs", "x"), "jobs 'x'; write START:STOP"),
        (("--jobs", "3:7"), "jobs 3:7 asked for, but"),
        (("--engine", "moon"), "engine 'moon'; supported are local, ray"),
        (("--workers", "0"), "workers is 0; it must be at least 1"),
        (("--address", "auto"), "add --engine ray"),
        (("--set", "colour=red"), "--set colour=red: unknown field; "),
    ],
)
def test_what_a_run_refuses(mt, manifest, words, message: str) -> None:
    refused = mt("batch", "run", manifest, *words)
    assert (refused.code, refused.out) == (2, "")
    assert message in refused.err
    assert not (manifest.parent / ".shoot.batch").exists()


def test_jobs_are_chosen_by_their_numbers(tmp_path: Path) -> None:
    from motion_transfer.batch.run import BatchOptions, choose_jobs, read_batch

    path = tmp_path / "many.yaml"
    lines = "\n".join(f"  - {{source: a.png, driver: d, output: {n}.png}}" for n in range(9))
    path.write_text(f"version: 1\njobs:\n{lines}\n")
    jobs = read_batch(path).jobs
    for chosen, expected in [((3, 7), [3, 4, 5, 6]), ((None, 2), [0, 1]), ((7, None), [7, 8])]:
        options = BatchOptions(manifest=path, chosen=chosen)
        assert [job.index for job in choose_jobs(jobs, options)] == expected


@pytest.mark.parametrize("length", [240, 255])
def test_a_manifest_with_a_name_as_long_as_can_be_is_run(mt, manifest: Path, length: int) -> None:
    long = manifest.rename(manifest.with_name("人" * ((length - 5) // 3) + ".yaml"))
    assert mt("batch", "run", long, "--set", "frames=0:1", "--workers", "1").code == 0
    assert (manifest.parent / "a.png").exists()
    (report,) = manifest.parent.glob("人*.report/index.html")
    assert len(report.parent.name.encode()) <= 255
    assert mt("batch", "clean", long).out == "removed 1 work folder\n"
