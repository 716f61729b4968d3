"""Whether a PNG is whole: decoders skip most of its checksums, and leave rows black that lack."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable

SIGNATURE = b"\x89PNG\r\n\x1a\n"
CHUNK_BYTES = 12
"""Of a chunk besides its data: length, type and checksum, four each."""

CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""How many there are, by the type of colour."""

ONE_PASS = ((0, 0, 1, 1),)
INTERLACED = (
    *((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4)),
    *((0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)),
)
"""First column and row of each pass, and the steps to the next ones."""

LARGEST_PIXELS = 2**30
"""Decoders refuse what is larger, and to unpack it takes long."""

SLICE_BYTES = 2**20
"""How much is unpacked at once, and forgotten."""


def find_png_fault(data: bytes) -> str | None:
    """Tell what is wrong with a PNG, as the end of a sentence: `truncated`, or `damaged (...)`.

    Checksums are compared, and the pixels of each picture are unpacked to count their rows.

    Returns: None if it is whole, or no PNG at all.
    """
    if not data.startswith(SIGNATURE):
        return None
    depth, colour, interlaced = 8, 2, 0
    pictures: list[tuple[int, int, list[memoryview]]] = []  # width, height, compressed pixels
    position = len(SIGNATURE)
    ended = False
    while not ended and position + CHUNK_BYTES <= len(data):
        length = int.from_bytes(data[position : position + 4], "big")
        end = position + CHUNK_BYTES + length
        if end > len(data):
            break
        chunk = memoryview(data)[position + 4 : end - 4]
        if zlib.crc32(chunk) != int.from_bytes(data[end - 4 : end], "big"):
            return "damaged (wrong checksum)"
        kind, body = bytes(chunk[:4]), chunk[4:]
        if kind == b"IHDR" and length == 13:
            width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", body)
            pictures.append((width, height, []))
        elif kind == b"fcTL" and length == 26 and pictures and pictures[-1][2]:
            pictures.append((*struct.unpack_from(">II", body, 4), []))
        elif kind in (b"IDAT", b"fdAT") and pictures:
            pictures[-1][2].append(body if kind == b"IDAT" else body[4:])  # a number goes first
        ended = kind == b"IEND"
        position = end
    if not ended:
        return "truncated"
    if not pictures or colour not in CHANNELS:
        return "damaged (no header that PNG knows)"
    for width, height, packed in pictures:
        if not 0 < width * height <= LARGEST_PIXELS:
            continue  # whoever decodes it says so
        wanted = _count_bytes(width, height, CHANNELS[colour] * depth, bool(interlaced))
        try:
            if not _holds(packed, wanted):
                return "truncated (rows of pixels are missing)"
        except zlib.error:
            return "damaged (its pixels cannot be unpacked)"
    return None


def _count_bytes(width: int, height: int, bits: int, interlaced: bool) -> int:
    """Count the bytes of unpacked pixels; each row has one more, for its filter."""
    total = 0
    for left, top, across, down in INTERLACED if interlaced else ONE_PASS:
        columns, rows = -(-(width - left) // across), -(-(height - top) // down)
        if columns > 0 and rows > 0:
            total += rows * (1 + -(-columns * bits // 8))
    return total


def _holds(packed: Iterable[memoryview], wanted: int) -> bool:
    """Tell whether so many bytes come out. Raises: zlib.error."""
    unpacker = zlib.decompressobj()
    for piece in packed:
        rest: bytes | memoryview = piece
        while rest and not unpacker.eof and wanted > 0:
            wanted -= len(unpacker.decompress(rest, SLICE_BYTES))
            rest = unpacker.unconsumed_tail
    return wanted <= 0
