"""Sound: the right piece of it, at the right time, in every container that holds any."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.output.audio import AudioCut, choose_audio
from motion_transfer.media.output.formats import choose_format
from motion_transfer.media.output.segments import join_segments, open_segment, segment_path

RATE = 48_000
CLICK_SECONDS = 1.5  # into the file
FRAME_RATE = Fraction(30000, 1001)


@pytest.fixture
def song(tmp_path: Path) -> Path:
    """Three seconds of silence with one click."""
    samples = np.zeros((1, 3 * RATE), np.int16)
    begin = round(CLICK_SECONDS * RATE)
    samples[0, begin : begin + 480] = 20_000
    path = tmp_path / "song.wav"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=RATE, layout="mono")
        for first in range(0, samples.shape[1], 1600):
            block = np.ascontiguousarray(samples[:, first : first + 1600])
            frame = av.AudioFrame.from_ndarray(block, format="s16", layout="mono")
            frame.sample_rate, frame.pts = RATE, first
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def make(path: Path, cut: AudioCut | None, count: int = 60) -> Path:
    output_format = choose_format(path, codec=None, crf=None)
    segments, first = [], 0
    for index in range(2):
        segment = segment_path(path.parent, index, output_format)
        size = (96, 64)
        with open_segment(segment, output_format, size=size, rate=FRAME_RATE, first=first) as write:
            for _ in range(count // 2):
                write(np.zeros((64, 96, 3), np.uint8))
        segments.append((segment, count // 2))
    join_segments(segments, path, output_format, FRAME_RATE, cut)
    return path


def click_seconds(path: Path) -> float:
    """When the click is heard, as a player has it: by timestamps."""
    with av.open(str(path)) as container:
        for frame in container.decode(audio=0):
            loud = np.abs(frame.to_ndarray()[0]) > 0.3
            if loud.any():
                return frame.time + int(np.argmax(loud)) / frame.sample_rate
    raise AssertionError("no click")


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".webm"])
@pytest.mark.parametrize("start", [Fraction(0), Fraction(1)])
def test_the_click_is_where_it_belongs(tmp_path: Path, song, suffix: str, start: Fraction) -> None:
    length = 60 / FRAME_RATE
    path = make(tmp_path / f"out{suffix}", AudioCut(song, start, length))
    assert click_seconds(path) == pytest.approx(CLICK_SECONDS - start, abs=0.003)
    with av.open(str(path)) as container:
        assert container.streams.video[0].frames in (60, 0)  # Matroska does not say
        assert container.start_time == pytest.approx(0, abs=25_000)  # us; an encoder's run-in
        packets = [p for p in container.demux(container.streams.video[0]) if p.size]
        assert len(packets) == 60
        assert min(p.pts * p.time_base for p in packets) == pytest.approx(0, abs=0.0005)
        assert container.duration / 1e6 == pytest.approx(float(length), abs=0.03)


def test_sound_ends_with_the_pictures(tmp_path: Path, song: Path) -> None:
    path = make(tmp_path / "out.mp4", AudioCut(song, Fraction(0), Fraction(1)))
    with av.open(str(path)) as container:
        samples = sum(frame.samples for frame in container.decode(audio=0))
    assert RATE <= samples <= RATE + 2 * 1024  # whole frames of the encoder


def test_the_same_sound_gives_the_same_bytes(tmp_path: Path, song: Path) -> None:
    cut = AudioCut(song, Fraction(0), Fraction(2))
    results = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        results.append(make(tmp_path / name / "out.mp4", cut).read_bytes())
    assert results[0] == results[1]


def choose(wish: str | None, output: str, driver: Path) -> AudioCut | None:
    path = Path(output)
    return choose_audio(
        Path(wish) if wish else None,
        path,
        choose_format(path, codec=None, crf=None),
        driver=driver,
        start_seconds=Fraction(1, 2),
        duration_seconds=Fraction(2),
    )


def test_which_sound(tmp_path: Path, song: Path) -> None:
    nothing = tmp_path / "folder"
    assert choose(None, "out.mp4", nothing) is None
    assert choose(None, "out.mp4", song) == AudioCut(song, Fraction(1, 2), Fraction(2))
    assert choose("none", "out.mp4", song) is None
    assert choose(str(song), "out.mp4", nothing) == AudioCut(song, Fraction(0), Fraction(2))
    assert choose(None, "out.gif", song) is None


def test_sound_that_cannot_be(tmp_path: Path, song: Path) -> None:
    with pytest.raises(OutputError, match="cannot hold sound"):
        choose(str(song), "out.gif", tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        choose(str(tmp_path / "none.wav"), "out.mp4", tmp_path)
    silent = make(tmp_path / "silent.mp4", None)
    with pytest.raises(InputError, match="has no sound in it"):
        choose(str(silent), "out.mp4", tmp_path)


def test_python_takes_the_name_of_a_file(studio, song: Path) -> None:
    from motion_transfer import render_video

    output = studio.folder / "out.mp4"
    render_video(studio.source(), studio.array(3), output, renderer="texture", audio=str(song))
    with av.open(str(output)) as container:
        assert container.streams.audio
