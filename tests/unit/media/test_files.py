"""What may be read of what a user names."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.media.files import check_readable, read_bytes


def test_a_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"content")
    assert read_bytes(tmp_path / "file", "source") == b"content"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("absent", "source .*absent does not exist"),
        ("folder", "source .*folder is a folder; name a file in it"),
        ("pipe", "source .*pipe is a device or a pipe; write its content to a file"),
        ("x" * 300, "cannot be read: File name too long"),
        ("null\0byte", "cannot be read: embedded null byte"),
        ("/dev/zero", "source /dev/zero is a device or a pipe"),
    ],
)
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, name: str, reason: str) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match=reason):
        read_bytes(tmp_path / name, "source")


def test_a_folder_may_be_wanted(tmp_path: Path) -> None:
    check_readable(tmp_path, "driver", folder=True)
