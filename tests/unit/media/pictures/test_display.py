"""Videos whose pixels are not square, and videos in fields."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.media.container import open_output
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.pictures.display import square_size
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.video import IndexedVideo

CORNER = np.zeros((32, 64, 3), np.uint8)
CORNER[:16, :16] = 255
"""Its upper left is white: half the height, a quarter of the width."""


def film(path: Path, frames: list[np.ndarray], ratio: Fraction | None = None, **kind) -> Path:
    settings = {"codec": "libx264", "pixels": "yuv420p", "options": {"crf": "1"}} | kind
    with open_output(path) as container:
        stream = container.add_stream(settings["codec"], rate=25, options=settings["options"])
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = settings["pixels"]
        if ratio:
            stream.codec_context.sample_aspect_ratio = ratio
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def set_matrix(path: Path, rows: tuple) -> None:
    """Write a display matrix into an MP4's track header."""
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 4 + 20 + 8 + 8
    ones = np.array([[*rows[0], 0], [*rows[1], 0], [0, 0, 1 << 14]]) * (1 << 16)
    data[at : at + 36] = ones.astype(">i4").tobytes()
    path.write_bytes(data)


SIZES = {  # of 64 x 32 pixels
    Fraction(3, 2): (96, 32),
    Fraction(85, 64): (84, 32),
    Fraction(8, 9): (64, 36),
    Fraction(1, 2): (64, 64),
    Fraction(1): (64, 32),
    Fraction(1000, 1001): (64, 32),  # a rounding in the header
}


@pytest.mark.parametrize("suffix", [".mp4", ".mkv"])
@pytest.mark.parametrize("ratio", SIZES)
def test_pixels_become_square(tmp_path: Path, suffix: str, ratio: Fraction) -> None:
    path = film(tmp_path / f"a{suffix}", [CORNER] * 3, ratio)
    clip = open_pictures(path)
    width, height = SIZES[ratio]
    assert (clip.width, clip.height) == (width, height)
    for frame in (*clip.read(), IndexedVideo(path).read(1)):
        assert frame.shape == (height, width, 3)
        assert frame[: height // 2 - 2, : width // 4 - 2].min() > 225
        assert frame[height // 2 + 2 :].max() < 30
        assert frame[:, width // 4 + 2 :].max() < 30
    stretched = (width, height) != (64, 32)
    assert [f"stretched to {width} x {height}" in note for note in clip.notes] == [True] * stretched


def test_the_codec_alone_may_say_it(tmp_path: Path) -> None:
    path = film(tmp_path / "a.h264", [CORNER] * 3, Fraction(3, 2))
    assert open_pictures(path).width == 96


def test_the_container_alone_may_say_it(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mp4", [CORNER] * 3)
    set_matrix(path, ((1.5, 0), (0, 1)))
    clip = open_pictures(path)
    assert (clip.width, clip.height) == (96, 32)
    assert next(iter(clip.read()))[:14, :22].min() > 225


@pytest.mark.parametrize("scale", [(200, 1), (1, 200), (5, 1)])
def test_a_ratio_that_cannot_be_is_not_believed(tmp_path: Path, scale: tuple[int, int]) -> None:
    path = film(tmp_path / "a.mp4", [CORNER] * 3)
    set_matrix(path, ((scale[0], 0), (0, scale[1])))
    clip = open_pictures(path)
    assert (clip.width, clip.height) == (64, 32)
    assert "taken as square" in clip.notes[0]


def test_pictures_never_shrink() -> None:
    for width in range(1, 400, 7):
        for ratio in (Fraction(1), Fraction(1001, 1000), Fraction(8, 9), Fraction(59, 54)):
            grown = square_size(width, 99, ratio)
            assert grown[0] >= width
            assert grown[1] >= 99
    assert square_size(256, 330, Fraction(85, 64)) == (340, 330)
    assert square_size(720, 480, Fraction(8, 9)) == (720, 540)


def test_pixels_are_made_square_before_the_picture_is_turned(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mp4", [CORNER] * 3, Fraction(3, 2))
    set_matrix(path, ((0, 1), (-1, 0)))
    clip = open_pictures(path)
    assert (clip.width, clip.height) == (32, 96)
    for frame in (next(iter(clip.read())), IndexedVideo(path).read(0)):
        assert frame[:22, 18:].min() > 225  # now the upper right, a quarter of the height
        assert frame[26:].max() < 30


def test_parts_stay_whole_when_iuv_is_stretched(studio) -> None:
    frames = studio.walk(3)
    kind = {"codec": "png", "pixels": "rgb24", "options": {}}
    path = film(studio.folder / "a.mov", list(frames), Fraction(3, 2), **kind)
    stream = open_stream(path)
    assert "stretched to 96 x 96" in stream.notes[0]
    reader = open_reader(stream, "iuv")
    assert (reader.width, reader.height) == (96, 96)
    columns = ((np.arange(96) + 0.5) * 64 / 96).astype(int)
    for stretched, frame in zip(reader.read(0, 3), frames, strict=True):
        np.testing.assert_array_equal(stretched, frame[:, columns])


FIELDS_APART = 6  # px that the bar moves from one field to the next


def woven(count: int) -> list[np.ndarray]:
    """A white bar that moves to the right from field to field, the lower field of a frame first."""
    frames = []
    for index in range(count):
        frame = np.full((64, 192, 3), 16, np.uint8)
        for parity in (0, 1):
            left = 16 + FIELDS_APART * (2 * index + 1 - parity)
            frame[parity::2, left : left + 16] = 235
        frames.append(frame)
    return frames


FIELD_CODECS = {
    ".mp4": {"options": {"crf": "1", "flags": "+ildct+ilme"}},
    ".mpg": {"codec": "mpeg2video", "options": {"flags": "+ildct+ilme", "q": "1", "b": "8M"}},
}


def combing(frame: np.ndarray) -> float:
    """How much rows differ from the ones below, on average."""
    return float(np.abs(np.diff(frame.astype(int), axis=0)).mean())


@pytest.mark.parametrize("suffix", FIELD_CODECS)
def test_fields_are_taken_apart(tmp_path: Path, suffix: str) -> None:
    path = film(tmp_path / f"a{suffix}", woven(10), **FIELD_CODECS[suffix])
    clip = open_pictures(path)
    assert any("interlaced" in note for note in clip.notes)
    frames = list(clip.read())
    assert len(frames) == clip.frame_count == 10
    assert combing(woven(1)[0]) > 10
    video = IndexedVideo(path)
    for index, frame in enumerate(frames[1:-1], 1):
        assert combing(frame) < 2
        left = 16 + FIELDS_APART * 2 * index  # as the first field has it
        bright = np.flatnonzero(frame[32, :, 0] > 128)
        assert bright.min() == pytest.approx(left, abs=2)
        assert bright.max() == pytest.approx(left + 15, abs=2)
        np.testing.assert_allclose(video.read(index).astype(int), frame, atol=12)


def test_whole_frames_are_left_alone(tmp_path: Path) -> None:
    clip = open_pictures(film(tmp_path / "a.mp4", woven(6)))
    assert clip.notes == ()
    for frame, drawn in zip(clip.read(), woven(6), strict=True):
        assert combing(frame) == pytest.approx(combing(drawn), rel=0.1)
