"""Good runs through the real command: what comes out has the right frames, time and colours."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

WHITE, GREY = (255, 255, 255), (120, 120, 120)
TORSO, LEGS, ARMS, HEAD = (2,), (9, 10, 13, 14), (15, 16, 19, 20), (23, 24)
CLOTHES = {TORSO: (200, 40, 40), LEGS: (30, 60, 160), ARMS: (40, 160, 60), HEAD: (220, 180, 40)}


def frames_of(path: Path) -> np.ndarray:
    if path.is_dir():
        return np.stack([np.asarray(Image.open(file)) for file in sorted(path.iterdir())])
    if path.suffix == ".png":
        return np.asarray(Image.open(path))[None]
    with av.open(str(path)) as container:
        space = {} if path.suffix in (".gif", ".ffv1") else {"src_colorspace": "ITU709"}
        frames = container.decode(video=0)
        return np.stack([f.reformat(format="rgb24", **space).to_ndarray() for f in frames])


def assert_dressed(frames: np.ndarray, iuv: np.ndarray, atol: float) -> None:
    """Every limb of every frame has its colour, and what is far from the person is white."""
    assert frames.shape == iuv.shape
    for frame, pose in zip(frames, iuv, strict=True):
        for parts, colour in CLOTHES.items():
            median = np.median(frame[np.isin(pose[..., 0], parts)], axis=0)
            np.testing.assert_allclose(median, colour, atol=atol)
        np.testing.assert_allclose(frame[:, :4].mean(axis=(0, 1)), 255, atol=atol)


OUTPUTS = [
    ("out.mp4", [], 5),
    ("out.mov", ["--codec", "h265"], 5),
    ("out.mkv", ["--codec", "ffv1"], 0.5),
    ("out.mkv", ["--codec", "av1"], 6),
    ("out.webm", [], 6),
    ("out.gif", [], 6),
    ("out", [], 0.5),
]


@pytest.mark.parametrize(("name", "more", "atol"), OUTPUTS)
def test_every_output_shows_the_person(studio, draft, name: str, more: list, atol: float) -> None:
    output = studio.folder / name
    result = draft("--source", studio.source(), "--driver", studio.driver(4), "-o", output, *more)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"wrote {output}: 4 frames, 0.13 s (texture renderer")
    assert_dressed(frames_of(output), studio.walk(4), atol)


@pytest.mark.parametrize("kind", ["driver", "video", "array"])
@pytest.mark.parametrize("order", ["iuv", "vui"])
def test_every_driver_gives_the_same_frames(studio, draft, kind: str, order: str) -> None:
    frames = studio.walk(3)
    if kind == "array":
        driver = studio.array(frames if order == "iuv" else frames[..., ::-1])
    else:
        driver = getattr(studio, kind)(frames, order=order)
    output = studio.folder / "out"
    assert draft("--source", studio.source(), "--driver", driver, "-o", output).code == 0
    assert_dressed(frames_of(output), frames, 0.5)


@pytest.mark.parametrize(
    ("more", "rate"),
    [
        ([], Fraction(30000, 1001)),
        (["--fps", "25"], Fraction(25)),
        (["--fps", "24000/1001"], Fraction(24000, 1001)),
    ],
)
def test_rate_and_length(studio, draft, more: list, rate: Fraction) -> None:
    output = studio.folder / "out.mp4"
    source, driver = studio.source(), studio.video(60)
    assert draft("--source", source, "--driver", driver, "-o", output, *more).code == 0
    with av.open(str(output)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == rate
        assert stream.frames == 60
        assert stream.start_time == 0
        assert float(stream.duration * stream.time_base) == pytest.approx(float(60 / rate))


def test_a_range_of_frames(studio, draft) -> None:
    frames = studio.walk(60)
    source, driver, output = studio.source(), studio.driver(frames), studio.folder / "out"
    assert draft(*("--source", source, "--driver", driver, "-o", output, "--frames", "10:50"))
    assert_dressed(frames_of(output), frames[10:50], 0.5)


def test_one_frame_as_a_picture(studio, draft) -> None:
    frames = studio.walk(5)
    source, driver, output = studio.source(), studio.driver(frames), studio.folder / "out.png"
    draft("--source", source, "--driver", driver, "-o", output, "--frames", "3")
    assert_dressed(frames_of(output), frames[3:4], 0.5)


def test_odd_frames_are_grown_by_a_pixel(studio, draft) -> None:
    frames = np.pad(studio.walk(3), ((0, 0), (0, 1), (0, 1), (0, 0)))
    source, driver, output = studio.source(), studio.array(frames), studio.folder / "out.mp4"
    result = draft("--source", source, "--driver", driver, "-o", output, "--size", "even")
    assert result.code == 0
    assert_dressed(frames_of(output), np.pad(frames, ((0, 0), (0, 1), (0, 1), (0, 0))), 5)


def test_a_crop_shows_the_window(studio, draft) -> None:
    frames = np.stack([studio.iuv(300, 200, size=(400, 500))] * 2)
    source, driver, output = studio.source(), studio.array(frames), studio.folder / "out"
    draft("--source", source, "--driver", driver, "-o", output, "--size", "crop")
    side = frames_of(output).shape[1]
    assert side == 104  # the least multiple of 8 with a margin on both sides
    centre = frames_of(output)[0, side // 2 - 16, side // 2]
    np.testing.assert_allclose(centre, CLOTHES[TORSO], atol=1)


def test_frames_without_anybody_are_background_and_noted(studio, draft) -> None:
    frames = studio.walk(6)
    frames[2:4] = 0
    source, driver, output = studio.source(), studio.driver(frames), studio.folder / "out"
    result = draft(
        *("--source", source, "--driver", driver, "-o", output),
        *("--background", "#102030"),
    )
    assert result.code == 0
    assert result.err == (
        "mt: note: nobody found in 2 of 6 frames, background only: 0:00.07-0:00.13 (frames 2:4)\n"
    )
    rendered = frames_of(output)
    assert (rendered[2:4] == (16, 32, 48)).all()
    assert (rendered[[0, 1, 4, 5]] != (16, 32, 48)).any(axis=(1, 2, 3)).all()


def test_frames_without_anybody_can_be_held(studio, draft) -> None:
    """Chunks begin at 48: there the frame to repeat is read from the chunk before."""
    frames = studio.walk(50)
    frames[[0, 20, 47, 48, 49]] = 0
    source, driver, output = studio.source(), studio.driver(frames), studio.folder / "out"
    result = draft(*("--source", source, "--driver", driver, "-o", output, "--missing", "hold"))
    assert result.code == 0
    assert "nobody found in 5 of 50 frames, the frame before: 0:00.00-0:00.03" in result.err
    rendered = frames_of(output)
    for held, shown in ((0, 1), (20, 19), (47, 46), (48, 46), (49, 46)):
        np.testing.assert_array_equal(rendered[held], rendered[shown])
    assert (rendered[48] != 255).any()


def test_frames_without_anybody_can_be_refused(studio, draft) -> None:
    frames = studio.walk(6)
    frames[3] = 0
    source, driver, output = studio.source(), studio.driver(frames), studio.folder / "out"
    result = draft(*("--source", source, "--driver", driver, "-o", output, "--missing", "fail"))
    assert result.code == 2
    assert "nobody at 0:00.10-0:00.13 (frames 3:4); choose" in result.err
    assert not output.exists()


def test_a_held_gap_is_noted_and_repeats(studio, draft) -> None:
    source, driver, output = studio.source(), studio.driver(6), studio.folder / "out"
    (driver / "frame_3_IUV.png").unlink()
    result = draft(*("--source", source, "--driver", driver, "-o", output, "--missing", "hold"))
    assert result.code == 0
    assert "mt: note: 1 missing frame" in result.err
    rendered = frames_of(output)
    assert len(rendered) == 6
    np.testing.assert_array_equal(rendered[3], rendered[2])


def test_only_the_chosen_person_of_a_driver_is_rendered(studio, draft) -> None:
    pair = np.concatenate([studio.walk(3), studio.walk(3)], axis=2)
    source, driver, output = studio.source(), studio.array(pair), studio.folder / "out"
    draft("--source", source, "--driver", driver, "-o", output, "--driver-person", "1")
    rendered = frames_of(output)
    assert (rendered[:, :, :64] == 255).all()
    assert_dressed(rendered[:, :, 64:], studio.walk(3), 0.5)


def test_the_photo_as_background_in_place(studio, draft) -> None:
    """The source's own IUV as driver: the person is drawn over the untouched photo."""
    source = studio.source()
    iuv, output = studio.folder / "person_IUV.png", studio.folder / "out.png"
    draft("--source", source, "--driver", iuv, "-o", output, "--background", "photo")
    difference = frames_of(output)[0].astype(int) - np.asarray(Image.open(source))
    assert np.abs(difference).mean() < 1
    outside = np.asarray(Image.open(iuv))[..., 0] == 0
    assert np.abs(difference[outside]).max() <= 2


def test_the_photo_as_background_loses_its_person(studio, draft) -> None:
    source, driver = studio.source(), studio.array(np.stack([studio.iuv(40, size=(96, 128))]))
    output = studio.folder / "out.png"
    draft("--source", source, "--driver", driver, "-o", output, "--background", "photo")
    frame = frames_of(output)[0]
    np.testing.assert_allclose(frame[:, :50].astype(int) - GREY, 0, atol=8)


def test_comparison_and_contact_sheet(studio, draft) -> None:
    source, driver, output = studio.source(), studio.driver(5), studio.folder / "out"
    sheet = studio.folder / "sheet.png"
    draft(
        *("--source", source, "--driver", driver, "-o", output),
        *("--compare", "--sheet", sheet),
    )
    frames = frames_of(output)
    assert frames.shape == (5, 96, 3 * 64, 3)
    photo = frames_of(source)[0, ::2, ::2]
    np.testing.assert_allclose(frames[0, :, :64].astype(int), photo, atol=2)
    assert_dressed(frames[:, :, 128:], studio.walk(5), 0.5)
    assert frames_of(sheet).shape == (1, 2 * (96 + 28) + 8, 4 * (192 + 8) + 8, 3)


def test_a_garment_in_place(studio, draft) -> None:
    """Shirt from another photo, everything else and the backdrop as they were."""
    source = studio.source()
    shirt = studio.source("shirt", colours={TORSO: (0, 200, 200), HEAD: (0, 0, 0)})
    iuv, output = studio.folder / "person_IUV.png", studio.folder / "out.png"
    result = draft(
        *("--source", source, "--driver", iuv, "-o", output, "--background", "photo"),
        *("--garment", shirt, "--garment-parts", "torso"),
    )
    assert result.code == 0
    frame, parts = frames_of(output)[0], np.asarray(Image.open(iuv))[..., 0]
    expected = {**CLOTHES, TORSO: (0, 200, 200)}
    for members, colour in expected.items():
        median = np.median(frame[np.isin(parts, members)], axis=0)
        np.testing.assert_allclose(median, colour, atol=1)
    np.testing.assert_allclose(frame[parts == 0].astype(int) - GREY, 0, atol=2)


def test_two_garments(studio, draft) -> None:
    shirt = studio.source("shirt", colours={TORSO: (0, 200, 200)})
    jeans = studio.source("jeans", colours={(*LEGS, 5, 6): (250, 0, 250)})
    frames, output = studio.walk(2), studio.folder / "out"
    draft(
        *("--source", studio.source(), "--driver", studio.array(frames), "-o", output),
        *("--garment", f"{shirt},{shirt.with_stem('shirt_IUV')}", "--garment-parts", "torso"),
        *("--garment", jeans, "--garment-parts", "upper-legs, lower-legs"),
    )
    torso = np.median(frames_of(output)[frames[..., 0] == 2], axis=0)
    legs = np.median(frames_of(output)[np.isin(frames[..., 0], LEGS)], axis=0)
    np.testing.assert_allclose([torso, legs], [(0, 200, 200), (250, 0, 250)], atol=1)


def test_the_network_renders(studio, mt, checkpoint: Path) -> None:
    source, driver, output = studio.source(), studio.driver(6), studio.folder / "out"
    result = mt(
        *("run", "--source", source, "--driver", driver, "-o", output, "--weights", checkpoint),
    )
    assert result.code == 0
    assert "(nhrr renderer" in result.out
    frames, people = frames_of(output), studio.walk(6)[..., 0] > 0
    assert frames.shape == (6, 96, 64, 3)
    assert (frames[:, :, :1] == 255).all()
    assert (frames[people] != 255).any()


def test_json_events_tell_the_whole_story(studio, draft) -> None:
    source, driver, output = studio.source(), studio.driver(5), studio.folder / "out.mp4"
    result = draft("--source", source, "--driver", driver, "-o", output, "--json")
    events = [json.loads(line) for line in result.out.splitlines()]
    assert result.err == ""
    names = [event["event"] for event in events]
    assert [name for name in names if name != "frames-done"] == [
        *("stage", "started", "stage", "finished")
    ]
    assert sum(event["frame_count"] for event in events if event["event"] == "frames-done") == 10
    assert events[-1]["output"] == str(output)
    assert (events[-1]["frame_count"], events[-1]["duration_seconds"]) == (5, pytest.approx(1 / 6))


def test_quiet_says_nothing(studio, draft) -> None:
    frames = studio.walk(3)
    frames[1] = 0
    source, output = studio.source(), studio.folder / "deep/new/out.mp4"
    result = draft("--source", source, "--driver", studio.driver(frames), "-o", output, "-q")
    assert (result.code, result.out, result.err) == (0, "", "")
    assert output.stat().st_size > 0


def test_the_shipped_demo(tmp_path: Path, mt, few_frames: int) -> None:
    result = mt("demo", "--plain", "-o", tmp_path / "demo.mkv", "--json")
    assert result.code == 0
    finished = json.loads(result.out.splitlines()[-1])
    assert len(frames_of(tmp_path / "demo.mkv")) == finished["frame_count"] == few_frames


def test_the_same_from_python(studio) -> None:
    from motion_transfer import Garment, RenderReport, render_video

    shirt = studio.source("shirt", colours={TORSO: (0, 200, 200)})
    frames, events = studio.walk(6), []
    report = render_video(
        str(studio.source()),
        str(studio.array(frames)),
        str(studio.folder / "out"),
        frames=(1, 5),
        frame_rate=30000 / 1001,
        garments=[Garment(photo=shirt, parts=(1, 2))],
        background="black",
        renderer="texture",
        listener=events.append,
    )
    assert isinstance(report, RenderReport)
    assert (report.frame_count, report.frame_rate) == (4, Fraction(30000, 1001))
    assert (report.width, report.height, report.renderer) == (64, 96, "texture")
    assert events[-1].output == report.output
    rendered = frames_of(report.output)
    np.testing.assert_allclose(
        np.median(rendered[frames[1:5, ..., 0] == 2], axis=0), (0, 200, 200), atol=1
    )
    assert (rendered[:, :, :4] == 0).all()


@pytest.mark.parametrize("frames", [(-2, None), (0, -1), "4:2"])
def test_python_refuses_what_the_command_refuses(studio, frames) -> None:
    from motion_transfer import MotionTransferError, render_video

    with pytest.raises(MotionTransferError, match="frames"):
        render_video(studio.source(), studio.driver(3), studio.folder / "out", frames=frames)
    assert not (studio.folder / "out").exists()
