"""IUV in videos: decoders conceal damage unless they are told not to."""

from __future__ import annotations

import pytest

from motion_transfer.errors import IuvFileError
from motion_transfer.media.iuv.opening import open_stream


def test_a_wrong_checksum_is_damage(studio) -> None:
    path = studio.video(3, name="a.mov", codec="png", pixels="rgb24")
    data = path.read_bytes()
    at = data.index(b"IEND", data.index(b"IEND") + 4)  # of the second frame; before it, a checksum
    path.write_bytes(data[: at - 5] + bytes([data[at - 5] ^ 1]) + data[at - 4 :])
    stream = open_stream(path)
    assert len(list(stream.read_raw(0, 1))) == 1
    with pytest.raises(IuvFileError, match="frame 1 .*is damaged"):
        list(stream.read_raw(0, 3))
