"""Photos: upright, with their alpha, in any depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from motion_transfer.errors import InputError
from motion_transfer.media.pictures.photo import read_photo, write_png

PICTURE = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)


@pytest.mark.parametrize(
    ("orientation", "turn"),
    [
        (1, lambda pixels: pixels),
        (3, lambda pixels: pixels[::-1, ::-1]),
        (6, lambda pixels: np.rot90(pixels, -1)),
        (8, lambda pixels: np.rot90(pixels)),
    ],
)
def test_exif_orientation_is_applied(tmp_path: Path, orientation: int, turn) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(PICTURE).save(tmp_path / "photo.png", exif=exif)
    photo = read_photo(tmp_path / "photo.png")
    np.testing.assert_array_equal(photo.rgb, turn(PICTURE))
    assert photo.turned == (orientation != 1)


def test_alpha_is_kept_apart(tmp_path: Path) -> None:
    alpha = np.full((4, 6, 1), 7, np.uint8)
    Image.fromarray(np.concatenate([PICTURE, alpha], 2)).save(tmp_path / "photo.png")
    photo = read_photo(tmp_path / "photo.png")
    np.testing.assert_array_equal(photo.rgb, PICTURE)
    assert photo.alpha is not None
    assert (photo.alpha == 7).all()


def test_a_transparent_palette_colour_is_alpha(tmp_path: Path) -> None:
    image = Image.fromarray(np.array([[0, 1]], np.uint8)).convert("P")
    image.putpalette([10, 20, 30, 40, 50, 60])
    image.save(tmp_path / "photo.png", transparency=1)
    photo = read_photo(tmp_path / "photo.png")
    assert photo.alpha is not None
    assert photo.alpha.tolist() == [[255, 0]]
    assert photo.rgb[0, 0].tolist() == [10, 20, 30]


@pytest.mark.parametrize(
    ("pixels", "grey"),
    [
        (np.array([[0, 128, 255]], np.uint8), [0, 128, 255]),
        (np.array([[0, 0x80FF, 0xFFFF]], np.uint16), [0, 0x80, 0xFF]),
    ],
    ids=["8 bit", "16 bit"],
)
def test_grey_photos_become_rgb(tmp_path: Path, pixels: np.ndarray, grey: list[int]) -> None:
    Image.fromarray(pixels).save(tmp_path / "photo.png")
    photo = read_photo(tmp_path / "photo.png")
    assert photo.rgb.tolist() == [[[value] * 3 for value in grey]]


def test_jpeg_is_read(tmp_path: Path) -> None:
    Image.new("RGB", (16, 8), (200, 40, 40)).save(tmp_path / "photo.jpg", quality=95)
    photo = read_photo(tmp_path / "photo.jpg")
    assert photo.rgb.shape == (8, 16, 3)
    assert photo.alpha is None
    assert np.abs(photo.rgb.astype(int) - (200, 40, 40)).max() <= 3


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    write_png(tmp_path / "picture.png", PICTURE)
    np.testing.assert_array_equal(read_photo(tmp_path / "picture.png").rgb, PICTURE)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "source .* does not exist"),
        (b"", "not a picture"),
        (b"just words", "not a picture"),
        ("half", "damaged: .*save it again"),
        ("folder", "is a folder; name a file in it"),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path: Path, content, reason: str) -> None:
    path = tmp_path / "photo.png"
    if content == "folder":
        path.mkdir()
    elif content == "half":
        noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
        Image.fromarray(noise).save(path)
        path.write_bytes(path.read_bytes()[:5000])
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=reason):
        read_photo(path)
