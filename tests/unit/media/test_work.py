"""Work folders: what is finished stays, is believed only if it is whole, and has one owner."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from motion_transfer.errors import OutputError
from motion_transfer.media import work as work_module
from motion_transfer.media.work import Journal, WorkFolder, digest_of, was_published, work_path


def finish(work: WorkFolder, piece: str, content: str, key: str) -> None:
    path = work.temporary(piece)
    path.write_text(content)
    work.finish(piece, path, key)


def test_what_was_finished_is_found_again(tmp_path: Path) -> None:
    final = tmp_path / "new" / "out.mp4"
    with WorkFolder(final) as work:
        finish(work, "0.nut", "zero", "a")
        assert work.has("0.nut", "a")
    with WorkFolder(final) as work:
        assert work.has("0.nut", "a")
        assert not work.has("0.nut", "b")
        assert not work.has("1.nut", "a")


def test_nothing_stays_of_nothing(tmp_path: Path) -> None:
    with WorkFolder(tmp_path / "new" / "deep" / "out.mp4") as work:
        work.temporary("0.nut").write_text("half")
    assert list(tmp_path.iterdir()) == []


def test_restart_forgets(tmp_path: Path) -> None:
    final = tmp_path / "out.mp4"
    with WorkFolder(final) as work:
        finish(work, "0.nut", "zero", "a")
    with WorkFolder(final, restart=True) as work:
        assert not work.has("0.nut", "a")
        assert not (work.path / "0.nut").exists()


@pytest.mark.parametrize("damage", ["changed", "gone", "folder"])
def test_a_damaged_piece_is_not_believed(tmp_path: Path, damage: str) -> None:
    final = tmp_path / "out.mp4"
    with WorkFolder(final) as work:
        finish(work, "0.nut", "zero", "a")
        piece = work.path / "0.nut"
        if damage == "changed":
            piece.write_text("zerO")
        else:
            piece.unlink()
        if damage == "folder":
            piece.mkdir()
        assert not work.has("0.nut", "a")


def test_half_written_pieces_are_swept(tmp_path: Path) -> None:
    final = tmp_path / "out"
    with WorkFolder(final) as work:
        finish(work, "000000", "zero", "a")
        work.temporary("000001").mkdir()
        work.temporary("2.nut").write_text("half")
    with WorkFolder(final) as work:
        assert sorted(item.name for item in work.path.iterdir()) == [
            *("000000", "journal.jsonl", "lock", "owner.json"),
        ]


def test_a_torn_journal_keeps_its_whole_lines(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path)
    for number in range(3):
        journal.append({"number": number})
    whole = path.read_bytes()
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        entries = journal.repair()
        assert entries == [{"number": number} for number in range(whole[:cut].count(b"\n"))]
        journal.append({"number": "next"})
        assert journal.read() == [*entries, {"number": "next"}]


def test_a_second_owner_is_refused(tmp_path: Path) -> None:
    final = tmp_path / "out.mp4"
    with (
        WorkFolder(final),
        pytest.raises(OutputError, match=f"process {os.getpid()} on .* is at work on it"),
        WorkFolder(final),
    ):
        pass
    with WorkFolder(final):
        pass


def test_the_lock_of_a_killed_process_is_free(tmp_path: Path) -> None:
    final = tmp_path / "out.mp4"
    code = (
        "import os, signal, sys; from pathlib import Path;"
        "from motion_transfer.media.work import WorkFolder;"
        "WorkFolder(Path(sys.argv[1])).__enter__(); os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code, str(final)], check=False)
    owner = json.loads((work_path(final) / "owner.json").read_text())
    assert owner["process"] != os.getpid()
    with WorkFolder(final) as work:
        assert work.path.exists()


@pytest.mark.parametrize("name", ["out.mp4", "out"])
def test_a_publication_is_recognised(tmp_path: Path, name: str) -> None:
    final = tmp_path / name
    with WorkFolder(final) as work:
        finished = work.path / f"finished{final.suffix}"
        if final.suffix:
            finished.write_text("whole")
        else:
            finished.mkdir()
            (finished / "0.png").write_text("whole")
        assert not was_published(final)
        finish(work, "0.nut", "zero", "a")
        work.publish(finished, "key")
    assert was_published(final)
    with WorkFolder(final) as work:
        assert work.published("key")
        assert not work.published("other")
    if final.suffix:
        final.write_text("changed since")
        assert not was_published(final)


def test_a_folder_has_one_digest_and_names_count(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "0.png").write_text("same")
    assert digest_of(tmp_path / "a") == digest_of(tmp_path / "b")
    (tmp_path / "b" / "0.png").rename(tmp_path / "b" / "1.png")
    assert digest_of(tmp_path / "a") != digest_of(tmp_path / "b")


def test_a_line_for_which_there_is_no_room_is_not_begun(tmp_path: Path, monkeypatch) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    journal.append({"number": 0})

    def full(_descriptor: int) -> None:  # the line is written, and cannot be kept
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left"):
            journal.append({"number": 1})
    journal.append({"number": 2})
    assert journal.read() == [{"number": 0}, {"number": 2}]


def test_a_clearing_that_is_stopped_is_ended_by_the_next_run(tmp_path: Path, monkeypatch) -> None:
    final = tmp_path / "out.mp4"

    def stop(_path: Path, **_: object) -> None:
        raise KeyboardInterrupt

    with WorkFolder(final) as work:
        finish(work, "0.nut", "zero", "a")
        finished = work.path / "finished.mp4"
        finished.write_text("whole")
        work.publish(finished, "key")
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(work_module.shutil, "rmtree", stop)
            work.clear()
        assert sorted(item.name for item in work.path.iterdir()) == ["journal.jsonl", "lock"]
        assert was_published(final)
