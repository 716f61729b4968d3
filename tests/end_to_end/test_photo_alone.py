"""The real thing: people in photos and clips, by BlazePose and the network that ships."""

from __future__ import annotations

from fractions import Fraction
from importlib.resources import files
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from PIL import Image
from skimage import data

from motion_transfer.errors import InputError
from motion_transfer.estimate.models import MODEL_FILES, find_model
from motion_transfer.media.iuv.opening import read_single_iuv
from motion_transfer.training.iuv.trainer import OTHER_SIDE, score_iuv
from nhrr_core.parts import PART_NAMES

ASTRONAUT = Path(str(files("motion_transfer.demo") / "astronaut.jpg"))
FACE = (slice(60, 130), slice(185, 260))
CHEST = (slice(260, 400), slice(120, 280))
MAN = (slice(170, 460), slice(170, 290))
"""Rows and columns of one person of DensePose's street."""


@pytest.fixture(scope="module", autouse=True)
def models() -> None:
    """BlazePose's files are fetched once a machine."""
    try:
        for file in MODEL_FILES:
            find_model(file)
    except InputError as error:
        pytest.skip(str(error))


def estimate(mt, photo: Path, output: Path) -> np.ndarray:
    outcome = mt("iuv", photo, "-o", output, "--person", "largest", "-q")
    assert outcome.code == 0, outcome.err
    iuv = read_single_iuv(output, None, "result")
    assert iuv is not None
    return iuv


def parts_of(word: str) -> list[int]:
    return [index for index, name in enumerate(PART_NAMES) if word in name.split("-")]


@pytest.fixture(scope="module")
def astronaut_iuv(models, tmp_path_factory) -> np.ndarray:
    from motion_transfer.cli.main import main

    output = tmp_path_factory.mktemp("iuv") / "astronaut_IUV.png"
    assert main(["iuv", str(ASTRONAUT), "-o", str(output), "-q"]) == 0
    iuv = read_single_iuv(output, None, "result")
    assert iuv is not None
    return iuv


def test_a_portrait_has_its_parts_where_they_are(astronaut_iuv: np.ndarray) -> None:
    part = astronaut_iuv[..., 0]
    assert np.isin(part[FACE], parts_of("head")).mean() > 0.95
    assert (part[CHEST] == PART_NAMES.index("torso-front")).mean() > 0.8
    assert (part == PART_NAMES.index("torso-back")).sum() < 0.02 * (part > 0).sum()
    assert 0.3 < (part > 0).mean() < 0.6
    assert not part[:200, 330:].any()  # the shuttle behind her


def test_a_person_who_faces_us_has_her_left_on_our_right(astronaut_iuv: np.ndarray) -> None:
    part = astronaut_iuv[..., 0]
    left, right = (np.isin(part, parts_of(side)) for side in ("left", "right"))
    assert np.nonzero(left)[1].mean() > np.nonzero(right)[1].mean() + 60


def test_a_mirrored_person_has_mirrored_parts(
    mt, tmp_path: Path, astronaut_iuv: np.ndarray
) -> None:
    photo = tmp_path / "mirrored.png"
    Image.fromarray(np.asarray(Image.open(ASTRONAUT))[:, ::-1]).save(photo)
    mirrored = estimate(mt, photo, tmp_path / "iuv.png")[:, ::-1, 0]
    part = astronaut_iuv[..., 0]
    both = (part > 0) & (mirrored > 0)
    assert both.sum() > 0.9 * (part > 0).sum()
    assert (OTHER_SIDE[mirrored[both]] == part[both]).mean() > 0.8


@pytest.mark.parametrize("name", ["rocket", "chelsea", "black", "pixel"])
def test_pictures_of_nobody_are_said_to_be_that(mt, tmp_path: Path, name: str) -> None:
    made = {"black": np.zeros((240, 320, 3), np.uint8), "pixel": np.full((1, 1, 3), 99, np.uint8)}
    picture = made.get(name)
    photo = tmp_path / f"{name}.png"
    Image.fromarray(getattr(data, name)() if picture is None else picture).save(photo)
    outcome = mt("iuv", photo, "-o", tmp_path / "iuv.png")
    assert outcome.code == 2
    assert "nobody was found" in outcome.err
    assert not (tmp_path / "iuv.png").exists()


def film_of_the_astronaut(path: Path, count: int) -> Path:
    """She moves across a grey room, at a rate with a fraction."""
    rgb = cv2.resize(np.asarray(Image.open(ASTRONAUT)), (240, 240), interpolation=cv2.INTER_AREA)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=Fraction(24000, 1001))
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        for index in range(count):
            frame = np.full((240, 320, 3), 190, np.uint8)
            left = 10 + 4 * index
            frame[:, left : left + 240] = rgb
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("fitted", [False, True])
def test_a_photo_and_a_clip_are_enough(mt, tmp_path: Path, fitted: bool) -> None:
    clip, output = film_of_the_astronaut(tmp_path / "clip.mp4", 9), tmp_path / "out.mkv"
    words = ["run", "--source", ASTRONAUT, "--driver", clip, "-o", output, "--codec", "ffv1"]
    words += ["--renderer", "texture", "-q", *(["--fit-body"] if fitted else [])]
    outcome = mt(*words)
    assert outcome.code == 0, outcome.err
    with av.open(str(output)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == Fraction(24000, 1001)
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
    assert len(frames) == 9
    drawn = [(frame != 255).any(-1) for frame in frames]
    middles = [np.nonzero(mask)[1].mean() for mask in drawn]
    assert 20 < middles[-1] - middles[0] < 44  # she moves 32 pixels
    red, green, blue = frames[0][130:180, 70:140].reshape(-1, 3).mean(0)  # her orange suit
    assert red > green + 30
    assert red > blue + 30


def test_the_demo_needs_nothing_but_a_photo(mt, tmp_path: Path, few_frames: int) -> None:
    outcome = mt("demo", "--photo-alone", "-o", tmp_path / "a.mp4", "--plain", "-q")
    assert outcome.code == 0, outcome.err
    with av.open(str(tmp_path / "a.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == few_frames
    assert all(0.1 < (frame < 200).any(-1).mean() < 0.7 for frame in frames)


def real_photos(samples: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Name -> photo and DensePose's own IUV."""
    found = {}
    for file in sorted((samples / "deepfashion").glob("*_iuv.png")):
        photo = file.with_name(file.name.replace("_iuv", ""))
        if photo.exists():
            pair = (np.asarray(Image.open(f).convert("RGB")) for f in (photo, file))
            found[file.stem] = tuple(pair)
    street = np.asarray(Image.open(samples / "densepose_demo/demo_im.jpg").convert("RGB"))
    iuv = np.asarray(Image.open(samples / "densepose_demo/demo_im_IUV.png").convert("RGB"))
    found["man"] = street[MAN], iuv[..., ::-1][MAN]
    return found


def test_real_people_look_as_densepose_sees_them(mt, tmp_path: Path, samples: Path) -> None:
    scores = []
    for name, (photo, true) in real_photos(samples).items():
        Image.fromarray(photo).save(tmp_path / f"{name}.png")
        found = estimate(mt, tmp_path / f"{name}.png", tmp_path / "out" / f"{name}_IUV.png")
        scores.append(score_iuv(found, true))
        assert scores[-1].part_agreement > 0.8, name
        assert scores[-1].swapped < 0.03, name
        assert scores[-1].turned < 0.02, name  # slivers beside the arms
    assert len(scores) >= 3
    assert np.mean([score.part_agreement for score in scores]) > 0.86
    assert np.mean([score.uv_error for score in scores]) < 0.06
    assert np.mean([score.iou for score in scores]) > 0.87


def test_the_preview_of_a_clip_shows_its_pictures(tmp_path: Path) -> None:
    from motion_transfer.preview.session import Session
    from motion_transfer.preview.state import describe
    from motion_transfer.render.options import RenderOptions

    clip = film_of_the_astronaut(tmp_path / "clip.mp4", 5)
    options = RenderOptions(
        source=(ASTRONAUT,), driver=clip, output=tmp_path / "out.mp4", renderer="texture"
    )
    session = Session(options, tmp_path / "home", tmp_path / "job.yaml")
    try:
        session.wait_for_plan()
        assert describe(session)["driver"]["pictures"]
        shown = {
            view: cv2.imdecode(
                np.frombuffer(session.ask_frame(3, view, session.key).result(), np.uint8),
                cv2.IMREAD_COLOR,
            )
            for view in ("pictures", "result")
        }
        assert shown["pictures"].shape == shown["result"].shape == (240, 320, 3)
        assert np.abs(shown["pictures"][:, :20].astype(int) - 190).max() < 20  # the grey room
        with pytest.raises(InputError, match="start again with --driver-person 0"):
            session.change({"driver_person": "0"})
    finally:
        session.close()
