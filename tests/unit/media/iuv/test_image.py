"""One IUV image: what is accepted, and how its channel order is found."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from motion_transfer.errors import IuvFileError
from motion_transfer.media.iuv.image import read_raw_iuv
from motion_transfer.media.iuv.stream import decide_order, to_iuv


@pytest.mark.parametrize("order", ["iuv", "vui"])
@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif"])
def test_both_orders_give_the_same_iuv(studio, order: str, suffix: str) -> None:
    iuv = studio.iuv()
    raw = read_raw_iuv(studio.image(f"frame{suffix}", iuv, order))
    assert decide_order([("here", raw)], "driver") == order
    np.testing.assert_array_equal(to_iuv(raw, order, "here"), iuv)


def test_alpha_of_an_iuv_is_ignored(studio) -> None:
    iuv = studio.iuv()
    alpha = np.zeros((*iuv.shape[:2], 1), np.uint8)
    path = studio.image("frame.png", np.concatenate([iuv, alpha], 2))
    np.testing.assert_array_equal(read_raw_iuv(path), iuv)


def picture(studio, kind: str) -> Path:
    """An IUV image file with one thing wrong."""
    iuv = studio.iuv()
    path = studio.image("frame.png", iuv)
    data = path.read_bytes()
    if kind == "16 bit":
        Image.fromarray(iuv[..., 0].astype(np.uint16)).save(path)
    elif kind == "grey":
        Image.fromarray(iuv[..., 0]).save(path)
    elif kind in ("JPEG", "WebP"):
        Image.fromarray(iuv).save(path, format=kind)
    elif kind == "truncated":
        path.write_bytes(data[: len(data) // 2])
    elif kind == "no end":
        path.write_bytes(data[:-12])
    elif kind == "checksum":
        middle = len(data) // 2
        path.write_bytes(data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :])
    elif kind == "words":
        path.write_text("no picture")
    elif kind == "empty":
        path.write_bytes(b"")
    return path


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("16 bit", "16 bits a channel"),
        ("grey", "is grey"),
        ("JPEG", "JPEG file; lossy"),
        ("WebP", "WebP file; lossy"),
        ("truncated", "truncated"),
        ("no end", "truncated"),
        ("checksum", "wrong checksum"),
        ("words", "not a readable image"),
        ("empty", "not a readable image"),
    ],
)
def test_what_is_no_iuv_is_refused_by_name(studio, kind: str, reason: str) -> None:
    with pytest.raises(IuvFileError, match=rf"^frame 7, .*frame\.png .*{reason}"):
        read_raw_iuv(picture(studio, kind), "frame 7,")


def test_a_palette_keeps_the_numbers_and_a_black_grey_shows_nobody(studio) -> None:
    iuv = studio.iuv()
    iuv[..., 1:] //= 64  # few colours: a palette holds them all
    path = studio.folder / "palette.png"
    Image.fromarray(iuv).quantize(256, dither=Image.Dither.NONE).save(path)
    assert np.abs(read_raw_iuv(path).astype(int) - iuv).max() <= 1
    Image.new("1", (7, 5)).save(path)
    np.testing.assert_array_equal(read_raw_iuv(path), np.zeros((5, 7, 3), np.uint8))


@pytest.mark.parametrize(
    ("mode", "options", "reason"),
    [
        ("CMYK", {}, "holds CMYK pixels"),
        ("F", {}, "32 bits a channel"),
        ("RGB", {"save_all": True, "append_images": [Image.new("RGB", (8, 8))]}, "2 pictures"),
        ("RGB", {"compression": "jpeg"}, "JPEG inside a TIFF"),
    ],
)
def test_other_tiffs_are_refused(tmp_path: Path, mode: str, options: dict, reason: str) -> None:
    Image.new(mode, (8, 8)).save(tmp_path / "a.tif", **options)
    with pytest.raises(IuvFileError, match=rf"a\.tif .*{reason}"):
        read_raw_iuv(tmp_path / "a.tif")


@pytest.mark.parametrize("suffix", [".bmp", ".tif"])
def test_what_breaks_off_is_refused(studio, suffix: str) -> None:
    path = studio.image(f"frame{suffix}", studio.iuv())
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(IuvFileError, match=r"is (truncated|damaged)"):
        read_raw_iuv(path)


@pytest.mark.parametrize(
    ("size", "raw", "reason"),
    [
        ((60000, 60000), b"", "too large: 60000 x 60000"),
        ((2, 4), bytes(7) * 2, "truncated"),
        ((2, 2), b"\x09" + bytes(13), "unknown filter"),
        ((0, 2), bytes(2), "no pixels"),
    ],
)
def test_a_png_of_right_checksums_may_be_wrong(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    size: tuple[int, int],
    raw: bytes,
    reason: str,
) -> None:
    header = struct.pack(">IIBBBBB", *size, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(raw)), (b"IEND", b"")]
    packed = (
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(packed))
    with pytest.raises(IuvFileError, match=reason):
        read_raw_iuv(tmp_path / "a.png")
    assert capfd.readouterr().err == ""


def test_order_is_decided_by_the_first_frame_that_can(studio) -> None:
    small = np.full((2, 2, 3), 5, np.uint8)  # both channels could be parts
    frames = [("frame 0", np.zeros_like(small)), ("frame 1", small), ("frame 2", studio.iuv())]
    read = []

    def lazily():
        for where, raw in [*frames, ("frame 3", small)]:
            read.append(where)
            yield where, raw[..., ::-1]

    assert decide_order(lazily(), "driver") == "vui"
    assert read == ["frame 0", "frame 1", "frame 2"]


def test_an_ambiguous_order_asks(studio) -> None:
    with pytest.raises(IuvFileError, match=r"driver: .*--iuv-order iuv or vui"):
        decide_order([("here", np.full((2, 2, 3), 24, np.uint8))], "driver")


def test_an_empty_driver_has_no_order() -> None:
    assert decide_order([("here", np.zeros((2, 2, 3), np.uint8))] * 2, "driver") is None


def test_a_photo_is_not_iuv(studio) -> None:
    with pytest.raises(IuvFileError, match=r"frame 3 is not an IUV image.*200"):
        decide_order([("frame 3", np.full((2, 2, 3), 200, np.uint8))], "driver")


def test_a_part_beyond_24_is_refused(studio) -> None:
    iuv = studio.iuv()
    iuv[0, 0] = (25, 0, 0)
    with pytest.raises(IuvFileError, match="frame 3 has part index 25"):
        to_iuv(iuv, "iuv", "frame 3")


def test_parts_beyond_24_after_bicubic_interpolation_are_explained(studio) -> None:
    iuv = studio.iuv()
    iuv[0, 0] = (26, 0, 0)
    with pytest.raises(IuvFileError, match=r"part index 26.*resize it by nearest neighbour"):
        to_iuv(iuv, "iuv", "frame 3")
    with pytest.raises(IuvFileError, match=r"reach 26.*resize it by nearest neighbour"):
        decide_order([("frame 3", iuv)], "driver")
