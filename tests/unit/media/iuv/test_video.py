"""IUV in videos: decoders conceal damage unless they are told not to."""

from __future__ import annotations

from fractions import Fraction

import av
import pytest

from motion_transfer.errors import IuvFileError
from motion_transfer.media.container import open_output
from motion_transfer.media.iuv.opening import open_stream


def test_a_wrong_checksum_is_damage(studio) -> None:
    path = studio.video(3, name="a.mov", codec="png", pixels="rgb24")
    data = path.read_bytes()
    at = data.index(b"IEND", data.index(b"IEND") + 4)  # of the second frame; before it, a checksum
    path.write_bytes(data[: at - 5] + bytes([data[at - 5] ^ 1]) + data[at - 4 :])
    stream = open_stream(path)
    assert len(list(stream.read_raw(0, 1))) == 1
    with pytest.raises(IuvFileError, match=r"frame 1 .*is damaged"):
        list(stream.read_raw(0, 3))


@pytest.mark.parametrize("times", [[0, 100, 200, 300, 400, 500], [0, 100, 200, 600, 700, 1300]])
def test_a_varying_rate_is_told(studio, times: list[int]) -> None:
    path = studio.folder / "a.mkv"
    with open_output(path) as container:
        stream = container.add_stream("ffv1", rate=10)
        stream.height, stream.width = studio.iuv().shape[:2]
        stream.pix_fmt = "bgr0"
        stream.codec_context.time_base = Fraction(1, 1000)
        for iuv, time in zip(studio.walk(6), times, strict=True):
            frame = av.VideoFrame.from_ndarray(iuv, format="rgb24").reformat(format="bgr0")
            frame.pts, frame.time_base = time, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    notes = open_stream(path).notes
    assert [("varying frame rate" in note) for note in notes] == [True] * (times[-1] > 500)
