"""Scheduling, with workers that do each task at once and in this process."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
import yaml

from motion_transfer.batch import events
from motion_transfer.batch.report import write_report
from motion_transfer.batch.run import Batch, count_jobs, read_batch
from motion_transfer.batch.schedule import Scheduler, Tally
from motion_transfer.batch.signals import Signals
from motion_transfer.drawing.renderers.texture import TextureRecipe
from motion_transfer.media.work import work_path
from motion_transfer.render import chunks
from motion_transfer.render.plan import CHUNK_FRAMES
from motion_transfer.render.workers import Fetch, Warm

Hook = Callable[[str, int], None]


class LostError(Exception):
    """The worker died."""


class InlineWorkers:
    """Do each task as it is submitted; `before` is told its name and how many there were of it."""

    lost_error: tuple[type[BaseException], ...] = (LostError,)

    def __init__(self, before: Hook) -> None:
        self.count = 1
        self.calls: Counter[str] = Counter()
        self.stopped = False
        self._before = before

    def submit(self, place: int, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            self._before(task.__name__, self.calls[task.__name__])
            future.set_result(task(*arguments))
        except Exception as error:
            future.set_exception(error)
        self.calls[task.__name__] += 1
        return future

    def share(self, name: str, blob: bytes) -> Fetch:
        return lambda: blob

    def forget(self, name: str) -> None: ...

    def stop(self, *, now: bool) -> None:
        self.stopped = True


class Run:
    """How a batch went."""

    def __init__(self, batch: Batch, *, keep_going: bool, retries: int, before: Hook) -> None:
        self.batch = batch
        signals = Signals()
        self.told: list[events.BatchEvent] = []
        self.workers = InlineWorkers(before)
        with batch.state.held(), signals.noted():
            self.tally: Tally = Scheduler(
                *(batch.jobs, self.workers, batch.state),
                retries=retries,
                keep_going=keep_going,
                restart=False,
                listener=self.told.append,
                signals=signals,
            ).run()

    @property
    def done(self) -> list[str]:
        return [event.name for event in self.told if isinstance(event, events.JobDone)]

    @property
    def failed(self) -> dict[str, str]:
        return {e.name: e.message for e in self.told if isinstance(e, events.JobFailed)}

    @property
    def found_done(self) -> list[int]:
        """Frames that an earlier run had finished, for each job that was planned."""
        return [e.done_count for e in self.told if isinstance(e, events.JobPlanned)]


@pytest.fixture
def run(studio, monkeypatch) -> Callable[..., Run]:
    """Write a manifest of jobs (source, driver, output, and what else) and run it."""

    def call(
        *jobs: dict[str, Any],
        keep_going: bool = True,
        retries: int = 0,
        before: Hook = lambda _name, _number: None,
        **fields: Any,
    ) -> Run:
        monkeypatch.setattr(chunks, "WARM", Warm())
        path = studio.folder / "shoot.yaml"
        defaults = {"renderer": "texture", **fields.pop("defaults", {})}
        content = {"version": 1, "output_root": "out", "defaults": defaults, **fields}
        path.write_text(yaml.safe_dump({**content, "jobs": jobs}))
        batch = read_batch(path)
        return Run(batch, keep_going=keep_going, retries=retries, before=before)

    return call


def job(output: str, source: str = "anna.png", driver: str = "walk.npy", **more: Any) -> dict:
    return {"source": source, "driver": driver, "output": output, **more}


@pytest.fixture
def walk(studio) -> Path:
    """A source, and a driver of three frames."""
    studio.source("anna")
    return studio.array(3, name="walk.npy")


def test_twenty_jobs_of_a_source_compute_one_feature_map(
    studio, run, walk, checkpoint, monkeypatch
) -> None:
    from motion_transfer.drawing.engines.graph_engine import GraphEngine

    encode, encoded = GraphEngine.encode, []

    def count(*arguments: Any) -> Any:
        encoded.append(arguments)
        return encode(*arguments)

    monkeypatch.setattr(GraphEngine, "encode", count)
    studio.array(4, name="wave.npy")
    jobs = [
        job(f"{index}.png", driver=("walk.npy", "wave.npy")[index % 2], frames=str(index % 3))
        for index in range(20)
    ]
    defaults = {"renderer": "nhrr", "weights": str(checkpoint)}
    result = run(*jobs, defaults=defaults)
    assert result.failed == {}
    assert len(result.done) == 20
    assert len(encoded) == 1


def test_jobs_of_a_driver_share_its_scan(studio, run, walk) -> None:
    studio.source("ben")
    result = run(*(job(f"{name}.mp4", source=f"{name}.png") for name in ("anna", "ben")))
    assert len(result.done) == 2
    assert (result.workers.calls["scan"], result.workers.calls["encode"]) == (1, 2)


def test_higher_priorities_come_first(run, walk) -> None:
    priorities = {"a": 0, "b": 2, "c": 1, "d": 2, "e": -1}
    result = run(
        *(job(f"{name}.png", frames="0", priority=number) for name, number in priorities.items())
    )
    assert result.done == ["b.png", "d.png", "c.png", "a.png", "e.png"]


@pytest.mark.parametrize("keep_going", [True, False])
def test_after_a_failed_job(run, walk, keep_going: bool) -> None:
    result = run(
        job("bad.mp4", source="gone.png", priority=1),
        *(job(f"{n}.png", frames="0") for n in "ab"),
        keep_going=keep_going,
    )
    assert list(result.failed) == ["bad.mp4"]
    assert (result.tally.done, result.tally.left) == ((2, 0) if keep_going else (0, 2))
    assert result.workers.stopped
    again = run(*(job(f"{n}.png", frames="0") for n in "ab"), keep_going=False)
    assert again.tally.done + again.tally.current == 2


def test_lost_workers_are_replaced_as_often_as_allowed(studio, run, walk) -> None:
    """The second chunk of the first job kills its worker, each time."""
    studio.array(CHUNK_FRAMES + 2, name="walk.npy")
    times = 2

    def kill(name: str, number: int) -> None:
        if name == "render" and 0 < number <= times:
            raise LostError

    jobs = job("a.mp4"), job("b.png", frames="0")
    result = run(*jobs, retries=1, before=kill)
    assert result.failed == {
        "a.mp4": f"frames {CHUNK_FRAMES}:{CHUNK_FRAMES + 2} failed 2 times: its worker process was"
        " killed, perhaps for want of memory; try fewer --workers"
    }
    assert result.done == ["b.png"]
    times = 0
    result = run(*jobs, retries=1, before=kill)
    assert (result.done, result.found_done, result.tally.current) == (
        ["a.mp4"],
        [CHUNK_FRAMES],
        1,
    )
    times = 1
    assert run(job("c.mp4"), retries=1, before=kill).done == ["c.mp4"]


@pytest.mark.parametrize("change", ["gone", "other"])
def test_a_source_that_vanishes_or_changes_under_the_batch(studio, run, walk, change) -> None:
    """It happens between the feature map and the plan, whose keys hold the photo's content."""
    photo = studio.source("ben")
    content = photo.read_bytes()

    def meddle(name: str, number: int) -> None:
        if name == "prepare" and number == 0:
            if change == "gone":
                photo.unlink()
            else:
                studio.source("ben", colours={(2,): (9, 9, 9)})

    jobs = job("ben.mp4", source="ben.png", priority=1), job("anna.mp4")
    result = run(*jobs, before=meddle)
    words = {"gone": f"{photo} does not exist", "other": f"{photo} has changed since the run"}
    assert words[change] in result.failed["ben.mp4"]
    assert result.done == ["anna.mp4"]
    photo.write_bytes(content)
    result = run(*jobs)
    assert (result.done, result.tally.current) == (["ben.mp4"], 1)


@pytest.mark.parametrize(
    ("moment", "name"),
    [("render", "wave.npy"), ("assemble", "ben.png"), ("assemble", "wave.npy")],
)
def test_no_output_stands_whose_inputs_changed(
    studio, run, walk, monkeypatch, moment: str, name: str
) -> None:
    """Also when all of them have been read and drawn."""
    monkeypatch.setattr(TextureRecipe, "texture_size", 32)  # to unfold photos takes longest
    studio.source("ben")
    studio.array(2, name="wave.npy")
    file = studio.folder / name

    def meddle(task: str, number: int) -> None:
        if task == moment and number == 0:
            if name == "wave.npy":
                studio.array(studio.walk(4)[2:], name=name)
            else:
                studio.source("ben", colours={(2,): (9, 9, 9)}, parts=(2, 9, 10, 13, 14, 23, 24))

    output = studio.folder / "out/ben.mp4"
    jobs = job("ben.mp4", "ben.png", "wave.npy", priority=1), job("anna.mp4")
    result = run(*jobs, before=meddle)
    assert f"{file} has changed since the run began" in result.failed["ben.mp4"]
    assert result.done == ["anna.mp4"]
    assert not output.exists()
    assert run(*jobs).done == ["ben.mp4"]
    assert run(job("fresh.mp4", "ben.png", "wave.npy")).done == ["fresh.mp4"]
    assert output.read_bytes() == output.with_name("fresh.mp4").read_bytes()


def test_a_driver_frame_that_breaks_under_the_batch(studio, run, walk) -> None:
    """The driver was whole when it was planned; its last frame breaks after the first chunk."""
    driver = studio.driver(CHUNK_FRAMES + 2, name="steps")
    last = driver / f"frame_{CHUNK_FRAMES + 1}_IUV.png"
    content = last.read_bytes()

    def meddle(name: str, number: int) -> None:
        if name == "render" and number == 1:
            last.write_bytes(content[:70])

    jobs = job("steps.mp4", driver="steps", priority=1), job("walk.mp4")
    result = run(*jobs, before=meddle, retries=3)
    assert list(result.failed) == ["steps.mp4"]
    assert last.name in result.failed["steps.mp4"]
    assert result.done == ["walk.mp4"]
    last.write_bytes(content)
    result = run(*jobs)
    assert (result.done, result.found_done, result.tally.current) == (
        ["steps.mp4"],
        [CHUNK_FRAMES],
        1,
    )


def test_what_was_being_written_is_removed_when_all_is_stopped(studio, run, walk) -> None:
    studio.array(CHUNK_FRAMES + 2, name="walk.npy")
    work = work_path(studio.folder / "out/a.mp4")

    def stop(name: str, number: int) -> None:
        if name == "render" and number == 1:
            (work / "000001.part-0.nut").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(job("a.mp4"), before=stop)
    left = {item.name for item in work.iterdir()}
    assert left == {"000000.nut", "journal.jsonl", "lock", "owner.json"}
    assert run(job("a.mp4")).found_done == [CHUNK_FRAMES]


def test_signals_wait_until_a_task_is_handed_over(studio, run, walk) -> None:
    """In the midst of that a lock may be held, which an exception would leave so."""
    studio.array(CHUNK_FRAMES + 2, name="walk.npy")
    handed_over = []

    def press_twice(name: str, number: int) -> None:
        if name == "render":
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            handed_over.append(number)

    with pytest.raises(KeyboardInterrupt):
        run(job("a.mp4"), before=press_twice)
    assert handed_over == [0]
    assert run(job("a.mp4")).found_done == [CHUNK_FRAMES]


def test_one_ctrl_c_finishes_what_runs(studio, run, walk) -> None:
    studio.array(CHUNK_FRAMES + 2, name="walk.npy")

    def press(name: str, number: int) -> None:
        if name == "render" and number == 0:
            signal.raise_signal(signal.SIGINT)

    result = run(job("a.mp4"), before=press)
    assert (result.tally.done, result.tally.left) == (0, 1)
    assert [event for event in result.told if isinstance(event, events.BatchStopping)]
    assert run(job("a.mp4")).found_done == [CHUNK_FRAMES]


def enlarge(disk: Path) -> None:
    subprocess.run(["mount", "-o", "remount,size=4m", str(disk)], check=True)


def test_a_disk_that_fills_fails_the_jobs_on_it(run, walk, tiny_disk: Path) -> None:
    jobs = job(f"{tiny_disk}/full.mp4", priority=1), job("roomy.mp4")
    result = run(*jobs, outside_outputs=True)
    assert result.done == ["roomy.mp4"]
    assert "the disk is full" in result.failed[f"{tiny_disk}/full.mp4"]
    assert not (tiny_disk / "full.mp4").exists()
    enlarge(tiny_disk)
    result = run(*jobs, outside_outputs=True)
    assert (result.done, result.tally.current) == ([f"{tiny_disk}/full.mp4"], 1)


def test_a_disk_that_fills_with_all_that_is_noted(run, walk, tiny_disk: Path) -> None:
    """Nothing can be noted of any job, and still each says why it failed, and the run ends."""
    jobs = job("a.mp4"), job("b.mp4")
    result = run(*jobs, output_root=str(tiny_disk))
    assert list(result.failed) == ["a.mp4", "b.mp4"]
    assert all("the disk is full" in words for words in result.failed.values())
    enlarge(tiny_disk)
    assert run(*jobs, output_root=str(tiny_disk)).done == ["a.mp4", "b.mp4"]


def test_the_report_knows_jobs_by_their_outputs(studio, run, walk) -> None:
    studio.source("ben", colours={(2,): (9, 9, 9)})
    anna, ben = (job(f"{n}.png", source=f"{n}.png", frames="0") for n in ("anna", "ben"))
    gone = job("gone.png", source="gone.png")
    first = facts_of(run(anna, ben, gone))
    assert first["counts"] == {"done": 2, "failed": 1}
    later = facts_of(run(gone, ben, anna))
    pictures = [{j["name"]: j["source_picture"] for j in f["jobs"]} for f in (first, later)]
    assert pictures[0] == pictures[1]
    assert pictures[0].pop("gone.png") is None
    folder = studio.folder / "out/shoot.report"
    assert len({(folder / name).read_bytes() for name in pictures[0].values()}) == 2
    assert all(
        f'src="{name}"' in (folder / "index.html").read_text() for name in pictures[0].values()
    )


def test_seconds_of_a_job_leave_out_its_waiting(run, walk) -> None:
    """The jobs begin together and wait for each other: what they worked adds up to what passed."""

    def take_time(name: str, _number: int) -> None:
        time.sleep(0.1 if name == "render" else 0)

    began = time.monotonic()
    jobs = [job(f"{name}.png", frames="0") for name in "abc"]
    facts = facts_of(run(*jobs, before=take_time))
    passed = time.monotonic() - began
    seconds = [entry["seconds"] for entry in facts["jobs"]]
    assert min(seconds) >= 0.1
    assert sum(seconds) <= passed


def facts_of(result: Run) -> dict[str, Any]:
    write_report(result.batch.jobs, result.batch.state)
    return json.loads((result.batch.state.report / "report.json").read_text())


def test_status_and_clean(studio, run, walk, mt) -> None:
    jobs = job("a.png", frames="0"), job("b.png", frames="0"), job("bad.mp4", source="gone.png")
    result = run(*jobs, job("half.mp4"), before=break_assembly)
    manifest, root = studio.folder / "shoot.yaml", studio.folder / "out"
    assert work_path(root / "half.mp4").exists()
    assert count_jobs(result.batch) == {"done": 2, "failed": 2, "to do": 0}
    (root / "b.png").unlink()
    told = mt("batch", "status", manifest).out.splitlines()
    assert told[0] == "1 done, 2 failed, 1 to do"
    assert told[1].startswith("failed: bad.mp4: ")
    assert json.loads(mt("batch", "status", manifest, "--json").out)["to_do"] == 1

    with result.batch.state.held():
        refused = mt("batch", "clean", manifest)
    assert refused.code == 2
    assert "is at work on it" in refused.err
    assert mt("batch", "clean", manifest).out == "removed 2 work folders\n"
    assert {item.name for item in root.iterdir()} == {"a.png", "shoot.report"}
    assert mt("batch", "clean", manifest).out == "removed 0 work folders\n"


def break_assembly(name: str, number: int) -> None:
    if name == "assemble" and number == 2:
        raise RuntimeError("broken")
