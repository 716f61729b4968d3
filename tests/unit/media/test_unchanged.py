"""What counts as a change of a file, whatever its times say."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.media import unchanged
from motion_transfer.media.iuv.formats import IUV_FORMATS
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES
from motion_transfer.media.unchanged import FRAME_SUFFIXES, Inputs, content_key, status_key

HOUR_NS = 3600 * 10**9


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.png"
    path.write_text("one")
    return path


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    folder = tmp_path / "frames"
    folder.mkdir()
    for number in range(3):
        (folder / f"{number}.png").write_text(f"frame {number}")
    return folder


def settle() -> None:
    """Wait until a file's times would tell that it was written again."""
    time.sleep(2 * unchanged.TICK_NS / 1e9)


def rewrite(file: Path) -> None:
    file.write_text("two")


def rewrite_with_old_times(file: Path) -> None:
    status = file.stat()
    file.write_text("two")
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))


def rename_over(file: Path) -> None:
    other = file.with_name("other")
    other.write_text("two")
    other.replace(file)


def truncate(file: Path) -> None:
    os.truncate(file, 0)


def replace_by_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


CHANGES = (rewrite, rewrite_with_old_times, rename_over, truncate)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("settled", [True, False])
def test_other_content_is_noticed(
    file: Path, change: Callable[[Path], None], settled: bool
) -> None:
    """Also where a file is written again before the clock of its times has ticked."""
    if settled:
        settle()
    inputs = Inputs([file])
    inputs.check()
    change(file)
    for _ in range(2):  # and not forgotten
        with pytest.raises(InputError, match=r"a.png has changed since the run began"):
            inputs.check()


@pytest.mark.parametrize("remove", [Path.unlink, replace_by_folder])
def test_a_file_that_goes_is_noticed(file: Path, remove: Callable[[Path], None]) -> None:
    inputs = Inputs([file])
    remove(file)
    with pytest.raises(InputError, match=r"a.png has been removed since"):
        inputs.check()


def test_a_file_that_comes_is_noticed(tmp_path: Path) -> None:
    """Such as IUV beside a photo whose IUV is being estimated."""
    inputs = Inputs([tmp_path / "me_IUV.png"])
    inputs.check()
    rewrite(tmp_path / "me_IUV.png")
    with pytest.raises(InputError, match=r"me_IUV.png has been added since"):
        inputs.check()


def copy_over_itself(file: Path) -> None:
    other = file.with_name("other")
    other.write_bytes(file.read_bytes())
    other.replace(file)


def touch_future(file: Path) -> None:
    later = time.time_ns() + 1000 * HOUR_NS
    os.utime(file, ns=(later, later))


def touch_past(file: Path) -> None:
    os.utime(file, ns=(HOUR_NS, HOUR_NS))


@pytest.mark.parametrize("touch", [Path.touch, touch_future, touch_past, copy_over_itself])
def test_the_same_content_is_no_change(file: Path, touch: Callable[[Path], None]) -> None:
    inputs = Inputs([file])
    touch(file)
    inputs.check()
    rewrite(file)
    with pytest.raises(InputError, match="has changed"):
        inputs.check()


def test_nothing_is_read_again_that_looks_the_same(frames: Path, monkeypatch) -> None:
    settle()
    inputs, read = Inputs([frames]), []
    know = unchanged._know
    monkeypatch.setattr(unchanged, "_know", lambda file: read.append(Path(file).name) or know(file))
    inputs.check()
    assert read == []
    (frames / "1.png").touch()
    inputs.check()
    assert read == ["1.png"]
    settle()
    inputs.check()
    inputs.check()  # it was noted so soon after its last change that it was not believed once more
    assert read == ["1.png"] * 2


@pytest.mark.parametrize("hours", [-2, 2])
def test_a_clock_that_jumps_decides_nothing(file: Path, monkeypatch, hours: int) -> None:
    settle()
    now = time.time_ns
    inputs = Inputs([file])
    monkeypatch.setattr(unchanged.time, "time_ns", lambda: now() + hours * HOUR_NS)
    inputs.check()
    other = Inputs([file])
    other.check()
    rewrite(file)
    for noted in (inputs, other):
        with pytest.raises(InputError, match="has changed"):
            noted.check()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda folder: (folder / "1.png").write_text("other"), "1.png has changed"),
        (lambda folder: (folder / "1.png").unlink(), "1.png has been removed"),
        (lambda folder: (folder / "3.png").write_text("new"), "3.png has been added"),
        (lambda folder: (folder / "1.png").rename(folder / "9.png"), r"[19].png has been"),
        (lambda folder: folder.rename(folder.with_name("away")), "0.png has been removed"),
    ],
)
def test_of_a_folder_the_frame_is_named(
    frames: Path, change: Callable[[Path], object], words: str
) -> None:
    inputs = Inputs([frames])
    inputs.check()
    change(frames)
    with pytest.raises(InputError, match=words):
        inputs.check()


@pytest.mark.parametrize("name", ["out.mp4", "notes.txt", ".hidden.png", "Thumbs.db"])
def test_what_is_no_frame_may_come_into_the_folder(frames: Path, name: str) -> None:
    inputs = Inputs([frames])
    (frames / name).write_text("new")
    inputs.check()


def test_every_format_of_frames_counts() -> None:
    rows = [row for row in IUV_FORMATS if row.folder_opener]
    assert {*PHOTO_SUFFIXES, *(end for row in rows for end in row.suffixes)} <= FRAME_SUFFIXES


def test_a_pipe_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    inputs = Inputs([tmp_path / "pipe.png", tmp_path])
    inputs.check()
    assert content_key(tmp_path / "pipe.png") == content_key(tmp_path / "pipe.png")


def test_what_is_read_is_guarded_to_its_end(file: Path) -> None:
    inputs = Inputs([file])
    guarded = inputs.guard(range(3))
    assert [next(guarded), next(guarded), next(guarded)] == [0, 1, 2]
    rewrite(file)
    with pytest.raises(InputError, match="has changed"):
        next(guarded)


def test_glances_take_a_small_share_of_the_time(file: Path, monkeypatch) -> None:
    clock = [100.0]
    inputs = Inputs([file])
    monkeypatch.setattr(unchanged.time, "monotonic", lambda: clock[0])
    looked = []

    def look() -> None:
        looked.append(clock[0])
        clock[0] += 1

    monkeypatch.setattr(inputs, "check", look)
    for _ in range(200):
        inputs.glance()
        clock[0] += 1
    assert looked == [100, 151, 202, 253]


def test_keys_are_those_that_files_have_now(file: Path, frames: Path, tmp_path: Path) -> None:
    settle()
    paths = [file, frames, tmp_path / "none"]
    keys = (Inputs(paths[:2]) | Inputs(paths[2:])).keys()
    assert keys == {str(path): [status_key(path), content_key(path)] for path in paths}
    rewrite(file)
    assert status_key(file) != keys[str(file)][0]
    assert content_key(file) != keys[str(file)][1]
