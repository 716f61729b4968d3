"""Batches through the real command: what is shared, what fails alone, what goes on after a stop."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
import yaml
from processes import wait_until_gone

from motion_transfer.render.plan import CHUNK_FRAMES

FRAMES = 2 * CHUNK_FRAMES + 7
EVERYTHING = 1_000_000
KILLS = int(os.environ.get("MT_KILLS", "1"))  # a long run sets more


@pytest.fixture
def shoot(studio) -> Path:
    """Two sources, two drivers, a matrix of four jobs."""
    for name in ("anna", "ben"):
        studio.source(name)
    studio.array(FRAMES, name="walk.npy")
    studio.array(9, name="wave.npy")
    return manifest(
        studio,
        defaults={"renderer": "texture"},
        matrix=[
            {
                "sources": ["anna.png", "ben.png"],
                "drivers": ["walk.npy", "wave.npy"],
                "output": "{source}_{driver}.mp4",
            }
        ],
    )


def manifest(studio, **content: object) -> Path:
    path = studio.folder / "shoot.yaml"
    head = {"version": 1, "output_root": "out", "defaults": {"renderer": "texture"}}
    path.write_text(yaml.safe_dump({**head, **content}))
    return path


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "motion_transfer", "batch", *map(str, words)]


def run(path: Path, *more: object) -> tuple[int, list[dict], str]:
    result = subprocess.run(
        command("run", path, "--json", *more), capture_output=True, text=True, check=False
    )
    return (
        result.returncode,
        [json.loads(line) for line in result.stdout.splitlines()],
        result.stderr,
    )


def named(told: list[dict], kind: str) -> list[dict]:
    return [event for event in told if event["event"] == kind]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.mp4"))}


def start(path: Path, *more: object) -> subprocess.Popen[str]:
    """A batch as a shell starts it: its Ctrl-C goes to all its processes."""
    return subprocess.Popen(
        command("run", path, "--json", *more),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def follow(process: subprocess.Popen[str], kind: str) -> None:
    """Read events until one of a kind."""
    assert process.stdout is not None
    for line in process.stdout:
        if json.loads(line)["event"] == kind:
            return
    raise AssertionError(f"ended without {kind}: {process.communicate()[1]}")


def killed_after(process: subprocess.Popen[str], count: int, finished: Counter[str]) -> None:
    """Kill a batch after so many events."""
    assert process.stdout is not None
    told = []
    for line in process.stdout:
        told.append(json.loads(line))
        if len(told) == count:
            process.kill()
            break
    note_finished(told, finished)


def note_finished(told: list[dict], finished: Counter[str]) -> None:
    """Count each job's finished frames; of what was finished before, nothing is done twice."""
    for event in told:
        if event["event"] == "job-planned":
            assert event["done_count"] >= finished[event["name"]]
            finished[event["name"]] = event["done_count"]
        if event["event"] == "job-frames":
            finished[event["name"]] += event["frame_count"]
        if event["event"] == "job-done":
            finished[event["name"]] = EVERYTHING


def kill_after(path: Path, frames_events: int, number: int, *more: object) -> int:
    """Start a batch, send it a signal after so many chunks; its exit code."""
    with subprocess.Popen(
        command("run", path, "--json", "--workers", 1, *more),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        assert process.stdout is not None
        count = 0
        for line in process.stdout:
            count += json.loads(line)["event"] == "job-frames"
            if count == frames_events:
                process.send_signal(number)
                count = -1_000_000
        return process.wait(120)


def test_workers_and_kills_change_nothing_and_sources_are_shared(studio, shoot: Path) -> None:
    code, told, errors = run(shoot, "--workers", 2)
    assert (code, errors) == (0, "")
    whole = contents(studio.folder / "out")
    assert list(whole) == ["anna_walk.mp4", "anna_wave.mp4", "ben_walk.mp4", "ben_wave.mp4"]
    finished = named(told, "batch-finished")[0]
    assert (finished["done_count"], finished["feature_maps"]) == (4, 2)

    other = "output_root=other"
    finished: Counter[str] = Counter()
    moments = random.Random(0)
    for number in range(KILLS):
        with start(shoot, "--set", other, "--workers", 1 + number % 3) as process:
            killed_after(process, moments.randrange(2, 16), finished)
        wait_until_gone(process.pid)
        assert contents(studio.folder / "other").items() <= whole.items()
    code, told, _ = run(shoot, "--workers", 1, "--set", other)
    assert code == 0
    note_finished(told, finished)
    assert contents(studio.folder / "other") == whole
    left = {item.name for item in (studio.folder / "other").iterdir()} - set(whole)
    assert left == {".shoot.batch", "shoot.report"}

    single = studio.folder / "single.mp4"
    words = ["run", "--renderer", "texture", "--source", studio.folder / "anna.png"]
    words += ["--driver", studio.folder / "walk.npy"]
    subprocess.run(
        [sys.executable, "-m", "motion_transfer", *map(str, words), "-o", str(single)], check=True
    )
    assert single.read_bytes() == whole["anna_walk.mp4"]

    code, told, _ = run(shoot)  # nothing is to do
    assert named(told, "batch-finished")[0]["current_count"] == 4
    studio.source("ben", colours={(2,): (9, 9, 9)})
    code, told, _ = run(shoot, "--workers", 1)
    finished = named(told, "batch-finished")[0]
    assert (code, finished["done_count"], finished["current_count"]) == (0, 2, 2)
    assert contents(studio.folder / "out")["ben_walk.mp4"] != whole["ben_walk.mp4"]


def test_jobs_fail_alone_and_go_on_when_mended(studio, shoot: Path) -> None:
    damaged = studio.driver(3, name="damaged")
    good = (damaged / "frame_1_IUV.png").read_bytes()
    (damaged / "frame_1_IUV.png").write_bytes(good[:60])
    jobs = [
        {"source": "gone.png", "driver": "wave.npy", "output": "gone.mp4"},
        {"source": "anna.png", "driver": "damaged", "output": "damaged.mp4"},
        {"source": "anna.png", "driver": "wave.npy", "output": "taken.mp4"},
        {"source": "anna.png", "driver": "wave.npy", "output": "good.mp4"},
    ]
    path = manifest(studio, defaults={"renderer": "texture"}, jobs=jobs)
    (studio.folder / "out").mkdir()
    (studio.folder / "out/taken.mp4").write_text("mine")
    code, told, _ = run(path, "--workers", 1)
    assert code == 1
    reasons = {event["name"]: event["message"] for event in named(told, "job-failed")}
    assert "gone.png does not exist" in reasons["gone.mp4"]
    assert "frame 1" in reasons["damaged.mp4"]
    assert "exists already" in reasons["taken.mp4"]
    assert [event["name"] for event in named(told, "job-done")] == ["good.mp4"]
    assert (studio.folder / "out/taken.mp4").read_text() == "mine"

    page = (studio.folder / "out/shoot.report/index.html").read_text()
    facts = json.loads((studio.folder / "out/shoot.report/report.json").read_text())
    assert facts["counts"] == {"done": 1, "failed": 3}
    assert "gone.png does not exist" in page
    assert (studio.folder / "out/shoot.report/pictures").glob("*-result.png")

    (damaged / "frame_1_IUV.png").write_bytes(good)
    studio.source("gone")
    code, told, _ = run(path, "--workers", 1, "--jobs", ":2")
    assert (code, len(named(told, "job-done"))) == (0, 2)


def test_held_frames_are_as_in_a_single_run_and_reported(studio) -> None:
    """In the second chunk the frame to repeat is read from the first."""
    frames = studio.walk(CHUNK_FRAMES + 4)
    frames[[0, 9, *range(CHUNK_FRAMES - 1, CHUNK_FRAMES + 2)]] = 0
    source, driver = studio.source(), studio.array(frames)
    jobs = [
        {"source": source.name, "driver": driver.name, "missing": "hold", "output": f"{name}.mp4"}
        for name in "ab"
    ]
    path = manifest(studio, defaults={"renderer": "texture"}, jobs=jobs)
    code, told, _ = run(path, "--workers", 1)
    assert code == 0
    note = f"nobody found in 5 of {CHUNK_FRAMES + 4} frames, the frame before: 0:00.00-0:00.03"
    assert [e["name"] for e in named(told, "job-notice") if note in e["message"]] == [
        "a.mp4",
        "b.mp4",
    ]
    report = studio.folder / "out/shoot.report"
    assert note in json.loads((report / "report.json").read_text())["jobs"][1]["note"]
    assert note in (report / "index.html").read_text()
    single = studio.folder / "single.mp4"
    words = ["run", "--renderer", "texture", "--source", source, "--driver", driver]
    words += ["--missing", "hold", "-o", single]
    subprocess.run([sys.executable, "-m", "motion_transfer", *map(str, words)], check=True)
    for name in "ab":
        assert (studio.folder / f"out/{name}.mp4").read_bytes() == single.read_bytes()


def test_a_worker_that_is_killed_fails_nothing_at_first(studio, shoot: Path) -> None:
    """The system kills the only worker in mid-job: its chunks are tried again in a fresh one."""
    with subprocess.Popen(
        command("run", shoot, "--json", "--workers", 1, "--jobs", "0:1"),
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        killed: list[int] = []
        for line in process.stdout:
            if json.loads(line)["event"] == "job-planned":
                killed = workers_of(process.pid)
                for pid in killed:
                    os.kill(pid, signal.SIGKILL)
        assert process.wait(120) == 0
    assert killed
    assert (studio.folder / "out/anna_walk.mp4").exists()


def workers_of(pid: int) -> list[int]:
    """Worker processes of a batch: they are forked from another child of it."""
    return [
        worker
        for child in children_of(pid)
        if b"forkserver" in Path(f"/proc/{child}/cmdline").read_bytes()
        for worker in children_of(child)
    ]


def children_of(pid: int) -> list[int]:
    return [int(c) for c in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_ctrl_c_finishes_running_chunks(studio, shoot: Path) -> None:
    assert kill_after(shoot, 1, signal.SIGINT) == 130
    code, told, _ = run(shoot, "--workers", 2)
    assert code == 0
    assert any(event["done_count"] for event in named(told, "job-planned"))


def test_a_second_ctrl_c_stops_at_once(studio, shoot: Path) -> None:
    with start(shoot, "--workers", 2) as process:
        follow(process, "job-frames")
        os.killpg(process.pid, signal.SIGINT)
        follow(process, "batch-stopping")
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=300)
    assert process.returncode == 130
    assert errors.splitlines()[-1] == "mt: interrupted, nothing half-written was left behind"
    assert "Traceback" not in errors
    wait_until_gone(process.pid)
    root = studio.folder / "out"
    assert not list(root.rglob("*.part-*"))
    assert not (root / ".shoot.batch/scratch").exists()
    early = contents(root)
    code, told, _ = run(shoot, "--workers", 2)
    assert (code, named(told, "job-failed")) == (0, [])
    assert early.items() <= contents(root).items()
    assert len(contents(root)) == 4


def test_the_network_draws_the_same_with_any_number_of_workers(studio, shoot, checkpoint) -> None:
    network = [
        *("--set", "renderer=nhrr", "--set", f"weights={checkpoint}"),
        *("--jobs", ":2"),
    ]
    drawn = []
    for count in (1, 2, 4):
        root = f"output_root=with{count}"
        code, told, errors = run(shoot, "--workers", count, "--set", root, *network)
        assert (code, errors) == (0, "")
        assert named(told, "batch-finished")[0]["feature_maps"] == 1
        drawn.append(contents(studio.folder / f"with{count}"))
    assert list(drawn[0]) == ["anna_walk.mp4", "anna_wave.mp4"]
    assert drawn[0] == drawn[1] == drawn[2]
