"""IUV or pictures: told from what the frames look like."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from skimage import data

from motion_transfer.errors import InputError
from motion_transfer.media.driver_kind import kind_of, tell_kind

PHOTOS = ("astronaut", "coffee", "rocket", "chelsea")


@pytest.mark.parametrize("name", PHOTOS)
def test_photos_are_pictures(name: str) -> None:
    photo = getattr(data, name)()
    assert kind_of(photo) == "pictures"
    assert kind_of(photo // 3) == "pictures"


@pytest.mark.parametrize("order", ["iuv", "vui"])
def test_iuv_is_iuv(studio, order: str) -> None:
    iuv = studio.iuv()
    assert kind_of(iuv if order == "iuv" else iuv[..., ::-1]) == "iuv"
    scaled = iuv.copy()
    scaled[iuv[..., 0] == 0, 1:] = 77
    assert kind_of(scaled) == "iuv"  # to be refused by those who read IUV


def test_a_dark_corner_is_no_iuv() -> None:
    """Little blue in it, and nothing black: no IUV, but no clear picture either."""
    corner = data.coffee()[:96, :128] // 2
    assert kind_of(corner) is None
    assert kind_of(corner + 60) == "pictures"


def test_what_is_too_dark_says_nothing() -> None:
    assert kind_of(np.zeros((9, 9, 3), np.uint8)) is None
    assert kind_of(np.full((9, 9, 3), 12, np.uint8)) is None


@pytest.mark.parametrize("order", ["iuv", "vui"])
def test_videos(studio, order: str) -> None:
    lossy = {"codec": "libx264", "pixels": "yuv420p"}
    assert tell_kind(studio.video(order=order)) == "iuv"
    assert tell_kind(studio.video(name="a.mp4", order=order, **lossy)) == "iuv"
    photo = data.astronaut()[:200, :300]
    clip = np.stack([np.zeros_like(photo)] * 5 + [photo // 9, photo // 2, photo])
    assert tell_kind(studio.video(clip, name="b.mp4", **lossy)) == "pictures"
    assert tell_kind(studio.video(clip, name="b.mkv")) == "pictures"


def test_folders_and_files(studio, tmp_path: Path) -> None:
    assert tell_kind(studio.driver(2)) == "iuv"
    assert tell_kind(studio.array(2)) == "iuv"
    assert tell_kind(studio.image("plain.png", studio.iuv())) == "iuv"
    assert tell_kind(studio.image("iuv.jpg", studio.iuv())) == "iuv"
    for suffix in ("png", "jpg"):
        folder = tmp_path / suffix
        folder.mkdir()
        Image.fromarray(data.coffee()).save(folder / f"0.{suffix}")
        assert tell_kind(folder) == "pictures"
        assert tell_kind(folder / f"0.{suffix}") == "pictures"
    studio.image("png/0_IUV.png", studio.iuv())
    assert tell_kind(tmp_path / "png") == "iuv"


def test_nothing_at_all_is_left_to_the_readers_of_iuv(tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("words")
    (tmp_path / "half.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "empty").mkdir()
    for name in ("words.txt", "half.png", "empty", "gone"):
        assert tell_kind(tmp_path / name) == "iuv"


def test_doubt_names_the_option_that_ends_it(studio) -> None:
    dark = studio.image("dark.png", np.full((9, 9, 3), 12, np.uint8))
    with pytest.raises(InputError, match="--driver-kind iuv or pictures"):
        tell_kind(dark)
