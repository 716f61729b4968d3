"""Drivers of every kind: order of frames, order of channels, lazy ranges, refusals."""

from __future__ import annotations

import threading
import zipfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError, IuvFileError
from motion_transfer.media.folders import natural_key
from motion_transfer.media.iuv.opening import open_reader, open_stream

COUNT = 7
KINDS: dict[str, Callable] = {
    "folder": lambda studio, frames: studio.driver(frames),
    "folder vui": lambda studio, frames: studio.driver(frames, order="vui"),
    "ffv1": lambda studio, frames: studio.video(frames),
    "ffv1 vui": lambda studio, frames: studio.video(frames, order="vui"),
    "ffv1 bgra": lambda studio, frames: studio.video(frames, pixels="bgra"),
    "png video": lambda studio, frames: studio.video(
        frames, name="driver.mov", codec="png", pixels="rgb24"
    ),
    "npy": lambda studio, frames: studio.array(frames),
    "npy vui": lambda studio, frames: studio.array(frames[..., ::-1]),
    "npy chw": lambda studio, frames: studio.array(frames.transpose(0, 3, 1, 2)),
    "npz": lambda studio, frames: studio.array(frames, name="driver.npz"),
}
kinds = pytest.mark.parametrize("kind", KINDS)


@kinds
def test_every_kind_gives_the_same_frames(studio, kind: str) -> None:
    frames = studio.walk(COUNT)
    reader = open_reader(open_stream(KINDS[kind](studio, frames)))
    assert (reader.height, reader.width) == frames.shape[1:3]
    assert reader.stream.frame_count == COUNT
    assert reader.order == ("vui" if "vui" in kind else "iuv")
    np.testing.assert_array_equal(np.stack(list(reader.read(0, COUNT))), frames)


@kinds
def test_any_range_equals_the_whole_read(studio, kind: str) -> None:
    frames = studio.walk(COUNT)
    reader = open_reader(open_stream(KINDS[kind](studio, frames)))
    for start in range(COUNT):
        for stop in range(start + 1, COUNT + 1):
            got = list(reader.read(start, stop))
            assert len(got) == stop - start
            np.testing.assert_array_equal(np.stack(got), frames[start:stop])


@kinds
def test_threads_read_at_the_same_time(studio, kind: str) -> None:
    frames = studio.walk(COUNT)
    reader = open_reader(open_stream(KINDS[kind](studio, frames)))
    got: dict[int, np.ndarray] = {}

    def read(start: int) -> None:
        got[start] = np.stack(list(reader.read(start, COUNT)))

    threads = [threading.Thread(target=read, args=(start,)) for start in range(COUNT)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for start in range(COUNT):
        np.testing.assert_array_equal(got[start], frames[start:])


def test_a_single_image_is_a_driver_of_one_frame(studio) -> None:
    stream = open_stream(studio.image("pose.png", studio.iuv()))
    assert (stream.kind, stream.frame_count) == ("IUV image", 1)


@pytest.mark.parametrize(("given", "first"), [("iuv", 0), ("vui", 2)])
def test_a_forced_order_is_taken(studio, given: str, first: int) -> None:
    frames = np.random.default_rng(0).integers(0, 25, (1, 8, 8, 3), np.uint8)
    stream = open_stream(studio.array(frames))
    with pytest.raises(IuvFileError, match="cannot be told"):
        open_reader(stream)
    (read,) = open_reader(stream, given).read(0, 1)
    np.testing.assert_array_equal(read[..., 0], frames[0, ..., first])


def test_an_unknown_order_is_refused(studio) -> None:
    with pytest.raises(InputError, match="'bgr'; supported are iuv, vui"):
        open_reader(open_stream(studio.driver(1)), "bgr")


@pytest.mark.parametrize("rate", [Fraction(25), Fraction(30000, 1001), Fraction(24000, 1001)])
def test_the_rate_of_a_video_is_kept(studio, rate: Fraction) -> None:
    assert open_stream(studio.video(3, rate=rate)).frame_rate == rate


def test_images_have_no_rate(studio) -> None:
    assert open_stream(studio.driver(2)).frame_rate is None


def test_natural_order() -> None:
    names = ["frame_10", "frame_9", "frame_100", "10", "9"]
    assert sorted(names, key=natural_key) == ["9", "10", "frame_9", "frame_10", "frame_100"]


def numbered(studio, numbers: list[int], pattern: str = "frame_{}_IUV.png") -> Path:
    """A folder whose image for number n has its pixel (0, 0) painted with V = n."""
    for number in numbers:
        frame = studio.iuv()
        frame[0, 0] = (1, 0, number)
        studio.image(f"driver/{pattern.format(number)}", frame)
    return studio.folder / "driver"


def played(path: Path, **options) -> list[int]:
    reader = open_reader(open_stream(path, **options))
    return [int(frame[0, 0, 2]) for frame in reader.read(0, reader.stream.frame_count)]


@pytest.mark.parametrize("pattern", ["frame_{}_IUV.png", "{:04d}.png", "take 2 - {}.png"])
def test_folders_play_in_natural_order(studio, pattern: str) -> None:
    assert played(numbered(studio, [8, 9, 10, 11], pattern)) == [8, 9, 10, 11]


def test_a_steady_step_is_no_gap(studio) -> None:
    assert played(numbered(studio, [0, 5, 10, 15])) == [0, 5, 10, 15]


def test_a_gap_is_an_error_that_names_it(studio) -> None:
    with pytest.raises(InputError, match=r"2 missing frames \(3, 4\).*--missing hold"):
        open_stream(numbered(studio, [1, 2, 5, 6]))


def test_a_gap_can_be_held(studio) -> None:
    path = numbered(studio, [1, 2, 5, 6])
    assert played(path, missing="hold") == [1, 2, 2, 2, 5, 6]
    assert open_stream(path, missing="hold").gaps == (3, 4)


def test_photos_beside_iuv_images_are_left_alone(studio) -> None:
    path = numbered(studio, [1, 2, 3])
    studio.image("driver/photo_1.png", np.full((4, 4, 3), 200, np.uint8))
    (path / ".hidden_IUV.png").write_bytes(b"")
    assert played(path) == [1, 2, 3]


@pytest.mark.parametrize(
    ("codec", "pixels", "reason"),
    [
        ("libx264", "yuv420p", "compressed with h264.*ffv1"),
        ("ffv1", "yuv420p", "stores yuv420p.*bgr0"),
        ("ffv1", "yuv444p", "stores yuv444p.*bgr0"),
    ],
)
def test_lossy_video_is_refused_with_the_remedy(
    studio, codec: str, pixels: str, reason: str
) -> None:
    with pytest.raises(IuvFileError, match=reason):
        open_stream(studio.video(2, codec=codec, pixels=pixels))


@pytest.mark.parametrize("name", ["driver.mkv", "driver.avi", "driver.nut"])
@pytest.mark.parametrize("share", [0.5, 0.99])
def test_a_truncated_video_is_refused(studio, name: str, share: float) -> None:
    path = studio.video(20, name=name)
    data = path.read_bytes()
    path.write_bytes(data[: round(len(data) * share)])
    with pytest.raises(IuvFileError, match=r"is truncated|is damaged|cannot be decoded"):
        stream = open_stream(path)
        list(stream.read_raw(0, stream.frame_count))


def test_a_frame_of_another_size_is_named(studio) -> None:
    path = studio.driver(3)
    studio.image("driver/frame_1_IUV.png", studio.iuv(size=(90, 60)))
    with pytest.raises(
        IuvFileError, match=r"frame 1, .*is 60 x 90, but the driver began with 64 x"
    ):
        list(open_reader(open_stream(path)).read(0, 3))


def test_a_driver_of_background_only_is_refused(studio) -> None:
    stream = open_stream(studio.array(np.zeros((3, 8, 8, 3), np.uint8)))
    with pytest.raises(InputError, match="no person in any frame"):
        open_reader(stream)


def broken(studio, kind: str) -> Path:
    """A path that is no driver."""
    path = studio.folder / kind
    if kind == "empty":
        path.mkdir()
    elif kind in ("words.mkv", "words.png", "words.npy", "words.npz"):
        path.write_text("nothing of the kind")
    elif kind == "jpegs":
        studio.image("jpegs/frame_0.jpg", studio.iuv())
    elif kind in ("photo.jpg", "photo.webp"):
        studio.image(kind, studio.iuv())
    elif kind == "float.npy":
        np.save(path, np.zeros((2, 8, 8, 3), np.float32))
    elif kind == "flat.npy":
        np.save(path, np.zeros((8, 8), np.uint8))
    elif kind == "objects.npy":
        np.save(path, np.array([{}], object), allow_pickle=True)
    elif kind == "none.npy":
        np.save(path, np.zeros((0, 8, 8, 3), np.uint8))
    elif kind == "half.npy":
        data = studio.array(3).read_bytes()
        path.write_bytes(data[: len(data) // 2])
    elif kind == "two.npz":
        np.savez(path, first=studio.walk(1), second=studio.walk(1))
    elif kind == "none.npz":
        with zipfile.ZipFile(path, "w"):
            pass
    elif kind == "damaged.npz":
        data = bytearray(studio.array(3, name="whole.npz").read_bytes())
        data[len(data) // 2 : len(data) // 2 + 8] = b"\xff" * 8
        path.write_bytes(data)
    elif kind == "sound.wav":
        path.write_bytes(
            b"RIFF\x2c\0\0\0WAVEfmt \x10\0\0\0\1\0\1\0\x40\x1f\0\0\x80\x3e\0\0\2\0\x10\0data"
            b"\x08\0\0\0" + bytes(8)
        )
    return path


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("missing", "does not exist"),
        ("empty", "holds no IUV images"),
        ("words.mkv", "not a readable video"),
        ("words.png", "not a readable image"),
        ("words.npy", "not a whole NumPy array"),
        ("words.npz", "not a whole NumPy array"),
        ("jpegs", "JPEG file; lossy"),
        ("photo.jpg", "JPEG file; lossy"),
        ("photo.webp", "WebP file; lossy"),
        ("float.npy", "float32"),
        ("flat.npy", r"uint8 \[8, 8\]; an IUV array is"),
        ("objects.npy", r"object \[1\]; an IUV array is"),
        ("none.npy", "holds no frames|not a whole NumPy array"),
        ("half.npy", "not a whole NumPy array"),
        ("two.npz", "2 arrays"),
        ("none.npz", "0 arrays"),
        ("damaged.npz", "not a whole NumPy array"),
        ("sound.wav", "no video"),
    ],
)
def test_what_is_no_driver_is_refused(studio, kind: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        open_reader(open_stream(broken(studio, kind)))


def test_damage_inside_a_video_is_noticed(studio) -> None:
    """FFV1 carries checksums; its decoder conceals what does not match and goes on."""
    path = studio.video(studio.walk(8))
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 16] = bytes(byte ^ 0x55 for byte in data[middle : middle + 16])
    path.write_bytes(data)
    stream = open_stream(path)
    with pytest.raises(IuvFileError, match=r"frame \d+ of .*damaged"):
        list(stream.read_raw(0, stream.frame_count))
