"""Sound stands where its time stamps say, and silence where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.container import open_input, open_output
from motion_transfer.media.iuv.opening import open_stream
from motion_transfer.media.output.audio import AudioCut, AudioTrack, choose_audio
from motion_transfer.media.output.formats import choose_format
from motion_transfer.media.pictures.formats import open_pictures

RATE = 48_000
MP4 = choose_format(Path("a.mp4"), codec=None, crf=None)


def signal(seconds: float, click: float | None = None, level: float = 0.05) -> np.ndarray:
    """Mono sound that is never silent, with a click."""
    samples = level * np.sin(np.arange(round(seconds * RATE)) * 2 * np.pi * 500 / RATE)
    if click is not None:
        samples[round(click * RATE) :][:480] = 0.7
    return samples.astype(np.float32)[None]


def record(
    path: Path,
    pieces: Sequence[tuple[float, np.ndarray]],
    *,
    codec: str = "pcm_s16le",
    video: str | None = None,
    video_start: float = 0,
    jitter: Sequence[float] = (0,),
    packet: int = 1024,
) -> Path:
    """A file of sound in pieces, each with when it begins, beside pictures of two seconds.

    Args:
        jitter: By how many seconds the packets' time stamps are off, in turns.
        packet: Samples in each, where the codec takes any number.
    """
    with open_output(path) as container:
        pictures = container.add_stream(video, rate=10) if video else None
        if pictures:
            pictures.width, pictures.height = 64, 32
            pictures.pix_fmt = "bgr0" if video == "ffv1" else "yuv420p"
            pictures.codec_context.time_base = Fraction(1, 1000)
        sound = container.add_stream(codec, rate=RATE, layout="mono")
        sound.codec_context.time_base = Fraction(1, RATE)
        sound.codec_context.open()
        form, size = sound.codec_context.format.name, sound.codec_context.frame_size or packet
        for index in range(20 if pictures else 0):
            frame = av.VideoFrame.from_ndarray(np.full((32, 64, 3), 9, np.uint8), format="rgb24")
            frame = frame.reformat(format=pictures.pix_fmt)
            frame.pts, frame.time_base = round(1000 * video_start) + 100 * index, Fraction(1, 1000)
            container.mux(pictures.encode(frame))
        if pictures:
            container.mux(pictures.encode(None))
        number = 0
        for begins, samples in pieces:
            for first in range(0, samples.shape[1], size):
                block = np.ascontiguousarray(samples[:, first : first + size])
                if form == "s16":
                    block = (block * 32767).astype(np.int16)
                frame = av.AudioFrame.from_ndarray(block, form, "mono")
                frame.sample_rate, frame.time_base = RATE, Fraction(1, RATE)
                late = jitter[number % len(jitter)]
                frame.pts = round((begins + late) * RATE) + first
                number += 1
                container.mux(sound.encode(frame))
        container.mux(sound.encode(None))
    return path


def listen(cut: AudioCut, folder: Path) -> np.ndarray:
    """What is heard of an output's sound, without loss."""
    path = folder / "heard.mkv"
    with open_output(path) as container:
        AudioTrack(cut, container, "pcm_s16le").write_until(None)
    with open_input(path) as container:
        frames = [frame.to_ndarray() for frame in container.decode(audio=0)]
    return np.concatenate(frames, 1)[0].astype(float) / 32767


def choose(
    path: Path,
    *,
    start: float = 0,
    seconds: float = 2,
    wish: Path | None = None,
    track: int | None = None,
) -> AudioCut:
    """A driver's sound, or a file's."""
    cut = choose_audio(
        wish,
        Path("a.mp4"),
        MP4,
        driver=path,
        start_seconds=Fraction(start).limit_denominator(1000),
        duration_seconds=Fraction(seconds).limit_denominator(1000),
        track=track,
    )
    assert cut is not None
    return cut


def heard(path: Path, **options) -> np.ndarray:
    return listen(choose(path, **options), path.parent)


def click_ms(samples: np.ndarray) -> float:
    return float(np.argmax(np.abs(samples) > 0.4)) * 1000 / RATE


CONTAINERS = {  # what holds late sound, and how exactly: milliseconds, a time scale of 1/1000
    ".mkv": ("pcm_s16le", 1),
    ".mov": ("pcm_s16le", 1),
    ".mp4": ("aac", 2),
    ".webm": ("libopus", 1.5),
    ".ts": ("aac", 24),  # a run-in of the encoder (21 ms) that is not told
}


@pytest.mark.parametrize("suffix", CONTAINERS)
@pytest.mark.parametrize("start", [0, 0.5])
def test_sound_that_starts_late_stays_late(tmp_path: Path, suffix: str, start: float) -> None:
    codec, exact = CONTAINERS[suffix]
    video = "libvpx-vp9" if suffix == ".webm" else "libx264"
    path = record(tmp_path / f"a{suffix}", [(1, signal(1, 0.25))], codec=codec, video=video)
    begins = float(open_pictures(path).start_seconds)
    samples = heard(path, start=begins + start, seconds=2 - start)
    assert len(samples) == (2 - start) * RATE
    assert click_ms(samples) == pytest.approx(1250 - 1000 * start, abs=exact)
    assert not samples[: round((0.97 - start) * RATE)].any()


@pytest.mark.parametrize("start", [0, 0.5])
def test_a_hole_is_silent_and_nothing_moves(tmp_path: Path, start: float) -> None:
    pieces = [(0, signal(0.5)), (1, signal(1, 0.25))]
    cut = choose(record(tmp_path / "a.mkv", pieces), start=start, seconds=2 - start)
    samples = listen(cut, tmp_path)
    told = "holes, 0.50 s in all, the first one 0.50 s into" in " ".join(cut.notes)
    assert told == (start == 0)  # else it is where the sound begins
    assert len(samples) == (2 - start) * RATE
    assert click_ms(samples) == pytest.approx(1250 - 1000 * start, abs=0.6)
    hole = samples[round((0.502 - start) * RATE) : round((0.998 - start) * RATE)]
    assert not hole.any()
    assert np.abs(samples[round((1.002 - start) * RATE) :]).max() > 0.04


def test_one_packet_that_is_missing_is_a_hole(tmp_path: Path) -> None:
    lost = 1024 / RATE
    pieces = [(0, signal(0.512)), (0.512 + lost, signal(1, 0.25))]
    samples = heard(record(tmp_path / "a.mkv", pieces))
    assert click_ms(samples) == pytest.approx(1000 * (0.762 + lost), abs=0.6)


def test_the_jitter_of_time_stamps_is_not_heard(tmp_path: Path) -> None:
    jitter = (0, 0.004, -0.003, 0.001, -0.004)
    path = record(tmp_path / "a.mkv", [(0, signal(2))], jitter=jitter)
    samples = heard(path)
    np.testing.assert_allclose(samples, signal(2)[0], atol=0.001)


def test_of_sound_over_sound_the_first_is_heard(tmp_path: Path) -> None:
    pieces = [(0, signal(1.024, level=0.2)), (0.512, signal(1.5, 1.0, level=0.05))]
    samples = heard(record(tmp_path / "a.mkv", pieces, packet=round(1.024 * RATE)))
    assert click_ms(samples) == pytest.approx(1512, abs=0.6)
    assert np.abs(samples[: round(1.02 * RATE)]).max() > 0.19
    assert np.abs(samples[round(1.03 * RATE) : round(1.5 * RATE)]).max() < 0.06


def test_sound_that_is_over_is_silence(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mkv", [(0, signal(0.5))])
    assert len(heard(path)) == 2 * RATE
    assert not heard(path, start=1, seconds=1).any()
    assert not heard(record(tmp_path / "b.mkv", [(9, signal(0.5))]), seconds=1).any()


def test_a_driver_of_iuv_knows_when_it_begins(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mkv", [(2, signal(2, 0.25))], video="ffv1", video_start=2)
    begins = open_stream(path).start_seconds
    assert begins == 2
    assert click_ms(heard(path, start=float(begins))) == pytest.approx(250, abs=0.6)


def test_a_run_lays_the_sound_of_iuv_under_it(studio) -> None:
    from motion_transfer import render_video

    frames = studio.walk(20)
    path, output = studio.folder / "late.mkv", studio.folder / "out.mp4"
    with open_output(path) as container:
        pictures = container.add_stream("ffv1", rate=10)
        pictures.height, pictures.width = frames.shape[1:3]
        pictures.pix_fmt = "bgr0"
        sound = container.add_stream("pcm_s16le", rate=RATE, layout="mono")
        for index, iuv in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(iuv, format="rgb24").reformat(format="bgr0")
            frame.pts, frame.time_base = 20 + index, Fraction(1, 10)
            container.mux(pictures.encode(frame))
        container.mux(pictures.encode(None))
        samples = (signal(1, 0.25) * 32767).astype(np.int16)
        frame = av.AudioFrame.from_ndarray(samples, "s16", "mono")
        frame.sample_rate, frame.pts, frame.time_base = RATE, 3 * RATE, Fraction(1, RATE)
        container.mux(sound.encode(frame))
        container.mux(sound.encode(None))
    render_video(studio.source(), path, output, renderer="texture", frames="5:20")
    with open_input(output) as container:
        blocks = [frame.to_ndarray()[0] for frame in container.decode(audio=0)]
    assert click_ms(np.concatenate(blocks)) == pytest.approx(750, abs=3)


def test_a_file_of_sound_is_laid_from_its_own_beginning(tmp_path: Path) -> None:
    song = record(tmp_path / "song.mkv", [(5, signal(1, 0.25))])
    video = record(
        tmp_path / "v.mkv", [(6, signal(1, 0.25))], video="libx264", video_start=5
    )  # the sound is a second later than the pictures
    nothing = tmp_path / "folder"
    assert click_ms(heard(nothing, wish=song)) == pytest.approx(250, abs=0.6)
    assert click_ms(heard(nothing, wish=video)) == pytest.approx(1250, abs=0.6)


def write_tracks(path: Path, defaults: Sequence[bool]) -> Path:
    """A file with a track of sound for each entry, each louder than the one before."""
    with open_output(path, options={"default_mode": "passthrough"}) as container:
        tracks = [container.add_stream("pcm_s16le", rate=RATE, layout="mono") for _ in defaults]
        for number, (track, default) in enumerate(zip(tracks, defaults, strict=True)):
            track.disposition = av.stream.Disposition.default if default else 0
            track.metadata["language"] = ("eng", "deu", "fra")[number]
            if number == 1:
                track.metadata["title"] = "Kommentar"
        for number, track in enumerate(tracks):
            block = (signal(1, level=0.1 * (number + 1)) * 32767).astype(np.int16)
            frame = av.AudioFrame.from_ndarray(block, "s16", "mono")
            frame.sample_rate, frame.pts, frame.time_base = RATE, 0, Fraction(1, RATE)
            container.mux(track.encode(frame))
            container.mux(track.encode(None))
    return path


@pytest.mark.parametrize(
    ("defaults", "wish", "level"),
    [
        ((True, False, False), None, 0.1),
        ((False, True, False), None, 0.2),
        ((False, True, True), None, 0.2),
        ((False, False, False), None, 0.1),
        ((True, False, False), 0, 0.1),
        ((True, False, False), 2, 0.3),
    ],
)
def test_which_track(tmp_path: Path, defaults, wish: int | None, level: float) -> None:
    path = write_tracks(tmp_path / "a.mkv", defaults)
    cut = choose(path, seconds=1, track=wish)
    samples = listen(cut, tmp_path)
    assert np.abs(samples).max() == pytest.approx(level, abs=0.01)
    if wish is None:
        assert "0 (eng), 1 (deu, Kommentar), 2 (fra); " in cut.notes[0]
        assert f"; {round(level * 10) - 1} is taken" in cut.notes[0]
    else:
        assert cut.notes == ()
    assert np.array_equal(samples, heard(tmp_path, wish=path, seconds=1, track=wish))


def test_tracks_that_cannot_be(tmp_path: Path) -> None:
    path = write_tracks(tmp_path / "a.mkv", (True, False))
    for wish in (2, -1):
        with pytest.raises(InputError, match=r"has the tracks 0 \(eng\), 1 \(deu, Kommentar\)"):
            heard(path, track=wish)
    with pytest.raises(InputError, match="no sound in it"):
        heard(tmp_path, track=0)
    with pytest.raises(InputError, match="--audio none wants none"):
        heard(path, wish=Path("none"), track=0)
    with pytest.raises(OutputError, match="leave out --audio-track"):
        gif = Path("a.gif")
        seconds = Fraction(1)
        choose_audio(
            None,
            gif,
            choose_format(gif, codec=None, crf=None),
            track=0,
            driver=path,
            start_seconds=seconds,
            duration_seconds=seconds,
        )


def write_stream(path: Path, kinds: Sequence[tuple[int, str]]) -> Path:
    """Sound whose rate and channels change: streams of MP2, one after the other."""
    data = b""
    for number, (rate, layout) in enumerate(kinds):
        piece = path.with_name(f"{number}.mp2")
        with open_output(piece) as container:
            track = container.add_stream("mp2", rate=rate, layout=layout)
            for index in range(20):
                channels = 2 if layout == "stereo" else 1
                block = np.full((1, 1152 * channels), 3000, np.int16)
                frame = av.AudioFrame.from_ndarray(block, "s16", layout)
                frame.sample_rate, frame.time_base = rate, Fraction(1, rate)
                frame.pts = 1152 * index
                container.mux(track.encode(frame))
            container.mux(track.encode(None))
        data += piece.read_bytes()
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("second", [(44_100, "stereo"), (48_000, "mono")])
def test_sound_that_changes_midway_is_named(tmp_path: Path, second: tuple[int, str]) -> None:
    path = write_stream(tmp_path / "a.mp2", [(48_000, "stereo"), second])
    with pytest.raises(InputError, match=r"changes .* Hz, stereo, .* to .* Hz"):
        heard(tmp_path, wish=path)


def test_sound_that_cannot_be_decoded_is_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = record(tmp_path / "a.mkv", [(0, signal(1))], codec="flac")
    data = path.read_bytes()
    assert data.count(b"\xff\xf8") > 9  # with which its frames begin
    path.write_bytes(data.replace(b"\xff\xf8", b"\0\0"))
    with pytest.raises(InputError, match=r"a\.mkv is damaged.*convert it"):
        heard(path)
    assert capfd.readouterr() == ("", "")
