"""Final names hold something whole or nothing."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from motion_transfer.errors import OutputError
from motion_transfer.media.publish import (
    check_destination,
    explain_disk_errors,
    name_beside,
    publish,
    work_folder,
)


def put(path: Path, content: str) -> Path:
    """Write a file (a name with an ending) or a folder of one frame."""
    if path.suffix:
        path.write_text(content)
    else:
        path.mkdir()
        (path / "000000.png").write_text(content)
    return path


def contents(path: Path) -> str:
    return ((path / "000000.png") if path.is_dir() else path).read_text()


@pytest.mark.parametrize("name", ["out.mp4", "out", "new/deep/out.mp4", "new/deep/out"])
def test_a_finished_work_gets_its_name(tmp_path: Path, name: str) -> None:
    final = tmp_path / name
    with work_folder(final) as folder:
        assert folder.name.startswith(".")
        publish(put(folder / f"finished{final.suffix}", "new"), final)
    assert contents(final) == "new"
    assert [item.name for item in final.parent.iterdir()] == [final.name]


@pytest.mark.parametrize("old", ["file", "folder"])
@pytest.mark.parametrize("new", ["finished.mp4", "finished"])
def test_an_older_output_is_replaced(tmp_path: Path, old: str, new: str) -> None:
    final = tmp_path / "out"
    if old == "file":
        final.write_text("old")
    else:
        put(final, "old")
        (final / "000001.png").write_text("old")
    with work_folder(final) as folder:
        publish(put(folder / new, "new"), final)
    assert contents(final) == "new"
    assert [item.name for item in tmp_path.iterdir()] == ["out"]
    assert final.is_file() or [item.name for item in final.iterdir()] == ["000000.png"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_failure_leaves_nothing_behind(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), work_folder(tmp_path / "new/deep/out.mp4") as folder:
        put(folder / "half.mp4", "half")
        raise error
    assert list(tmp_path.iterdir()) == []


def test_failure_leaves_folders_that_others_use(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), work_folder(tmp_path / "new/deep/out.mp4"):
        put(tmp_path / "new/theirs.txt", "theirs")
        raise RuntimeError
    assert [item.name for item in (tmp_path / "new").iterdir()] == ["theirs.txt"]


def test_an_existing_output_needs_force(tmp_path: Path) -> None:
    final = put(tmp_path / "out.mp4", "old")
    with pytest.raises(OutputError, match=r"exists already.*--force"):
        check_destination(final, force=False)
    check_destination(final, force=True)


def test_a_folder_of_other_things_is_never_replaced(tmp_path: Path) -> None:
    put(tmp_path / "out", "frame")
    check_destination(tmp_path / "out", force=True)
    put(tmp_path / "out/thesis.txt", "years of work")
    with pytest.raises(OutputError, match="other things than frames"):
        check_destination(tmp_path / "out", force=True)


@pytest.mark.parametrize("name", [".", "..", "../frames", "/"])
def test_where_we_are_is_never_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(put(tmp_path / "frames", "frame"))
    with pytest.raises(OutputError, match=r"is where you are, or holds it; choose another name"):
        check_destination(Path(name), force=True)


def test_hidden_names_have_the_name_of_a_folder_that_is_given_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "in").mkdir()
    monkeypatch.chdir(tmp_path / "in")
    assert name_beside(Path(".."), ".work") == name_beside(tmp_path, ".work")
    assert name_beside(Path(), ".work") == name_beside(tmp_path / "in", ".work")
    assert name_beside(Path("/"), ".work").parent == Path("/")


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    put(tmp_path / "notes.txt", "")
    with pytest.raises(OutputError, match=r"notes\.txt is not a folder"):
        check_destination(tmp_path / "notes.txt/deep/out.mp4", force=False)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    with pytest.raises(OutputError, match=r"locked takes no new files \(Permission denied\)"):
        check_destination(folder / "out.mp4", force=False)


@pytest.mark.parametrize(
    ("number", "reason"),
    [
        (errno.ENOSPC, "disk is full"),
        (errno.EROFS, "read-only"),
        (errno.ENOENT, "a folder was removed"),
    ],
)
def test_disk_errors_are_explained(number: int, reason: str) -> None:
    refused = pytest.raises(OutputError, match=f"out.mp4: .*{reason}")
    with refused, explain_disk_errors(Path("out.mp4")):
        raise OSError(number, os.strerror(number))


def test_other_errors_pass() -> None:
    with pytest.raises(ZeroDivisionError), explain_disk_errors(Path("out.mp4")):
        raise ZeroDivisionError


@pytest.mark.parametrize("length", [10, 230, 245, 251, 255])
@pytest.mark.parametrize("letter", ["n", "é", "人"])
def test_a_name_as_long_as_can_be_is_published(tmp_path: Path, letter: str, length: int) -> None:
    stem = letter * ((length - 4) // len(letter.encode()))
    final = tmp_path / f"{stem}.mp4"
    final.write_text("old")
    with work_folder(final) as folder:
        assert folder.name.startswith(f".{letter}")
        publish(put(folder / "finished.mp4", "new"), final)
    assert contents(final) == "new"
    final.unlink()
    put(tmp_path / stem, "old folder")
    with work_folder(tmp_path / stem) as folder:
        publish(put(folder / "finished", "new folder"), tmp_path / stem)
    assert contents(tmp_path / stem) == "new folder"


def test_hidden_names_tell_long_outputs_apart(tmp_path: Path) -> None:
    long = "n" * 250
    names = {name_beside(tmp_path / f"{long}{end}", ".work").name for end in ("1", "2", "1.mp4")}
    assert len(names) == 3
    assert all(len(name.encode()) <= 255 for name in names)
    assert name_beside(tmp_path / f"{long}1", ".work") == name_beside(
        tmp_path / f"{long}1", ".work"
    )
    assert name_beside(tmp_path / "out.mp4", ".work").name == ".out.mp4.work"


def test_a_name_longer_than_that_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="the name is too long; choose a shorter one"):
        check_destination(tmp_path / ("n" * 256), force=False)


def test_a_device_is_never_replaced() -> None:
    with pytest.raises(OutputError, match="/dev/null is a device or a pipe"):
        check_destination(Path("/dev/null"), force=True)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs Linux' /proc")
def test_a_place_that_takes_no_files_is_refused() -> None:
    with pytest.raises(OutputError, match=r"cannot write /proc/out.mp4: /proc takes no new files"):
        check_destination(Path("/proc/out.mp4"), force=False)
