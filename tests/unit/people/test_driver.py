"""Drivers from motion."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError, OutputError

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.people import is_motion
from motion_transfer.people.driver import MotionDriver, MotionOptions, open_motion, record_motion
from motion_transfer.people.figure.body import Shape
from motion_transfer.people.motion.motions import MOTIONS


@pytest.fixture
def driver(body_model):
    def make(motion: str = "walk", **settings) -> MotionDriver:
        return MotionDriver(MotionOptions(motion=motion, size=(96, 128), **settings))

    return make


@pytest.mark.parametrize("motion", list(MOTIONS))
def test_every_motion_is_a_smooth_loop_inside_the_picture(driver, motion):
    made = driver(motion, frame_count=40)
    frames = [made.iuv(index) for index in range(40)]
    seen = np.stack([frame[..., 0] > 0 for frame in frames])
    assert not seen[:, 0].any() and not seen[:, -1].any()
    assert not seen[:, :, 0].any() and not seen[:, :, -1].any()
    change = [(a != b).mean() for a, b in zip(seen, np.roll(seen, -1, 0), strict=True)]
    assert change[-1] <= 1.5 * max(change[:-1])  # from the last frame back to the first
    assert max(change) > 0


def test_a_loop_keeps_its_pace_at_any_length_and_rate(driver):
    natural = driver("walk").frame_count
    assert driver("walk", frame_rate=Fraction(60)).frame_count == pytest.approx(2 * natural, abs=1)
    twice = driver("walk", frame_count=2 * natural)
    assert np.array_equal(twice.iuv(3), twice.iuv(natural + 3))


def test_the_camera_and_the_body_follow_the_options(driver):
    front, side = driver(azimuth=0), driver(azimuth=90)
    assert (front.iuv(0)[..., 0] == 2).sum() > 2 * (side.iuv(0)[..., 0] == 2).sum()
    whole, upper = driver(), driver(framing="upper")
    assert (whole.iuv(0)[..., 0] == 5).any() and not (upper.iuv(0)[..., 0] == 5).any()
    thin, heavy = (driver(shape=Shape(weight=weight)) for weight in (0.1, 0.9))
    assert (heavy.iuv(0)[..., 0] > 0).sum() > 1.05 * (thin.iuv(0)[..., 0] > 0).sum()


@pytest.mark.parametrize("name", ["walk", "walk.mkv"])
def test_a_recording_is_read_back_as_it_was_made(body_model, tmp_path, name):
    options = MotionOptions(
        motion="walk", size=(96, 128), frame_count=5, frame_rate=Fraction(30000, 1001)
    )
    made = record_motion(options, tmp_path / name)
    stream = open_stream(tmp_path / name)
    reader = open_reader(stream)
    assert reader.order == "vui"
    assert [frame.tolist() for frame in reader.read(0, 5)] == [
        made.iuv(index).tolist() for index in range(5)
    ]
    if name.endswith("mkv"):
        assert stream.frame_rate == Fraction(30000, 1001)


def test_a_recording_replaces_only_when_told_and_is_whole_or_absent(
    body_model, tmp_path, monkeypatch
):
    options = MotionOptions(motion="wave", size=(64, 64), frame_count=2)
    record_motion(options, tmp_path / "a.mkv")
    with pytest.raises(OutputError, match="--force"):
        record_motion(options, tmp_path / "a.mkv")
    record_motion(options, tmp_path / "a.mkv", force=True)
    with pytest.raises(OutputError, match=r"a folder of PNG .* or a lossless .mkv"):
        record_motion(options, tmp_path / "a.mp4")

    def broken(_self: MotionDriver, index: int) -> np.ndarray:
        raise KeyboardInterrupt

    monkeypatch.setattr(MotionDriver, "iuv", broken)
    with pytest.raises(KeyboardInterrupt):
        record_motion(options, tmp_path / "b")
    assert [path.name for path in tmp_path.iterdir()] == ["a.mkv"]


def test_a_motion_is_opened_wherever_a_driver_is(body_model):
    path = Path("people:wave,frames=4,fps=25,size=48x64,gender=1,azimuth=20,framing=upper")
    assert is_motion(path) and not is_motion(Path("people/walk.mkv"))
    stream = open_motion(path)
    assert (stream.frame_count, stream.frame_rate) == (4, 25)
    frames = list(open_reader(stream).read(1, 3))
    assert [frame.shape for frame in frames] == [(64, 48, 3)] * 2


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("people:moonwalk", "unknown motion 'moonwalk'; supported are walk, turntable, dance"),
        ("people:none.bvh", "motion none.bvh does not exist"),
        ("people:walk,frames=many", "'frames=many' has no number"),
        ("people:walk,speed=2", "unknown setting 'speed'; supported are frames, fps, size"),
        ("people:walk,size=12", "size '12'; write WIDTHxHEIGHT"),
        ("people:walk,size=8x8", "size 8x8; each side"),
        ("people:walk,frames=0", "frames is 0"),
        ("people:walk,gender=2", "gender is 2.0; it must lie in 0..1"),
        ("people:walk,framing=feet", "supported are full, three-quarters, upper"),
        ("people:walk,elevation=90", "elevation is 90.0 degrees"),
        ("people:walk,distance=0", "distance is 0.0 m"),
    ],
)
def test_bad_motions_are_refused(spec, message):
    with pytest.raises(InputError, match=message):
        open_motion(Path(spec))
