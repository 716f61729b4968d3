"""URLs: fetched once and whole, sent whole or not at all, and told of in one line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from motion_transfer.errors import FetchError, InputError, OutputError
from motion_transfer.media import remote
from motion_transfer.option import is_url

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def memory() -> Iterator[Any]:
    files = fsspec.filesystem("memory")
    files.store.clear()
    files.pseudo_dirs[:] = [""]
    yield files
    files.store.clear()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("s3://bucket/a.png", True),
        ("memory://a", True),
        ("zip://a.png::s3://bucket/b.zip", True),
        ("people:walk,frames=9", False),
        (r"C:\photos\a.png", False),
        ("photos//a.png", False),
        (Path("a.png"), False),
    ],
)
def test_what_is_a_url(text: object, expected: bool) -> None:
    assert is_url(text) is expected


def test_messages_hold_no_secrets() -> None:
    shown = remote.shown_url("https://me:secret@host/a.png?signature=secret#x")
    assert shown == "https://host/a.png"


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("s3://bucket/in/me.png", "s3://bucket/in/me_IUV.png"),
        ("s3://bucket/in/turn/", "s3://bucket/in/me_IUV.png"),
        ("memory://me.png", "memory://me_IUV.png"),
        ("s3://bucket/a%20b.png", "s3://bucket/me_IUV.png"),
    ],
)
def test_what_lies_beside_a_url(url: str, expected: str) -> None:
    assert remote.url_beside(url, "me_IUV.png") == expected


def test_a_pattern_finds_urls_as_they_would_be_written(memory) -> None:
    memory.pipe({"/in/b.png": b"", "/in/a.png": b"", "/in/c.jpg": b""})
    assert remote.find_urls("memory://in/*.png") == ["memory://in/a.png", "memory://in/b.png"]


def test_a_pattern_keeps_its_host_and_user(memory) -> None:
    class Host(fsspec.get_filesystem_class("memory")):
        """As those of SFTP and FTP: a path, by which the host is not told."""

        protocol = "host"

        @classmethod
        def _strip_protocol(cls, path: str) -> str:
            return super()._strip_protocol(path.removeprefix("host://me@there:22"))

    fsspec.register_implementation("host", Host, clobber=True)
    memory.pipe({"/in/a.png": b"photo", "/in/b.png": b""})
    found = remote.find_urls("host://me@there:22/in/*.png")
    assert found == ["host://me@there:22/in/a.png", "host://me@there:22/in/b.png"]


def test_each_url_is_fetched_once_and_goes_at_the_end(memory, monkeypatch) -> None:
    memory.pipe({"/in/me.png": b"photo", "/in/me_IUV.png": b"iuv", "/in/other.png": b"no"})
    fetched = []
    real = remote.fetch
    monkeypatch.setattr(remote, "fetch", lambda *a: (fetched.append(a[0]), real(*a)))
    with pytest.raises(KeyboardInterrupt), remote.Fetched() as files:
        path = files.bring("memory://in/me.png", "source", ("me_IUV.png", "me_iuv.png"))
        assert path.name == "me.png"
        assert path.read_bytes() == b"photo"
        assert {item.name for item in path.parent.iterdir()} == {"me.png", "me_IUV.png"}
        assert files.bring("memory://in/me.png", "source") == path
        raise KeyboardInterrupt
    assert fetched == ["memory://in/me.png", "memory://in/me_IUV.png"]
    assert not path.parent.parent.exists()


def test_a_folder_is_fetched_with_its_files_only(memory, tmp_path) -> None:
    memory.pipe({"/walk/1.png": b"1", "/walk/2.png": b"2", "/walk/deeper/3.png": b"3"})
    remote.fetch("memory://walk", tmp_path / "walk", "driver")
    assert {item.name for item in (tmp_path / "walk").iterdir()} == {"1.png", "2.png"}


def test_what_is_cut_short_is_noticed(memory, tmp_path, monkeypatch) -> None:
    memory.pipe("/a.png", b"whole")
    monkeypatch.setattr(
        type(memory), "get", lambda _files, _names, paths: Path(paths[0]).write_bytes(b"who")
    )
    with pytest.raises(FetchError, match=r"source memory://a.png changed, or was cut short"):
        remote.fetch("memory://a.png", tmp_path / "a.png", "source")
    assert list(tmp_path.iterdir()) == []


def test_too_much_is_refused_before_it_is_fetched(memory, tmp_path, monkeypatch) -> None:
    memory.pipe("/a.mp4", b"x" * (3 << 20))
    monkeypatch.setattr(remote, "LARGEST_BYTES", 2 << 20)
    with pytest.raises(InputError, match=r"driver memory://a\.mp4 has 3 MiB, more than is fetched"):
        remote.fetch("memory://a.mp4", tmp_path / "a.mp4", "driver")
    assert list(tmp_path.iterdir()) == []


def test_an_output_is_sent_whole_or_not_at_all(memory, tmp_path, monkeypatch) -> None:
    video = tmp_path / "out.mp4"
    video.write_bytes(b"new")
    memory.pipe("/out/old.mp4", b"old")
    with pytest.raises(OutputError, match=r"memory://out/old\.mp4 exists already"):
        remote.check_free("memory://out/old.mp4", force=False)
    remote.check_free("memory://out/old.mp4", force=True)

    def break_off(files, source, target, **_settings) -> None:
        files.pipe_file(target, b"ne")
        raise ConnectionError("the line is dead")

    with monkeypatch.context() as broken:
        broken.setattr(type(memory), "put_file", break_off)
        with pytest.raises(FetchError, match="written: ConnectionError: the line is dead"):
            remote.send(video, "memory://out/old.mp4")
    assert memory.find("/out") == ["/out/old.mp4"]
    assert memory.cat("/out/old.mp4") == b"old"
    remote.send(video, "memory://out/old.mp4")
    assert memory.cat("/out/old.mp4") == b"new"
    assert memory.find("/out") == ["/out/old.mp4"]
    assert remote.same_size(video, "memory://out/old.mp4")
    assert not remote.same_size(video, "memory://out/gone.mp4")


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("memory://gone.png", "memory://gone.png does not exist"),
        ("nowhere://a/b.png", "nowhere://a/b.png cannot be read: Protocol not known: nowhere"),
        ("sftp://host/a.png", "sftp://host/a.png cannot be read: .*paramiko"),
        ("memory://", "names no file"),
    ],
)
def test_what_cannot_be_fetched_is_one_line(memory, url: str, reason: str) -> None:
    if "paramiko" in reason and "paramiko" in map(str, fsspec.available_protocols()):
        pytest.skip("is installed here")
    with pytest.raises(InputError, match=reason) as error, remote.Fetched() as files:
        files.bring(url, "source")
    assert len(str(error.value).splitlines()) == 1


def test_no_rights_are_told(memory, tmp_path, monkeypatch) -> None:
    def refuse(*_arguments, **_settings):
        raise PermissionError("403")

    monkeypatch.setattr(type(memory), "put_file", refuse)
    (tmp_path / "a").write_bytes(b"a")
    with pytest.raises(OutputError, match="memory://a cannot be written: no permission"):
        remote.send(tmp_path / "a", "memory://a")
