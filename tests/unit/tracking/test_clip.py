"""A clip's landmarks as one motion: cuts, gaps, windows, the floor, and the way to a BVH file."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("anny")

from tracking_clips import CAMERA, Known, clip

from motion_transfer.errors import InputError, OutputError
from motion_transfer.estimate.interface import Landmarks
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.people.driver import MotionDriver, MotionOptions
from motion_transfer.people.figure.body import load_body_model
from motion_transfer.people.figure.charts import load_charts, render_iuv
from motion_transfer.tracking import TrackOptions, track_motion
from motion_transfer.tracking import clip as clips
from motion_transfer.tracking.clip import Track, fit_track
from motion_transfer.tracking.puppet import Puppet

SIZE = (CAMERA.width, CAMERA.height)
RATE = Fraction(30)


def fit(marks: list[Landmarks | None], starts: list[int] | None = None) -> Track:
    model = load_body_model()
    return fit_track(Puppet(model.template, model), marks, starts or [0], SIZE, RATE)


def turns(track: Track) -> np.ndarray:
    return track.postures.pelvis @ track.postures.arm[:, 0]


def test_a_cut_is_not_smoothed_across() -> None:
    jacks, turning = clip("jumping-jacks", 20)[2], clip("turntable", 90)[2][70:]
    track = fit(jacks + turning, [0, 20])
    assert [shot.frames for shot in track.shots] == [range(20), range(20, 40)]
    alone = turns(fit(jacks)), turns(fit(turning))
    assert turns(track)[:20] == pytest.approx(alone[0], abs=1e-9)
    assert turns(track)[20:] == pytest.approx(alone[1], abs=1e-9)
    joined = turns(fit(jacks + turning))
    assert np.abs(joined[:20] - alone[0]).max() > 0.05  # without the cut it would be


def test_frames_without_anybody_are_filled_in() -> None:
    marks = clip("walk", 30)[2]
    whole = fit(marks)
    gaps: list[Landmarks | None] = [
        None if i < 3 or 12 <= i < 15 else m for i, m in enumerate(marks)
    ]
    track = fit(gaps)
    assert track.unseen == [(0, 3), (12, 15)]
    assert len(track) == 30
    assert track.postures.pelvis[0] == pytest.approx(track.postures.pelvis[3])
    between = np.abs(track.postures.knee - whole.postures.knee)[12:15]
    assert np.degrees(between).max() < 15


def test_a_shot_that_shows_nobody_holds_the_one_before() -> None:
    marks = clip("walk", 10)[2]
    track = fit([*marks, None, None, None, *marks], [0, 10, 13])
    assert track.unseen == [(10, 13)]
    assert track.postures.knee[10:13] == pytest.approx(np.tile(track.postures.knee[9], (3, 1)))


def test_windows_of_long_clips_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    marks = clip("dance", 120)[2]
    whole = fit(marks)
    monkeypatch.setattr(clips, "WINDOW", 60)
    monkeypatch.setattr(clips, "OVERLAP", 20)
    parts = fit(marks)
    assert np.abs(turns(parts) - turns(whole)).max() < 0.15
    assert np.abs(np.diff(parts.postures.place, axis=0)).max() < 0.1


def test_the_body_lies_over_the_picture() -> None:
    model = load_body_model()
    _, bodies, marks = clip("walk", 20)
    track = fit(marks)
    for frame in (0, 10, 19):
        mine = track.iuv(frame, model)[..., 0]
        true = render_iuv(bodies[frame].points, model.faces, load_charts(), CAMERA)[..., 0]
        both = (mine > 0) & (true > 0)
        assert both.sum() > 0.93 * ((mine > 0) | (true > 0)).sum()
        assert (mine == true)[both].mean() > 0.93


def test_the_body_stands_on_the_floor_upright() -> None:
    model = load_body_model()
    track = fit(clip("walk", 30)[2])
    lowest, rise = [], []
    for frame in range(len(track)):
        transforms = track.body.transforms(*track.bones(frame))
        lowest.append(model.pose(track.body, transforms)[:, 2].min())
        joints = track.body.posed_joints(transforms)
        index = track.body.skeleton.index
        rise.append(joints[index["head"]] - joints[index["root"]])
    assert np.abs(np.median(lowest)) < 0.02
    up = np.mean(rise, axis=0)
    assert np.degrees(np.arccos(up[2] / np.linalg.norm(up))) < 8


def photos(folder: Path, count: int) -> Path:
    folder.mkdir()
    for index in range(count):
        write_png(folder / f"{index:03d}.png", np.full((64, 64, 3), 90, np.uint8))
    return folder


def test_a_clip_becomes_a_driver(tmp_path: Path) -> None:
    marks = clip("walk", 12)[2]
    options = TrackOptions(source=photos(tmp_path / "clip", 12), output=tmp_path / "walk.bvh")
    told: list[tuple[int, int]] = []
    track = track_motion(options, lambda *counts: told.append(counts), estimator=Known(marks))
    assert len(track) == 12
    assert told == [(1, 12)] * 12
    driver = MotionDriver(MotionOptions(motion=str(options.output), size=(64, 96), azimuth=90))
    assert driver.frame_count == 12
    pixels = np.bincount(driver.iuv(6)[..., 0].ravel(), minlength=25)
    # from the person's left: its left arm, and the left of its head rather than the right
    assert pixels[15] > 0
    assert pixels[24] > 3 * pixels[23]


def test_nobody_is_told_of(tmp_path: Path) -> None:
    source = photos(tmp_path / "clip", 3)
    options = TrackOptions(source=source, output=tmp_path / "walk.bvh")
    with pytest.raises(InputError, match="nobody found"):
        track_motion(options, estimator=Known([None] * 3))
    assert not options.output.exists()


def test_an_output_that_is_there_stays(tmp_path: Path) -> None:
    output = tmp_path / "walk.bvh"
    output.write_text("mine")
    options = TrackOptions(source=photos(tmp_path / "clip", 2), output=output)
    with pytest.raises(OutputError, match="exists already"):
        track_motion(options, estimator=Known([None] * 2))
    assert output.read_text() == "mine"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"output": Path("a.fbx")}, r"a motion is a \.bvh file"),
        ({"person": "all"}, "one person's"),
        ({"person": "tallest"}, "tallest"),
        ({"estimator": "densepose"}, "give landmarks are blazepose and blazepose-heavy"),
    ],
)
def test_wrong_options_are_refused(wrong: dict, message: str) -> None:
    right: dict = {"source": Path("clip.mp4"), "output": Path("a.bvh")}
    with pytest.raises((InputError, OutputError), match=message):
        TrackOptions(**(right | wrong))
