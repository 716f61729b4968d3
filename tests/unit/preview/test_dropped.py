"""Files that a page sends get plain names, by what they hold, and go when nobody names them."""

from __future__ import annotations

from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.preview import dropped
from motion_transfer.preview.dropped import DroppedFiles, clean_name


@pytest.fixture
def files(tmp_path: Path) -> DroppedFiles:
    return DroppedFiles(tmp_path / "inputs")


def send(files: DroppedFiles, name: str, data: bytes, drop: str = "a") -> Path:
    with files.begin(drop, name) as upload:
        upload.write(data)
        return upload.finish()


@pytest.mark.parametrize(
    ("name", "plain"),
    [
        ("front.jpg", "front.jpg"),
        ("../../etc/passwd", "passwd"),
        ("C:\\me\\front.jpg", "front.jpg"),
        ("..", "photo"),
        ("", "photo"),
        ("-rf.png", "rf.png"),
        (".hidden.png", "hidden.png"),
        ("me [1]*?.png", "me_1_.png"),
        ("a\0b\n.png", "a_b_.png"),
        ("Zoë é.png", "Zoë_é.png"),
        ("x" * 300 + ".jpeg", "x" * 60 + ".jpeg"),
        ("x." + "y" * 300, "x.yyyyyyyy"),
    ],
)
def test_names_are_plain(name: str, plain: str) -> None:
    assert clean_name(name) == plain


def test_what_a_file_holds_decides_its_ending(studio, files: DroppedFiles) -> None:
    photo, film = studio.source().read_bytes(), studio.video(2).read_bytes()
    names = {"me": "me.png", "me.jpg": "me.jpg", "me.mtsource": "me.mtsource.png"}
    for name, kept in names.items():
        assert send(files, name, photo).name == kept
    assert send(files, "turn.mkv", film).name == "turn.mkv"
    assert send(files, "turn.png", film).name == "turn.png.mkv"


@pytest.mark.parametrize(
    "data", [b"", b"text", b"#EXTM3U\nfile:///etc/passwd", b"ffconcat version"]
)
def test_what_is_no_picture_is_refused_and_leaves_nothing(files: DroppedFiles, data: bytes) -> None:
    with pytest.raises(InputError, match=r"me\.png is no video, and is not a picture"):
        send(files, "me.png", data)
    assert not [path for path in files.folder.rglob("*") if path.is_file()]
    assert files.bytes == 0


def test_too_much_is_refused(studio, files: DroppedFiles, monkeypatch) -> None:
    photo = studio.source().read_bytes()
    monkeypatch.setattr(dropped, "MOST_BYTES", len(photo))
    send(files, "me.png", photo)
    with pytest.raises(InputError, match=r"you\.png is too large"):
        send(files, "you.png", photo)


def test_drops_do_not_meet_and_what_is_there_counts(studio, files, tmp_path) -> None:
    photo = studio.source().read_bytes()
    kept = send(files, "me.png", photo)
    again = send(files, "me.png", photo)
    others = send(files, "me.png", photo, "b")
    assert [p.relative_to(tmp_path / "inputs") for p in (kept, again, others)] == [
        Path("1/me.png"),
        Path("1/me-2.png"),
        Path("2/me.png"),
    ]
    later = DroppedFiles(tmp_path / "inputs")
    assert later.bytes == 3 * len(photo)
    assert send(later, "me.png", photo).parent.name == "3"


def test_motions_are_taken_where_a_motion_is_wanted(files: DroppedFiles) -> None:
    bvh = b"HIERARCHY\nROOT Hips\n"
    with pytest.raises(InputError, match="is no video"):
        send(files, "walk.bvh", bvh)
    for name, data in (("walk.bvh", bvh), ("walk.npy", b"\x93NUMPY")):
        with files.begin("a", name) as upload:
            upload.write(data)
            assert upload.finish(motion=True).name == name
    with files.begin("a", "run.bvh") as upload:
        upload.write(b"no motion")
        with pytest.raises(InputError, match="is no video"):
            upload.finish(motion=True)
