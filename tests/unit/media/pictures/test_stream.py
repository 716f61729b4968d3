"""Raw clips: photos, folders and videos as upright frames at a constant rate."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from motion_transfer.errors import InputError
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.stream import PictureStream, plan_timing
from motion_transfer.media.pictures.video import turn_upright

CORNER = np.zeros((32, 64, 3), np.uint8)
CORNER[:16, :32] = 255
"""Wide and dark, its upper left quarter white."""

TURNS = {  # the first two rows of a display matrix, and what it does to a picture
    "as it is": ((1, 0), (0, 1), lambda p: p),
    "a quarter turn clockwise": ((0, 1), (-1, 0), lambda p: np.rot90(p, -1)),
    "half a turn": ((-1, 0), (0, -1), lambda p: np.rot90(p, 2)),
    "a quarter turn back": ((0, -1), (1, 0), lambda p: np.rot90(p)),
    "mirrored": ((-1, 0), (0, 1), lambda p: p[:, ::-1]),
}


def film(path: Path, frames: list[np.ndarray], times: list[int] | None = None, **kind) -> Path:
    """A video of frames; `times` in thousandths of a second."""
    settings = {"codec": "libx264", "rate": Fraction(25), "pixels": "yuv420p"} | kind
    with av.open(str(path), "w") as container:
        stream = container.add_stream(settings["codec"], rate=settings["rate"])
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = settings["pixels"]
        stream.options = {"crf": "1", "bf": "2"} if settings["codec"] == "libx264" else {}
        if times:
            stream.codec_context.time_base = Fraction(1, 1000)
        for index, frame in enumerate(frames):
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
            if times:
                picture.pts, picture.time_base = times[index], Fraction(1, 1000)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def turn(path: Path, rows: tuple) -> None:
    """Write a display matrix into an MP4's track header."""
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 4 + 20 + 8 + 8
    ones = np.array([[*rows[0], 0], [*rows[1], 0], [0, 0, 1 << 14]], ">i4") << 16
    data[at : at + 36] = ones.astype(">i4").tobytes()
    path.write_bytes(data)


def grey(count: int) -> list[np.ndarray]:
    """Frames whose brightness is ten times their number."""
    return [np.full((32, 48, 3), 10 * i, np.uint8) for i in range(count)]


def numbers(clip: PictureStream) -> list[int]:
    return [round(float(frame.mean()) / 10) for frame in clip.read()]


@pytest.mark.parametrize("name", list(TURNS))
def test_a_display_matrix_is_heeded(tmp_path: Path, name: str) -> None:
    *rows, upright = TURNS[name]
    path = film(tmp_path / "a.mp4", [CORNER] * 2)
    turn(path, tuple(rows))
    clip = open_pictures(path)
    expected = upright(CORNER)
    assert (clip.height, clip.width) == expected.shape[:2]
    for frame in clip.read():
        np.testing.assert_allclose(frame.astype(int), expected, atol=12)
    matrix = np.array([[*rows[0], 0], [*rows[1], 0], [0, 0, 1]], np.int32)
    np.testing.assert_array_equal(turn_upright(CORNER, matrix), expected)


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".avi", ".ts"])
@pytest.mark.parametrize("rate", [Fraction(25), Fraction(30000, 1001)])
def test_a_constant_rate_is_kept_exactly(tmp_path: Path, suffix: str, rate: Fraction) -> None:
    clip = open_pictures(film(tmp_path / f"a{suffix}", grey(12), rate=rate))
    assert clip.frame_rate == rate
    assert clip.frame_count == 12
    assert numbers(clip) == list(range(12))
    assert clip.notes == ()


def test_a_varying_rate_becomes_its_mean_and_times_are_kept(tmp_path: Path) -> None:
    times = [0, 40, 80, 120, 160, 360, 560, 760, 960, 1000]
    clip = open_pictures(film(tmp_path / "a.mkv", grey(10), times))
    assert clip.frame_rate == Fraction(9)
    assert "varying frame rate" in clip.notes[0]
    shown = numbers(clip)
    assert len(shown) == clip.frame_count == 9
    for index, number in enumerate(shown):
        middle = (index + 0.5) * 1000 / 9
        assert times[number] <= middle
        assert number + 1 == len(times) or times[number + 1] >= middle


def test_a_late_beginning_is_told(tmp_path: Path) -> None:
    times = [200 + 40 * i for i in range(6)]
    clip = open_pictures(film(tmp_path / "a.mkv", grey(6), times))
    assert clip.start_seconds == Fraction(1, 5)
    assert clip.frame_rate == 25
    assert numbers(clip) == list(range(6))


def test_packets_without_times_follow_each_other() -> None:
    timing = plan_timing([(None, 0)] * 7, Fraction(1, 25), None, Path("a"))
    assert (timing.rate, timing.count, timing.constant) == (30, 7, True)
    with pytest.raises(InputError, match="holds no frames"):
        plan_timing([], Fraction(1), None, Path("a"))


def test_a_photo_is_turned_and_laid_on_white(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    path = tmp_path / "a.png"
    rgba = np.dstack([CORNER, np.full((32, 64), 255, np.uint8)])
    rgba[:, 32:, 3] = 0
    Image.fromarray(rgba).save(path, exif=exif)
    clip = open_pictures(path)
    (frame,) = clip.read()
    assert (clip.frame_count, clip.height, clip.width) == (1, 64, 32)
    assert frame[:32, 16:].min() == 255  # white
    assert frame[:32, :16].max() == 0  # black
    assert frame[32:].min() == 255  # transparent


@pytest.mark.parametrize("mode", ["L", "LA", "1", "P", "CMYK", "I;16", "RGBA", "YCbCr"])
def test_photos_of_every_mode(tmp_path: Path, mode: str) -> None:
    path = tmp_path / ("a.tif" if mode in ("CMYK", "YCbCr", "LA") else "a.png")
    grey16 = np.full((8, 6), 200, np.uint8)
    image = Image.fromarray(grey16.astype(np.uint16) * 257) if mode == "I;16" else None
    (image or Image.fromarray(np.dstack([grey16] * 3)).convert(mode)).save(path)
    (frame,) = open_pictures(path).read()
    assert frame.shape == (8, 6, 3)
    assert frame.mean() == pytest.approx(200, abs=16)  # two colours are dithered


def test_notes_of_every_photo_are_kept(tmp_path: Path) -> None:
    for index, profile in enumerate((None, b"none", None, b"none")):
        Image.fromarray(CORNER).save(tmp_path / f"{index}.png", icc_profile=profile)
    clip = open_pictures(tmp_path)
    for _ in range(2):
        assert len(list(clip.read())) == 4
    assert [re.findall(r"\d\.png", note) for note in clip.notes] == [["1.png"], ["3.png"]]


def test_a_folder_is_a_clip_in_natural_order(tmp_path: Path) -> None:
    for index in (10, 9, 1):
        Image.fromarray(grey(11)[index]).save(tmp_path / f"p{index}.jpg", quality=100)
    clip = open_pictures(tmp_path)
    assert clip.frame_rate is None
    assert numbers(clip) == [1, 9, 10]
    Image.fromarray(CORNER).save(tmp_path / "p11.png")
    with pytest.raises(InputError, match=r"frame 3, .*p11\.png is 64 x 32, but the first .* 48"):
        list(open_pictures(tmp_path).read())


def test_a_large_photo_is_read_without_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "large.png"
    Image.new("L", (10_000, 10_000), 90).save(path, compress_level=1)
    clip = open_pictures(path)
    assert (clip.height, clip.width) == (10_000, 10_000)


def test_what_is_no_clip(tmp_path: Path) -> None:
    (tmp_path / "words.mp4").write_text("words")
    (tmp_path / "words.jpg").write_text("words")
    with av.open(str(tmp_path / "sound.mkv"), "w") as container:
        stream = container.add_stream("aac", rate=48000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        frame.sample_rate = 48000
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    empty = tmp_path / "empty"
    empty.mkdir()
    for name, reason in (
        ("words.mp4", "neither a picture nor a video"),
        ("words.jpg", "not a picture in a known format"),
        ("sound.mkv", "no pictures in it"),
        ("empty", "holds no pictures"),
        ("gone", "does not exist"),
    ):
        with pytest.raises(InputError, match=reason):
            open_pictures(tmp_path / name)


def test_a_damaged_video_is_named(tmp_path: Path) -> None:
    path = film(tmp_path / "a.avi", grey(12), codec="ffv1", pixels="bgr0")
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 400] = bytes(400)
    path.write_bytes(data)
    clip = open_pictures(path)
    try:
        assert len(list(clip.read())) == clip.frame_count  # what decoders conceal is shown
    except InputError as error:
        assert "is damaged" in str(error)
