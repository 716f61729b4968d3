"""Segments joined into every kind of output: each frame once, in order, at the right time.

The frame's number is painted as a grey level, so that what comes out says which frame it is.
"""

from __future__ import annotations

import itertools
import sys
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import ModuleType

import av
import numpy as np
import pytest
from PIL import Image

from motion_transfer.errors import OutputError
from motion_transfer.media.codecs import CODECS
from motion_transfer.media.output.formats import (
    CONTAINERS,
    OUTPUT_KINDS,
    OutputKind,
    choose_format,
)
from motion_transfer.media.output.segments import join_segments, open_segment, segment_path
from motion_transfer.media.pictures.photo import read_photo

COUNTS = (12, 12, 7)
TOTAL = sum(COUNTS)
STEP = 8  # grey levels between frames: more than any of the codecs strays
SIZE = (96, 64)
VIDEOS = [(suffix, codec) for suffix, row in CONTAINERS.items() for codec in row.codecs]
RATE = Fraction(30000, 1001)


def grey(index: int) -> np.ndarray:
    return np.full((SIZE[1], SIZE[0], 3), index * STEP, np.uint8)


def write(path: Path, *, codec=None, crf=None, rate=RATE, paint=grey, counts=COUNTS) -> Path:
    output_format = choose_format(path, codec=codec, crf=crf)
    segments, first = [], 0
    for number, count in enumerate(counts):
        segment = segment_path(path.parent, number, output_format)
        height, width = paint(0).shape[:2]
        with open_segment(
            segment, output_format, size=(width, height), rate=rate, first=first
        ) as write_frame:
            for index in range(first, first + count):
                write_frame(paint(index))
        segments.append((segment, count))
        first += count
    join_segments(segments, path, output_format, rate)
    return path


def read(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def levels(path: Path) -> list[float]:
    return [float(frame.mean()) / STEP for frame in read(path)]


@pytest.mark.parametrize(("suffix", "codec"), VIDEOS)
def test_every_frame_comes_out_once_in_order(tmp_path: Path, suffix: str, codec: str) -> None:
    got = levels(write(tmp_path / f"out{suffix}", codec=codec))
    assert got == pytest.approx(range(TOTAL), abs=0.3)


@pytest.mark.parametrize(("suffix", "codec"), VIDEOS)
@pytest.mark.parametrize("rate", [Fraction(25), RATE], ids=str)
def test_time_is_exact(tmp_path: Path, suffix: str, codec: str, rate: Fraction) -> None:
    path = write(tmp_path / f"out{suffix}", codec=codec, rate=rate)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        packets = [packet for packet in container.demux(stream) if packet.size]
        tick = stream.time_base
        times = [packet.pts * tick for packet in packets]
        assert len(packets) == TOTAL
        assert min(times) == 0
        decoding = [packet.dts for packet in packets if packet.dts is not None]
        assert all(a < b for a, b in itertools.pairwise(decoding))
        half_tick = 0 if suffix in (".mp4", ".mov") else Fraction(1, 2000)  # Matroska counts ms
        for index, time in enumerate(sorted(times)):
            assert abs(time - index / rate) <= half_tick
        assert stream.average_rate == rate
        assert container.duration / 1e6 == pytest.approx(float(TOTAL / rate), abs=0.002)
        assert (stream.width, stream.height) == SIZE


@pytest.mark.parametrize(("suffix", "codec"), [video for video in VIDEOS if video[1] != "ffv1"])
def test_colours_are_bt709_and_say_so(tmp_path: Path, suffix: str, codec: str) -> None:
    colours = [(200, 40, 40), (30, 60, 160), (40, 160, 60)]
    image = np.concatenate([np.full((64, 32, 3), colour, np.uint8) for colour in colours], 1)
    path = write(tmp_path / f"out{suffix}", codec=codec, counts=(4,), paint=lambda _: image)
    with av.open(str(path)) as container:
        frame = next(container.decode(video=0))
        context = container.streams.video[0].codec_context
        assert (context.color_primaries, context.color_trc, context.colorspace) == (1, 1, 1)
        assert context.color_range == 1
        pixels = frame.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray()
    for index, colour in enumerate(colours):
        middle = pixels[24:40, 32 * index + 12 : 32 * index + 20].reshape(-1, 3)
        np.testing.assert_allclose(middle.mean(0), colour, atol=4)


def test_ffv1_is_lossless(tmp_path: Path) -> None:
    def paint(index: int) -> np.ndarray:
        return np.random.default_rng(index).integers(0, 256, (33, 47, 3), np.uint8)

    for index, frame in enumerate(read(write(tmp_path / "out.mkv", codec="ffv1", paint=paint))):
        np.testing.assert_array_equal(frame, paint(index))


@pytest.mark.parametrize("suffix", [".mp4", ".mov"])
def test_the_index_stands_before_the_frames(tmp_path: Path, suffix: str) -> None:
    data = write(tmp_path / f"out{suffix}").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_h265_has_the_tag_that_players_expect(tmp_path: Path) -> None:
    assert b"hvc1" in write(tmp_path / "out.mp4", codec="h265").read_bytes()


def test_a_higher_crf_makes_a_smaller_file(tmp_path: Path) -> None:
    def paint(index: int) -> np.ndarray:
        return np.random.default_rng(index).integers(0, 256, (64, 64, 3), np.uint8)

    sizes = []
    for crf in (10, 40):
        (tmp_path / str(crf)).mkdir()
        sizes.append(write(tmp_path / str(crf) / "out.mp4", crf=crf, paint=paint).stat().st_size)
    assert sizes[1] < sizes[0] / 2


@pytest.mark.parametrize("codec", ["h264", "h265", "vp9", "av1", "ffv1", "prores"])
def test_the_smallest_window_can_be_encoded(tmp_path: Path, codec: str) -> None:
    path = write(
        tmp_path / "out.mkv", codec=codec, counts=(2,), paint=lambda _: grey(9)[:16, :16].copy()
    )
    assert len(read(path)) == 2


@pytest.mark.parametrize("suffix", [".webp", ".apng"])
@pytest.mark.parametrize("rate", [Fraction(25), Fraction(30), RATE], ids=str)
def test_an_animation_keeps_frames_and_time(tmp_path: Path, suffix: str, rate: Fraction) -> None:
    path = write(tmp_path / f"out{suffix}", rate=rate)
    begins = 0.0
    with Image.open(path) as file:
        assert file.n_frames == TOTAL
        assert file.info["loop"] == 0  # for ever
        for index in range(TOTAL):
            file.seek(index)
            level = np.asarray(file.convert("RGB")).mean()
            assert level / STEP == pytest.approx(index, abs=0.3)
            assert begins == pytest.approx(1000 * float(index / rate), abs=1.01)
            begins += file.info["duration"]
    assert begins == pytest.approx(1000 * float(TOTAL / rate), abs=1.01)


def test_an_animation_has_a_largest_size(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="webp cannot hold 16384 x 4, its longest side is 16383"):
        write(tmp_path / "out.webp", paint=lambda _: np.zeros((4, 16_384, 3), np.uint8))


@pytest.mark.parametrize("rate", [Fraction(25), Fraction(30), RATE], ids=str)
def test_a_gif_keeps_frames_and_time(tmp_path: Path, rate: Fraction) -> None:
    path = write(tmp_path / "out.gif", rate=rate)
    with av.open(str(path)) as container:
        frames = list(container.decode(video=0))
    times = [float(frame.pts * frame.time_base) for frame in frames]
    assert times == pytest.approx([float(i / rate) for i in range(TOTAL)], abs=0.0051)
    assert levels(path) == pytest.approx(range(TOTAL), abs=0.3)
    assert b"NETSCAPE2.0\x03\x01\x00\x00" in path.read_bytes()  # loops for ever


def test_a_folder_holds_every_frame(tmp_path: Path) -> None:
    files = sorted(write(tmp_path / "out").iterdir())
    assert [file.name for file in files] == [f"{index:06d}.png" for index in range(TOTAL)]
    for index, file in enumerate(files):
        np.testing.assert_array_equal(read_photo(file).rgb, grey(index))


def test_a_single_picture(tmp_path: Path) -> None:
    path = write(tmp_path / "out.png", counts=(1,), paint=lambda _: grey(5))
    np.testing.assert_array_equal(read_photo(path).rgb, grey(5))


def test_what_an_encoder_refuses_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="libsvtav1 cannot encode 96 x 64 at 1000 frames/s"):
        write(tmp_path / "out.mkv", codec="av1", rate=Fraction(1000))


def test_encoders_keep_quiet(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    for codec in CODECS:
        (tmp_path / codec).mkdir()
        write(tmp_path / codec / "out.mkv", codec=codec, counts=(2,))
    assert capfd.readouterr() == ("", "")


@contextmanager
def open_toy(path: Path, *_, first: int, **__):
    lines: list[str] = []
    yield lambda frame: lines.append(f"{first + len(lines)} {frame[0, 0, 0]}")
    path.write_text("\n".join(lines))


def join_toys(segments, destination: Path, *_) -> None:
    destination.write_text("\n".join(path.read_text() for path, _ in segments))


def test_a_new_kind_of_output_is_a_row_and_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = ModuleType("toy_output")
    module.open_segment, module.join_segments = open_toy, join_toys
    monkeypatch.setitem(sys.modules, "toy_output", module)
    monkeypatch.setitem(OUTPUT_KINDS, "toy", OutputKind((".toy",), ".toy", "toy_output"))
    text = write(tmp_path / "out.toy").read_text()
    assert text.splitlines() == [f"{index} {index * STEP}" for index in range(TOTAL)]
    with pytest.raises(OutputError, match=r"none for a folder of PNG, \.toy"):
        choose_format(Path("out.unheard"), codec=None, crf=None)
