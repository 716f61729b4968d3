"""Files of several pictures: every picture, in order, at its time, upright and on white."""

from __future__ import annotations

import json
import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from colour_profiles import DISPLAY_P3
from PIL import Image, features

from motion_transfer.errors import InputError
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.media.pictures.stream import PhotoStream

ANIMATED = [
    "a.png",
    "a.apng",
    "a.webp",
    pytest.param(
        "a.avif", marks=pytest.mark.skipif(not features.check("avif"), reason="Pillow lacks AVIF")
    ),
]
animated = pytest.mark.parametrize("name", ANIMATED)
SETTINGS = {".webp": {"lossless": True}, ".avif": {"quality": 100}, ".apng": {"format": "PNG"}}
STEP = 40
"""Grey levels between pictures: more than AVIF strays."""


def save(path: Path, pictures: list[Image.Image], **settings) -> Path:
    settings = SETTINGS.get(path.suffix, {}) | settings
    pictures[0].save(path, save_all=True, append_images=pictures[1:], **settings)
    return path


def grey(count: int, mode: str = "RGB") -> list[Image.Image]:
    """Pictures whose brightness says their number."""
    return [Image.new("L", (48, 32), STEP * (i + 1)).convert(mode) for i in range(count)]


def numbers(path: Path) -> list[int]:
    return [round(float(frame.mean()) / STEP) - 1 for frame in open_pictures(path).read()]


@animated
@pytest.mark.parametrize("duration", [40, 100])
def test_steady_pictures_keep_their_rate(tmp_path: Path, name: str, duration: int) -> None:
    path = save(tmp_path / name, grey(5), duration=duration)
    clip = open_pictures(path)
    assert (clip.frame_count, clip.frame_rate) == (5, Fraction(1000, duration))
    assert (clip.height, clip.width, clip.notes) == (32, 48, ())
    assert numbers(path) == [0, 1, 2, 3, 4]


@animated
def test_rounded_durations_are_steady(tmp_path: Path, name: str) -> None:
    path = save(tmp_path / name, grey(3), duration=[33, 33, 34])
    assert open_pictures(path).frame_rate == 30
    assert numbers(path) == [0, 1, 2]


@animated
@pytest.mark.parametrize(
    ("durations", "rate", "shown"),
    [
        ([100, 300], 10, [0, 1, 1, 1]),
        ([300, 100, 100, 100], 6, [0, 0, 2, 3]),
        ([400, 100, 100, 400], 5, [0, 0, 2, 3, 3]),
    ],
)
def test_varying_durations_become_their_mean(
    tmp_path: Path, name: str, durations: list[int], rate: int, shown: list[int]
) -> None:
    path = save(tmp_path / name, grey(len(durations)), duration=durations)
    clip = open_pictures(path)
    assert (clip.frame_rate, clip.frame_count) == (rate, len(shown))
    assert f"varying frame rate; it is read at its mean, {rate}" in clip.notes[0]
    assert numbers(path) == shown


@pytest.mark.parametrize("mode", ["RGB", "L", "LA", "P", "CMYK", "RGBA"])
def test_pages_have_no_times(tmp_path: Path, mode: str) -> None:
    clip = open_pictures(save(tmp_path / "a.tif", grey(4, mode)))
    assert (clip.frame_count, clip.frame_rate, clip.notes) == (4, None, ())
    levels = [float(frame.mean()) for frame in clip.read()]
    assert levels == pytest.approx([40, 80, 120, 160], abs=16)  # a palette has few greys


def test_pages_of_16_bits_are_scaled(tmp_path: Path) -> None:
    pages = [Image.fromarray(np.full((32, 48), STEP * 257 * i, np.uint16)) for i in (1, 2, 3)]
    assert numbers(save(tmp_path / "a.tif", pages)) == [0, 1, 2]


@pytest.mark.parametrize("name", ["a.png", "a.webp"])
def test_white_shows_through(tmp_path: Path, name: str) -> None:
    pictures = [Image.new("RGBA", (48, 32), (200, 0, 0, alpha)) for alpha in (255, 0)]
    opaque, clear = open_pictures(save(tmp_path / name, pictures, duration=100)).read()
    assert (opaque[0, 0].tolist(), clear[0, 0].tolist()) == ([200, 0, 0], [255, 255, 255])


@pytest.mark.parametrize("name", ["a.png", "a.webp", "a.tif"])
def test_exif_orientation_is_heeded(tmp_path: Path, name: str) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    pictures = grey(2)
    for picture in pictures:
        picture.putpixel((0, 0), (255, 255, 255))
    clip = open_pictures(save(tmp_path / name, pictures, exif=exif, duration=100))
    assert (clip.height, clip.width) == (48, 32)
    for frame in clip.read():
        assert np.argwhere(frame[..., 0] == 255).tolist() == [[0, 31]]


@pytest.mark.parametrize("name", [*ANIMATED, "a.tif"])
def test_a_single_picture_is_a_photo(tmp_path: Path, name: str) -> None:
    path = save(tmp_path / name, grey(1))
    clip = open_pictures(path)
    assert isinstance(clip, PhotoStream)
    (frame,) = clip.read()
    np.testing.assert_array_equal(frame, read_photo(path).rgb)


@animated
def test_a_photo_is_the_first_picture(tmp_path: Path, name: str) -> None:
    path = save(tmp_path / name, grey(3), duration=100)
    assert read_photo(path).rgb.mean() == pytest.approx(STEP, abs=4)


def test_a_still_for_others_is_not_part_of_an_apng(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", grey(4), duration=100, default_image=True)
    assert numbers(path) == [1, 2, 3]


def test_a_thumbnail_is_no_page(tmp_path: Path) -> None:
    thumbnail = Image.new("RGB", (12, 8))
    thumbnail.encoderinfo = {"tiffinfo": {254: 1}}
    assert numbers(save(tmp_path / "a.tif", [*grey(2), thumbnail])) == [0, 1]
    assert isinstance(open_pictures(save(tmp_path / "b.tif", [*grey(1), thumbnail])), PhotoStream)


def test_pages_need_one_size(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", [*grey(1), Image.new("RGB", (12, 8))])
    with pytest.raises(InputError, match=r"frame 1 of .*tif is 12 x 8, but the first .* 48 x 32"):
        list(open_pictures(path).read())


def test_a_broken_picture_is_named(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (4, 64, 64, 3), np.uint8)
    path = save(tmp_path / "a.tif", [Image.fromarray(picture) for picture in noise])
    data = path.read_bytes()
    pixels = struct.pack("<I", data.index(noise[2].tobytes()))
    path.write_bytes(data.replace(pixels, struct.pack("<I", len(data) - 99)))  # where they begin
    with pytest.raises(InputError, match=r"picture 2 of .*a\.tif is damaged: .*save it again"):
        open_pictures(path)


def test_a_clip_cut_in_the_middle_is_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (4, 64, 64, 3), np.uint8)
    path = save(tmp_path / "a.png", [Image.fromarray(picture) for picture in noise], duration=100)
    path.write_bytes(path.read_bytes()[:30_000])
    with pytest.raises(InputError, match=r"a\.png is truncated; save it again"):
        open_pictures(path)


@pytest.mark.parametrize("name", [*ANIMATED, "a.tif"])
def test_colours_become_srgb(tmp_path: Path, name: str) -> None:
    pictures = [Image.new("RGB", (48, 32), colour) for colour in ((200, 60, 40), (160, 160, 160))]
    clip = open_pictures(save(tmp_path / name, pictures, icc_profile=DISPLAY_P3))
    orange, grey = clip.read()
    assert orange[9, 9].tolist() == pytest.approx([217, 42, 23], abs=5)
    assert grey[9, 9].tolist() == pytest.approx([160, 160, 160], abs=5)
    assert clip.notes == ()


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_a_damaged_profile_is_told_once(tmp_path: Path, name: str) -> None:
    path = save(tmp_path / name, grey(3), icc_profile=DISPLAY_P3[:300])
    (note,) = open_pictures(path).notes
    assert note.startswith(f"the colour profile of {path} cannot be used")
    assert numbers(path) == [0, 1, 2]


def test_photos_of_phones_are_no_clips_whatever_they_are_called(tmp_path: Path) -> None:
    """Depth comes as a second picture."""
    path = tmp_path / "a.png"
    grey(1)[0].save(path, "MPO", save_all=True, append_images=grey(2)[1:], quality=100)
    assert isinstance(open_pictures(path), PhotoStream)


def test_a_gif_keeps_its_times(tmp_path: Path) -> None:
    path = save(tmp_path / "a.gif", grey(2), duration=[100, 300])
    assert (open_pictures(path).frame_rate, numbers(path)) == (10, [0, 1, 1, 1])


def test_later_pictures_tell_what_a_driver_is(studio, tmp_path: Path) -> None:
    """Clips fade in."""
    photo = Image.fromarray(np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8))
    path = save(tmp_path / "a.png", [Image.new("RGB", (64, 64)), photo], duration=100)
    assert tell_kind(path) == "pictures"


def test_inspecting_tells_how_many_there_are(mt, tmp_path: Path) -> None:
    path = save(tmp_path / "a.webp", grey(4), duration=50)
    told = json.loads(mt("inspect", path, "--json").out)
    assert (told["what"], told["frames"], told["frame rate"]) == ("picture", 4, "20 (0.20 s)")
