"""Real photos with real DensePose output, where the folder MT_SAMPLES has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from global_uv import iuv_to_global
from PIL import Image

from motion_transfer import RenderReport, render_video
from motion_transfer.drawing.person import choose_person, find_people, isolate
from motion_transfer.media.iuv.convert import ConvertOptions, convert_iuv
from motion_transfer.media.iuv.global_uv import global_to_iuv
from motion_transfer.media.iuv.image import read_raw_iuv
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.iuv.stream import decide_order, to_iuv

TORSO, LEGS = (1, 2), (7, 8, 9, 10, 11, 12, 13, 14)
DRESS = "deepfashion/fashionWOMENDressesid0000262902_3back.png"


def read_iuv(path: Path) -> np.ndarray:
    raw = read_raw_iuv(path)
    order = decide_order([("sample", raw)], "sample")
    assert order is not None
    return to_iuv(raw, order, "sample")


def pictures(report: RenderReport) -> np.ndarray:
    return np.stack([np.asarray(Image.open(file)) for file in sorted(report.output.iterdir())])


def typical_colour(picture: np.ndarray, iuv: np.ndarray, parts: tuple[int, ...]) -> np.ndarray:
    return np.median(picture[np.isin(iuv[..., 0], parts)], axis=0)


@pytest.fixture
def dress(samples: Path) -> Path:
    return samples / DRESS


def dress_colour(dress: Path) -> np.ndarray:
    iuv = read_iuv(dress.with_stem(f"{dress.stem}_iuv"))
    return typical_colour(np.asarray(Image.open(dress).convert("RGB")), iuv, TORSO)


def test_the_dress_walks(samples: Path, dress: Path, tmp_path: Path) -> None:
    driver = samples / "drivers/walk_turn_iuv"
    report = render_video(dress, driver, tmp_path / "out", frames=(40, 46), renderer="texture")
    assert (report.frame_count, report.width, report.height) == (6, 512, 512)
    for index, picture in enumerate(pictures(report), 40):
        iuv = read_iuv(driver / f"{index:04d}_IUV.png")
        torso = typical_colour(picture, iuv, TORSO)
        np.testing.assert_allclose(torso, dress_colour(dress), atol=20)
        assert (picture[:, :8] == 255).all()


def test_the_dress_in_other_poses(samples: Path, dress: Path, tmp_path: Path) -> None:
    """A folder that holds photos and silhouettes as well: only its three IUV images are played."""
    report = render_video(dress, samples / "deepfashion", tmp_path / "out", renderer="texture")
    assert (report.frame_count, report.width, report.height) == (3, 348, 512)
    drivers = sorted((samples / "deepfashion").glob("*_iuv.png"))
    for picture, driver in zip(pictures(report), drivers, strict=True):
        torso = typical_colour(picture, read_iuv(driver), TORSO)
        np.testing.assert_allclose(torso, dress_colour(dress), atol=25)


def test_the_left_man_of_a_crowd_walks(samples: Path, tmp_path: Path) -> None:
    photo, iuv_path = (
        samples / f"densepose_demo/{name}" for name in ("demo_im.jpg", "demo_im_IUV.png")
    )
    crowd = read_iuv(iuv_path)
    man = isolate(crowd, choose_person(find_people(crowd), "0", "sample"))
    rgb = np.asarray(Image.open(photo).convert("RGB"))
    driver = samples / "drivers/walk_turn_iuv"
    report = render_video(
        photo, driver, tmp_path / "out", person="0", frames=(0, 3), renderer="texture"
    )
    for index, picture in enumerate(pictures(report)):
        iuv = read_iuv(driver / f"{index:04d}_IUV.png")
        legs = typical_colour(picture, iuv, LEGS)
        assert legs.mean() < 90  # dark trousers
        np.testing.assert_allclose(legs, typical_colour(rgb, man, LEGS), atol=25)


def test_a_real_driver_survives_every_format(samples: Path, tmp_path: Path) -> None:
    source, names = samples / "drivers/walk_turn_iuv", ("out", "out.mkv", "out.npy")
    for name, before in zip(names, (source, *(tmp_path / name for name in names)), strict=False):
        convert_iuv(ConvertOptions(source=before, output=tmp_path / name))
    first, last = (open_reader(open_stream(path)) for path in (source, tmp_path / "out.npy"))
    for frame, same in zip(first.read(0, 90), last.read(0, 90), strict=True):
        np.testing.assert_array_equal(frame, same)


@pytest.mark.parametrize(
    "name", ["drivers/walk_turn_iuv/0010_IUV.png", "densepose_demo/demo_im_IUV.png"]
)
def test_global_uv_of_real_people_gives_nearly_every_pixel_back(samples: Path, name: str) -> None:
    """What differs lies off a chart's surface, where the table repeats its rim."""
    iuv = read_iuv(samples / name)
    back, _ = global_to_iuv(iuv_to_global(iuv), "sample")
    body = iuv[..., 0] > 0
    np.testing.assert_array_equal(back[..., 0], iuv[..., 0])
    assert (back == iuv).all(-1)[body].mean() > 0.99
    np.testing.assert_allclose(
        iuv_to_global(back)[body], iuv_to_global(iuv)[body], atol=1e-6, rtol=0
    )
