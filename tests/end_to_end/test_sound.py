"""Which sound an output carries, and names that look like addresses."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.media.container import open_input, open_output

RATE = 48_000


def write_driver(path: Path, frames: np.ndarray, levels: tuple[float, ...]) -> Path:
    """IUV with a track of sound for each level; ten frames a second."""
    with open_output(path) as container:
        pictures = container.add_stream("ffv1", rate=10)
        pictures.height, pictures.width = frames.shape[1:3]
        pictures.pix_fmt = "bgr0"
        tracks = [container.add_stream("pcm_s16le", rate=RATE, layout="mono") for _ in levels]
        for iuv in frames:
            frame = av.VideoFrame.from_ndarray(iuv, format="rgb24").reformat(format="bgr0")
            container.mux(pictures.encode(frame))
        container.mux(pictures.encode(None))
        for track, level in zip(tracks, levels, strict=True):
            wave = level * np.sin(np.arange(RATE // 2) * 2 * np.pi * 500 / RATE)
            block = (wave * 32767).astype(np.int16)[None]
            frame = av.AudioFrame.from_ndarray(block, "s16", "mono")
            frame.sample_rate, frame.pts, frame.time_base = RATE, 0, Fraction(1, RATE)
            container.mux(track.encode(frame))
            container.mux(track.encode(None))
    return path


def loudness(path: Path) -> float:
    with open_input(path) as container:
        blocks = [frame.to_ndarray() for frame in container.decode(audio=0)]
    return float(np.abs(np.concatenate(blocks, 1)[:, 5000:15000]).max())


@pytest.mark.parametrize(("words", "level"), [((), 0.1), (("--audio-track", 1), 0.3)])
def test_a_track_is_chosen(draft, studio, words: tuple[object, ...], level: float) -> None:
    driver = write_driver(studio.folder / "d.mkv", studio.walk(5), (0.1, 0.3))
    output = studio.folder / "out.mp4"
    told = draft("--source", studio.source(), "--driver", driver, "-o", output, *words)
    assert told.code == 0, told.err
    assert loudness(output) == pytest.approx(level, abs=0.02)
    assert ("has the sound tracks 0, 1; 0 is taken" in " ".join(told.err.split())) == (not words)


def test_a_track_that_is_not_there_is_one_line(draft, studio) -> None:
    driver = write_driver(studio.folder / "d.mkv", studio.walk(5), (0.1, 0.3))
    output = studio.folder / "out.mp4"
    words = ("--source", studio.source(), "--driver", driver, "-o", output, "--audio-track", 2)
    told = draft(*words)
    assert told.code == 2
    assert told.err.count("\n") == 1
    assert "has the tracks 0, 1; choose one" in told.err
    assert not output.exists()


def test_a_colon_in_a_name_is_no_protocol(draft, studio, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(studio.folder)
    driver = write_driver(Path("2024-05-01T12:30:45.mkv"), studio.walk(5), (0.2,))
    output = Path("out:1.mp4")
    words = ("--source", studio.source(), "--driver", driver, "--audio", driver, "-o", output)
    told = draft(*words)
    assert told.code == 0, told.err
    assert loudness(output) == pytest.approx(0.2, abs=0.02)
