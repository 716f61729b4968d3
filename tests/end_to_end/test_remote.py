"""Runs and batches whose files are URLs."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from motion_transfer.render.plan import CHUNK_FRAMES

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def memory(tmp_path, monkeypatch):
    """A place in memory; what is fetched and staged lies where it can be looked at."""
    files = fsspec.filesystem("memory")
    files.store.clear()
    files.pseudo_dirs[:] = [""]
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path / "cache"))
    yield files
    files.store.clear()


def put(files, folder: str, *paths: Path) -> None:
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.is_file():
                files.pipe(f"/{folder}/{file.relative_to(path.parent)}", file.read_bytes())


def left(tmp_path: Path) -> list[Path]:
    folders = (tmp_path / "temporary", tmp_path / "cache/outputs")
    return [item for folder in folders if folder.exists() for item in folder.rglob("*")]


def test_a_run_from_url_to_url_is_a_run_from_file_to_file(studio, mt, memory, tmp_path) -> None:
    source, driver = studio.source(), studio.driver(4)
    put(memory, "in", source, source.with_name(f"{source.stem}_IUV.png"), driver)
    output = studio.folder / "out.mp4"
    words = ("--renderer", "texture", "--workers", "1")
    assert mt("run", "--source", source, "--driver", driver, *words, "-o", output).code == 0
    urls = ("--source", f"memory://in/{source.name}", "--driver", f"memory://in/{driver.name}")
    told = mt("run", *urls, *words, "-o", "memory://out/a/b.mp4")
    assert told.code == 0, told.err
    assert told.out.startswith("wrote memory://out/a/b.mp4: 4 frames")
    assert memory.find("/out") == ["/out/a/b.mp4"]
    assert memory.cat("/out/a/b.mp4") == output.read_bytes()
    assert left(tmp_path) == []
    again = mt("run", *urls, *words, "-o", "memory://out/a/b.mp4", "--json")
    assert again.code == 2
    assert json.loads(again.out)["message"].startswith("memory://out/a/b.mp4 exists already")
    frames = mt("run", *urls, *words, "-o", "memory://out/frames")
    assert frames.code == 0, frames.err
    assert len(memory.find("/out/frames")) == 4
    gone = mt("run", *urls[:2], "--driver", "memory://in/gone", *words, "-o", "memory://x.mp4")
    assert gone.code == 2
    assert gone.err.splitlines()[-1] == "mt: memory://in/gone does not exist"
    assert left(tmp_path) == []


def test_other_commands_say_that_they_do_not_fetch(mt) -> None:
    refused = mt("inspect", "https://host/a.png")
    assert refused.code == 2
    assert "'https://host/a.png' is a URL; only `mt run` and `mt batch run` fetch" in refused.err
    refused = mt("source", "save", "me.mtsource", "--source", "https://host/a.png")
    assert refused.err.count("\n") == 1
    assert "is a URL; only `mt run` and `mt batch run` fetch those" in refused.err


def test_an_output_that_cannot_be_sent_is_kept(studio, mt, memory, monkeypatch) -> None:
    def refuse(*_arguments, **_settings):
        raise PermissionError("403")

    monkeypatch.setattr(type(memory), "put_file", refuse)
    draft = ("--source", studio.source(), "--driver", studio.driver(2), "--renderer", "texture")
    told = mt("run", *draft, "-o", "memory://out.mp4")
    assert told.code == 2
    assert told.out == ""
    line = told.err.splitlines()[-1]
    kept = Path(line.partition("kept as ")[2])
    assert kept.stat().st_size > 0
    monkeypatch.undo()
    monkeypatch.setenv("MT_CACHE_DIR", str(kept.parents[2]))
    assert mt("run", *draft, "-o", "memory://out.mp4").code == 0
    assert not kept.exists()


def test_a_run_that_was_stopped_goes_on(studio, tmp_path) -> None:
    driver = studio.array(3 * CHUNK_FRAMES, name="long.npy")
    output = tmp_path / "there" / "out.mp4"
    command = [sys.executable, "-m", "motion_transfer", "run", "--renderer", "texture", "--json"]
    command += ["--source", studio.source().as_uri(), "--driver", driver.as_uri()]
    command += ["--workers", "1", "-o", output.as_uri()]
    (tmp_path / "temporary").mkdir()
    places = {"TMPDIR": str(tmp_path / "temporary"), "MT_CACHE_DIR": str(tmp_path / "cache")}
    environment = {**os.environ, **places}
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    drawn, rendering = 0, False
    for line in process.stdout:
        event = json.loads(line)
        rendering |= event["event"] == "stage" and event["name"] == "render"
        if rendering and event["event"] == "frames-done":
            drawn += event["frame_count"]
            if drawn >= CHUNK_FRAMES + 20:  # the first chunk is kept
                process.send_signal(signal.SIGINT)
                break
    process.stdout.read()
    process.stdout.close()
    assert process.wait() == 130
    assert list((tmp_path / "temporary").glob("mt-remote-*")) == []
    again = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert again.returncode == 0, again.stderr
    assert "frames were finished before; going on there" in again.stdout
    assert output.stat().st_size > 0
    assert list((tmp_path / "cache/outputs").iterdir()) == []


def batch(mt, memory, tmp_path, **content: object) -> tuple[int, list[dict], str]:
    path = tmp_path / "shoot.json"
    head = {"version": 1, "output_root": "memory://out/shoot", "defaults": {"renderer": "texture"}}
    path.write_text(json.dumps({**head, **content}))
    result = mt("batch", "run", path, "--workers", 1, "--json")
    return result.code, [json.loads(line) for line in result.out.splitlines()], result.err


def test_a_batch_from_urls_to_urls(studio, mt, memory, tmp_path, monkeypatch) -> None:
    source, driver = studio.source(), studio.driver(3)
    put(memory, "in", source, source.with_name(f"{source.stem}_IUV.png"), driver)
    url = f"memory://in/{driver.name}"
    jobs = [
        {"source": "memory://in/*.png", "driver": url, "output": "{source}.mp4"},
        {"source": f"memory://in/{source.name}", "driver": "memory://in/gone", "output": "no.mp4"},
    ]
    code, told, err = batch(mt, memory, tmp_path, jobs=jobs)
    assert code == 1, err
    (done,) = [event for event in told if event["event"] == "job-done"]
    assert done["output"] == f"memory://out/shoot/{source.stem}.mp4"
    (failed,) = [event for event in told if event["event"] == "job-failed"]
    assert failed["message"] == "memory://in/gone does not exist"
    local = tmp_path / "shoot.outputs" / f"{source.stem}.mp4"
    assert memory.cat(f"/out/shoot/{source.stem}.mp4") == local.read_bytes()
    assert b"shoot.json" in memory.cat("/out/shoot/shoot.report/index.html")
    assert not (tmp_path / "shoot.outputs/.shoot.batch/remote").exists()

    # what is done is known, though its inputs were fetched anew; what is not there is sent again
    memory.rm(f"/out/shoot/{source.stem}.mp4")
    code, told, err = batch(mt, memory, tmp_path, jobs=jobs[:1])
    assert (code, told[-1]["current_count"]) == (0, 1), err
    assert memory.cat(f"/out/shoot/{source.stem}.mp4") == local.read_bytes()


def test_what_a_batch_cannot_send_is_told_and_sent_later(
    studio, mt, memory, tmp_path, monkeypatch
) -> None:
    def refuse(*_arguments, **_settings):
        raise ConnectionError("the line is dead")

    job = {"source": str(studio.source()), "driver": str(studio.driver(3)), "output": "a.mp4"}
    with monkeypatch.context() as broken:
        broken.setattr(type(memory), "put_file", refuse)
        code, told, err = batch(mt, memory, tmp_path, jobs=[job])
    assert code == 1
    assert [event["event"] for event in told if event["event"].startswith("job-d")] == []
    assert "the line is dead; the next run sends it" in json.dumps(told)
    assert memory.find("/out") == []
    code, told, err = batch(mt, memory, tmp_path, jobs=[job])
    assert code == 0, err
    assert "/out/shoot/a.mp4" in memory.find("/out")


def test_a_manifest_names_urls_only_where_it_can(studio, mt, memory, tmp_path) -> None:
    job = {"source": str(studio.source()), "driver": str(studio.driver(3))}
    code, _, err = batch(mt, memory, tmp_path, jobs=[{**job, "output": "memory://a.mp4"}])
    assert code == 2
    assert "is a URL; write where it begins as output_root" in err
    code, _, err = batch(
        mt, memory, tmp_path, jobs=[{**job, "driver": "memory://x/*", "output": "a.mp4"}]
    )
    assert code == 2
    assert "matches nothing" in err


def test_a_manifest_from_standard_input(studio, tmp_path) -> None:
    studio.source("me"), studio.array(3, name="walk.npy")
    text = "version: 1\noutput_root: out\njobs:\n- {source: me.png, driver: walk.npy, output: a.mp4"
    command = [sys.executable, "-m", "motion_transfer", "batch", "run", "-", "--workers", "1"]
    command += ["--set", "renderer=texture"]

    def call(words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command, input=words, cwd=studio.folder, capture_output=True, text=True, check=False
        )

    result = call(f"{text}}}")
    assert result.returncode == 0, result.stderr
    assert (studio.folder / "out/a.mp4").exists()
    assert (studio.folder / "out/stdin.report/index.html").exists()
    assert "1 up to date" in call(f"{text}}}").stdout
    wrong = call(f"{text}, fbs: 3}}")
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("mt: standard input:4: jobs[0].fbs: unknown field; did you mean")
    assert call("").stderr == "mt: manifest: nothing came on standard input\n"
