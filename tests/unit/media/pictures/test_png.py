"""A PNG is whole, or what is wrong with it is told."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from motion_transfer.media.pictures.png import CHANNELS, SIGNATURE, find_png_fault

WIDTH, HEIGHT = 13, 9
PASS_OF_PIXEL = np.array(
    [
        [1, 6, 4, 6, 2, 6, 4, 6],
        [7, 7, 7, 7, 7, 7, 7, 7],
        [5, 6, 5, 6, 5, 6, 5, 6],
        [7, 7, 7, 7, 7, 7, 7, 7],
        [3, 6, 4, 6, 3, 6, 4, 6],
        [7, 7, 7, 7, 7, 7, 7, 7],
        [5, 6, 5, 6, 5, 6, 5, 6],
        [7, 7, 7, 7, 7, 7, 7, 7],
    ]
)
"""As PNG's specification draws the interlace method."""


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(
    raw: bytes, *, depth: int = 8, colour: int = 2, interlaced: bool = False, packed: bytes = b""
) -> bytes:
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, depth, colour, 0, 0, interlaced)
    pixels = chunk(b"IDAT", packed or zlib.compress(raw))
    return SIGNATURE + chunk(b"IHDR", header) + pixels + chunk(b"IEND", b"")


def rows(bits: int, interlaced: bool) -> bytes:
    """Unpacked pixels, all 0: of every pass the rows that have pixels."""
    passes = np.tile(PASS_OF_PIXEL, (2, 2))[:HEIGHT, :WIDTH] if interlaced else np.ones((9, 13))
    raw = b""
    for number in np.unique(passes):
        for row in passes:
            count = int((row == number).sum())
            raw += bytes(1 + (count * bits + 7) // 8) * bool(count)
    return raw


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize("colour", CHANNELS)
@pytest.mark.parametrize("depth", [1, 8, 16])
def test_rows_are_counted(depth: int, colour: int, interlaced: bool) -> None:
    raw = rows(depth * CHANNELS[colour], interlaced)
    kind = {"depth": depth, "colour": colour, "interlaced": interlaced}
    assert find_png_fault(png(raw, **kind)) is None
    assert find_png_fault(png(raw[:-1], **kind)) == "truncated (rows of pixels are missing)"


def test_what_is_wrong_is_told() -> None:
    whole = png(rows(24, interlaced=False))
    for size in range(len(SIGNATURE), len(whole)):
        assert find_png_fault(whole[:size]) == "truncated"
    flipped = bytearray(whole)
    flipped[-18] ^= 1
    assert find_png_fault(bytes(flipped)) == "damaged (wrong checksum)"
    assert find_png_fault(png(b"", packed=b"none")) == "damaged (its pixels cannot be unpacked)"
    assert find_png_fault(png(b"", colour=5)) == "damaged (no header that PNG knows)"
    assert find_png_fault(b"GIF89a") is None


@pytest.mark.parametrize("default_image", [False, True])
def test_every_picture_of_a_clip_is_looked_at(default_image: bool) -> None:
    first, *others = (Image.new("RGB", (32, 16), (9, 9, level)) for level in (0, 99, 200))
    file = io.BytesIO()
    settings = {"append_images": others, "duration": 50, "default_image": default_image}
    first.save(file, "PNG", save_all=True, **settings)
    data = file.getvalue()
    assert find_png_fault(data) is None
    start = data.rindex(b"fdAT")
    length = int.from_bytes(data[start - 4 : start], "big")
    short = chunk(b"fdAT", data[start + 4 : start + 8] + zlib.compress(b"\0"))
    spoiled = data[: start - 4] + short + data[start + 8 + length :]
    assert find_png_fault(spoiled) == "truncated (rows of pixels are missing)"
