"""`mt people`, and motions as drivers, as a user calls them."""

from __future__ import annotations

import av
import cv2
import numpy as np
import pytest
from decoded import decoded

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")


def test_drive_then_run(mt, draft, studio):
    driver = studio.folder / "walk.mkv"
    made = mt("people", "drive", "walk", "--frames", 6, "--size", "64x96", "-o", driver)
    assert (made.code, made.err) == (0, "")
    assert made.out == f"{driver}: 6 frames, 0.20 s of walk\n"
    video = studio.folder / "out.mp4"
    done = draft("--source", studio.source(), "--driver", driver, "-o", video, "-q")
    assert (done.code, done.err) == (0, "")
    with av.open(str(video)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 6 and frames[0].shape == (96, 64, 3)
    assert all(frame.min() < 200 for frame in frames)  # somebody is there


def test_a_motion_on_the_fly_gives_the_same_video_as_its_recording(mt, draft, studio):
    source, spec = studio.source(), "people:wave,frames=5,size=64x96"
    mt("people", "drive", "wave", "--frames", 5, "--size", "64x96", "-o", studio.folder / "iuv")
    videos = [studio.folder / name for name in ("fly.mp4", "file.mp4")]
    for driver, video in zip((spec, studio.folder / "iuv"), videos, strict=True):
        done = draft("--source", source, "--driver", driver, "-o", video, "-q")
        assert (done.code, done.err) == (0, "")
    assert decoded(videos[0]) == decoded(videos[1])


def test_render_then_run_on_one_of_them(mt, draft, studio):
    out = studio.folder / "people"
    done = mt("people", "render", "--count", 1, "--size", "96x128", "--out", out, "--workers", 1)
    assert (done.code, done.err) == (0, "")
    assert done.out == f"{out}: 1 person added, 2 photos each\n"
    again = mt("people", "render", "--count", 1, "--size", "96x128", "--out", out)
    assert again.out == f"{out}: 0 people added (1 were there), 2 photos each\n"
    picture = studio.folder / "same.png"
    person = out / "000000" / "0.png"
    run = draft("--source", person, "--driver", out / "000000" / "0_IUV.png", "-o", picture)
    assert (run.code, run.err) == (0, "")
    rendered, photo = cv2.imread(str(picture)), cv2.imread(str(person))
    body = cv2.imread(str(out / "000000" / "0_IUV.png"))[..., 0] > 0
    inside = cv2.erode(body.astype(np.uint8), np.ones((5, 5))) > 0
    assert np.abs(rendered[inside].astype(int) - photo[inside]).mean() < 20


def test_bad_input_is_one_line(mt, studio):
    for arguments, message in (
        (("drive", "moonwalk", "-o", studio.folder / "x"), "mt: unknown motion 'moonwalk'"),
        (("drive", "walk", "-o", studio.folder / "x.mp4"), "a lossless .mkv"),
        (("drive", "walk", "--size", "9", "-o", studio.folder / "x"), "WIDTHxHEIGHT"),
        (("render", "--count", 0, "--out", studio.folder / "x"), "mt: count is 0"),
    ):
        outcome = mt("people", *arguments)
        assert outcome.code == 2 and message in outcome.err, outcome
        assert outcome.err.count("\n") == 1
    assert not (studio.folder / "x").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("people", "drive", "walk", "-o", "x"),
        ("people", "render", "--count", 1, "--out", "x"),
        ("run", "--source", "a.png", "--driver", "people:walk", "-o", "x.mp4"),
    ],
)
def test_without_the_extra_the_command_that_installs_it_is_said(studio, mt, monkeypatch, arguments):
    from motion_transfer import extras

    studio.source("a")
    monkeypatch.chdir(studio.folder)
    monkeypatch.setattr(extras, "find_spec", lambda _name: None)
    outcome = mt(*arguments)
    assert outcome.code == 2
    assert "pip install 'motion-transfer[people]'" in outcome.err
    assert outcome.err.count("\n") == 1
