"""Photos: upright, in sRGB, with their alpha, in any depth."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile
from colour_profiles import (
    ADOBE_RGB,
    DISPLAY_P3,
    LINEAR_GREY,
    RED_INK,
    SRGB,
    SRGB_CURVE,
    matrix_profile,
)
from PIL import Image, ImageCms

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


def test_only_an_alpha_with_a_shape_is_a_cutout(tmp_path: Path) -> None:
    y, x = np.mgrid[:60, :40]
    disc = ((np.hypot(y - 30, x - 20) < 18) * 255).astype(np.uint8)
    window = np.zeros((60, 40), np.uint8)
    window[10:50, 5:35] = 255
    shapes = {"disc": disc, "opaque": np.full_like(disc, 255), "window": window, "clear": disc * 0}
    found = {}
    for name, alpha in shapes.items():
        Image.fromarray(np.dstack([disc, disc, disc, alpha])).save(tmp_path / f"{name}.png")
        found[name] = read_photo(tmp_path / f"{name}.png").cutout
    assert found["disc"] is not None
    assert (found["disc"] == disc).all()
    assert found["clear"] is not None, "which leaves nobody"
    assert found["opaque"] is None
    assert found["window"] is None


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
        ("half", "truncated; save it again"),
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


ORANGE = (200, 60, 40)
IN_SRGB = {"Display P3": (217, 42, 23), "Adobe RGB (1998)": (231, 57, 34)}
PROFILES = {"Display P3": DISPLAY_P3, "Adobe RGB (1998)": ADOBE_RGB}


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P"])
def test_colours_become_srgb(tmp_path: Path, name: str, mode: str) -> None:
    image = Image.new("RGB", (4, 2), ORANGE)
    if mode == "P":
        image = image.quantize(2)
    if mode == "RGBA":
        image.putalpha(77)
    image.save(tmp_path / "photo.png", icc_profile=PROFILES[name])
    photo = read_photo(tmp_path / "photo.png")
    assert photo.rgb[1, 2].tolist() == pytest.approx(list(IN_SRGB[name]), abs=2)
    assert (photo.profile, photo.notes) == (name, ())
    assert (photo.alpha is None) if mode != "RGBA" else (photo.alpha == 77).all()


def test_photos_in_srgb_keep_their_bytes(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    own = matrix_profile(
        "by another name",
        [(0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141)],
        SRGB_CURVE,
    )
    for profile in (SRGB, own):
        Image.fromarray(pixels).save(tmp_path / "photo.png", icc_profile=profile)
        photo = read_photo(tmp_path / "photo.png")
        np.testing.assert_array_equal(photo.rgb, pixels)
        assert (photo.profile, photo.notes) == (None, ())


@pytest.mark.parametrize("mode", ["L", "LA", "I;16"])
def test_greys_have_profiles_too(tmp_path: Path, mode: str) -> None:
    grey = Image.fromarray(np.full((2, 4), 0x8000, np.uint16)) if mode == "I;16" else None
    image = grey or Image.new("L", (4, 2), 128).convert(mode)
    image.save(tmp_path / "photo.png", icc_profile=LINEAR_GREY)
    photo = read_photo(tmp_path / "photo.png")
    assert photo.rgb[0, 0].tolist() == pytest.approx([188, 188, 188], abs=1)  # half the light
    assert photo.profile == "Linear grey"


@pytest.mark.parametrize("name", ["photo.jpg", "photo.tif"])
def test_ink_has_the_colour_that_its_profile_says(tmp_path: Path, name: str) -> None:
    image = Image.new("CMYK", (16, 16), (0, 0, 0, 0))
    image.paste((255, 0, 0, 0), (0, 0, 16, 8))  # without the profile: cyan
    image.save(tmp_path / name, icc_profile=RED_INK)
    photo = read_photo(tmp_path / name)
    assert photo.rgb[0, 0].tolist() == pytest.approx([255, 0, 0], abs=8)
    assert photo.rgb[15, 0].tolist() == pytest.approx([255, 255, 255], abs=3)


@pytest.mark.parametrize(
    ("mode", "profile", "reason"),
    [
        ("RGB", b"no profile at all", "it is damaged"),
        ("RGB", DISPLAY_P3[:300], "it is damaged"),
        ("RGB", RED_INK, "it is for CMYK, the picture is RGB"),
        ("RGB", LINEAR_GREY, "it is for GRAY, the picture is RGB"),
        ("CMYK", DISPLAY_P3, "it is for RGB, the picture is CMYK"),
    ],
)
def test_a_profile_that_says_nothing_is_left_out(
    tmp_path: Path, mode: str, profile: bytes, reason: str
) -> None:
    path = tmp_path / "photo.tif"
    Image.new("RGB", (4, 2), ORANGE).convert(mode).save(path, icc_profile=profile)
    photo = read_photo(path)
    assert photo.rgb[0, 0].tolist() == list(ORANGE)
    assert photo.profile is None
    assert photo.notes == (
        f"the colour profile of {path} cannot be used ({reason}); its colours are taken as sRGB",
    )


def test_lab_becomes_rgb(tmp_path: Path) -> None:
    to_lab = ImageCms.buildTransform(
        ImageCms.createProfile("sRGB"), ImageCms.createProfile("LAB"), "RGB", "LAB"
    )
    lab = ImageCms.applyTransform(Image.new("RGB", (4, 2), ORANGE), to_lab)
    assert lab is not None
    lab.save(tmp_path / "photo.tif")
    assert read_photo(tmp_path / "photo.tif").rgb[0, 0].tolist() == pytest.approx(
        list(ORANGE), abs=2
    )


@pytest.mark.parametrize("compression", [None, "zlib"])
@pytest.mark.parametrize(
    ("byteorder", "photometric", "shown"),
    [
        ("<", "minisblack", [0, 0x12, 0x80, 0xFF]),
        (">", "minisblack", [0, 0x12, 0x80, 0xFF]),
        ("<", "miniswhite", [0xFF, 0xED, 0x7F, 0]),
    ],
)
def test_16_bits_in_tiff(
    tmp_path: Path, compression: str | None, byteorder: str, photometric: str, shown: list[int]
) -> None:
    values = np.array([[0, 0x1234, 0x80FF, 0xFFFF]], np.uint16)
    path = tmp_path / "photo.tif"
    tifffile.imwrite(
        path, values, byteorder=byteorder, photometric=photometric, compression=compression
    )
    assert read_photo(path).rgb[0, :, 1].tolist() == shown


def test_12_bits_in_tiff(tmp_path: Path) -> None:
    tags = [
        (256, 4),
        (257, 1),
        (258, 12),
        (259, 1),
        (262, 1),
        (273, 8),
        (277, 1),
        (278, 1),
        (279, 6),
    ]
    entries = b"".join(struct.pack("<HHIHxx", tag, 3, 1, value) for tag, value in tags)
    pixels = bytes.fromhex("00012380FFFF")  # 000, 123, 80F, FFF
    directory = struct.pack("<H", len(tags)) + entries + bytes(4)
    path = tmp_path / "photo.tif"
    path.write_bytes(struct.pack("<2sHI", b"II", 42, 14) + pixels + directory)
    assert read_photo(path).rgb[0, :, 1].tolist() == [0, 0x12, 0x80, 0xFF]


def test_16_bits_of_netpbm(tmp_path: Path) -> None:
    (tmp_path / "photo.pgm").write_bytes(b"P5 2 1 65535\n\x12\x34\x80\xff")
    assert read_photo(tmp_path / "photo.pgm").rgb[0, :, 1].tolist() == [0x12, 0x80]


def test_a_transparent_grey_of_16_bits_is_alpha(tmp_path: Path) -> None:
    image = Image.fromarray(np.array([[0x1234, 0x1235]], np.uint16))
    image.save(tmp_path / "photo.png", transparency=0x1234)
    photo = read_photo(tmp_path / "photo.png")
    assert photo.alpha is not None
    assert photo.alpha.tolist() == [[0, 255]]


@pytest.mark.parametrize(
    ("dtype", "reason"),
    [
        (np.float32, "holds floating-point numbers, .*with 8 or 16 bits"),
        (np.int32, "holds whole numbers of 32 bits, .*with 8 or 16 bits"),
        (np.uint32, "holds whole numbers of 32 bits, .*with 8 or 16 bits"),
        (np.int16, "or with a sign, .*with 8 or 16 bits"),
        (np.int8, "or with a sign, .*with 8 or 16 bits"),
        (np.float64, "save it as PNG or JPEG, with 8 bits"),
    ],
)
def test_numbers_without_a_white_are_refused(tmp_path: Path, dtype, reason: str) -> None:
    tifffile.imwrite(tmp_path / "photo.tif", np.array([[0, 1, 100]], dtype))
    with pytest.raises(InputError, match=reason):
        read_photo(tmp_path / "photo.tif")


def test_planes_of_16_bits_are_refused_where_pillow_mistakes_them(tmp_path: Path) -> None:
    planes = np.array([[[0x1234]], [[0x8000]], [[0xFFFF]]], np.uint16)
    path = tmp_path / "photo.tif"
    tifffile.imwrite(path, planes, photometric="rgb", planarconfig="separate")
    with pytest.raises(InputError, match="a plane of 16 bits for each channel; save it with 8"):
        read_photo(path)
    tifffile.imwrite(path, planes, photometric="rgb", planarconfig="separate", compression="zlib")
    assert read_photo(path).rgb.tolist() == [[[0x12, 0x80, 0xFF]]]


def test_damaged_exif_is_told_and_left_out(tmp_path: Path) -> None:
    path = tmp_path / "photo.png"
    Image.fromarray(PICTURE).save(path, exif=b"Exif\0\0XX*\0garbage")
    photo = read_photo(path)
    np.testing.assert_array_equal(photo.rgb, PICTURE)
    assert photo.notes == (f"the EXIF data of {path} are damaged; the picture is taken as upright",)


def test_a_program_is_no_picture(tmp_path: Path) -> None:
    """Pillow would have an EPS drawn by Ghostscript."""
    (tmp_path / "photo.png").write_text(
        "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n"
    )
    with pytest.raises(InputError, match="not a picture in a known format; save it as PNG or JPEG"):
        read_photo(tmp_path / "photo.png")


def test_damage_is_told_in_one_place_only(tmp_path: Path, capfd) -> None:
    """libtiff writes to stderr by itself."""
    path = tmp_path / "photo.tif"
    noise = np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8)
    Image.fromarray(noise).save(path, compression="tiff_lzw")
    data = bytearray(path.read_bytes())
    data[8:200] = b"\xff" * 192
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"is damaged: .*; save it again"):
        read_photo(path)
    assert capfd.readouterr() == ("", "")


def heic(path: Path, image: Image.Image, **settings) -> Path:
    pillow_heif = pytest.importorskip("pillow_heif", reason="needs the extra `heic`")
    pillow_heif.register_heif_opener()
    image.save(path, "HEIF", quality=100, **settings)
    return path


@pytest.mark.parametrize("name", ["photo.heic", "photo.jpg"])
def test_photos_of_iphones(tmp_path: Path, name: str) -> None:
    """Held upright, in their own colours, and called JPEG by who passed them on."""
    exif = Image.Exif()
    exif[0x0112] = 6
    image = Image.new("RGB", (64, 32), ORANGE)
    image.paste((255, 255, 255), (0, 0, 16, 16))
    path = heic(tmp_path / name, image, exif=exif.tobytes(), icc_profile=DISPLAY_P3)
    photo = read_photo(path)
    assert photo.rgb.shape == (64, 32, 3)
    assert photo.rgb[4, 28].tolist() == pytest.approx([255, 255, 255], abs=4)
    assert photo.rgb[60, 4].tolist() == pytest.approx(list(IN_SRGB["Display P3"]), abs=6)
    assert photo.profile == "Display P3"


def test_half_a_heic_is_refused(tmp_path: Path) -> None:
    path = heic(tmp_path / "photo.heic", Image.new("RGB", (64, 32), ORANGE))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match=r"photo\.heic is damaged: .*save it again"):
        read_photo(path)


@pytest.mark.parametrize("brands", [b"heic\0\0\0\0mif1heic", b"mif1\0\0\0\0miafheic"])
def test_heic_without_its_package(tmp_path: Path, monkeypatch, brands: bytes) -> None:
    monkeypatch.setattr("motion_transfer.extras.find_spec", lambda _: None)
    (tmp_path / "photo.jpg").write_bytes(b"\0\0\0\x18ftyp" + brands + bytes(40))
    with pytest.raises(
        InputError, match=r"photo\.jpg is HEIC, and .* pillow-heif, .*motion-transfer\[heic\]"
    ):
        read_photo(tmp_path / "photo.jpg")
