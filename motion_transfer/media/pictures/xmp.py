"""XMP in files of pictures, PNG, WebP and GIF: put among their blocks, which stay as they are.

No library that is at hand writes XMP into an animation without encoding it again. What a file holds
besides remarks on it has a digest, which other programs' remarks do not change, nor a signature.
"""

from __future__ import annotations

import hashlib
import io
import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

from PIL import Image

from motion_transfer.media.pictures.png import SIGNATURE

PNG_XMP = b"XML:com.adobe.xmp\0\0\0\0\0"  # keyword, not compressed, no language: as Adobe has it
PNG_REMARKS = (b"iTXt", b"tEXt", b"zTXt", b"tIME", b"eXIf", b"caBX")  # the last: C2PA's
WEBP_REMARKS = (b"XMP ", b"EXIF", b"C2PA")
WEBP_XMP_FLAG, WEBP_ALPHA_FLAG = 0x04, 0x10  # of the chunk VP8X
GIF_XMP = b"\x21\xff\x0bXMP DataXMP"
GIF_TRAILER = b"\x01" + bytes(range(255, -1, -1)) + b"\0"
"""The XMP specification's: whichever byte of the packet is taken for a length, it leads here."""
GIF_LOOP = b"NETSCAPE2.0"


class Block(NamedTuple):
    """A piece of a file: its name, all of its bytes, and what they hold, where that is text."""

    name: bytes
    whole: bytes
    content: bytes


def put_xmp(data: bytes, xmp: bytes) -> bytes:
    """Put XMP into a PNG, APNG, WebP or GIF, in the place of any. Raises: ValueError for others."""
    if data.startswith(SIGNATURE):
        header, *others = _read_png(data)
        text = _png_chunk(b"iTXt", PNG_XMP + xmp)
        kept = (b.whole for b in others if not b.content.startswith(PNG_XMP))
        return b"".join([SIGNATURE, header.whole, text, *kept])
    if data.startswith(b"RIFF"):
        blocks = [block for block in _read_webp(data) if block.name != b"XMP "]
        if blocks[0].name != b"VP8X":
            blocks.insert(0, _describe_webp(data))
        first = bytearray(blocks[0].whole)
        first[8] |= WEBP_XMP_FLAG
        body = b"".join([bytes(first), *(b.whole for b in blocks[1:]), _riff_chunk(b"XMP ", xmp)])
        return b"RIFF" + struct.pack("<I", 4 + len(body)) + b"WEBP" + body
    header, *others = _read_gif(data)
    kept = (b.whole for b in others if not b.whole.startswith(GIF_XMP))
    return b"".join([header.whole, GIF_XMP + xmp + GIF_TRAILER, *kept])


def find_xmp(data: bytes) -> bytes | None:
    """Find the XMP of such a file. Raises: ValueError for another file, or a damaged one."""
    if data.startswith(SIGNATURE):
        found = (b.content for b in _read_png(data) if b.content.startswith(PNG_XMP))
        return next((content.removeprefix(PNG_XMP) for content in found), None)
    if data.startswith(b"RIFF"):
        return next((b.content for b in _read_webp(data) if b.name == b"XMP "), None)
    found = (b.whole for b in _read_gif(data) if b.whole.startswith(GIF_XMP))
    return next((w.removeprefix(GIF_XMP).removesuffix(GIF_TRAILER) for w in found), None)


def digest_pictures(data: bytes) -> bytes:
    """Make the SHA-256 of what such a file holds besides remarks. Raises: ValueError, see above."""
    digest = hashlib.sha256()
    if data.startswith(SIGNATURE):
        for block in _read_png(data):
            if block.name not in PNG_REMARKS:
                digest.update(block.whole)
    elif data.startswith(b"RIFF"):
        for block in _read_webp(data):
            if block.name not in (*WEBP_REMARKS, b"VP8X"):
                digest.update(block.whole)
    else:
        for block in _read_gif(data):
            if block.name not in (b"remark", b"end"):
                digest.update(block.whole)
    return digest.digest()


def _read_png(data: bytes) -> Iterator[Block]:
    """Source: the PNG specification, third edition, section 5."""
    start = len(SIGNATURE)
    while start < len(data):
        length, name = _unpack(">I4s", data, start)
        yield Block(name, data[start : start + length + 12], data[start + 8 : start + 8 + length])
        start += length + 12


def _png_chunk(name: bytes, content: bytes) -> bytes:
    checked = name + content
    return struct.pack(">I", len(content)) + checked + struct.pack(">I", zlib.crc32(checked))


def _read_webp(data: bytes) -> Iterator[Block]:
    """Source: the WebP container specification."""
    start = 12
    while start < len(data):
        name, length = _unpack("<4sI", data, start)
        end = start + 8 + length
        yield Block(name, data[start : end + length % 2], data[start + 8 : end])
        start = end + length % 2


def _riff_chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)


def _describe_webp(data: bytes) -> Block:
    """Make the chunk that a WebP of one picture lacks, and one with XMP must have."""
    with Image.open(io.BytesIO(data)) as picture:
        (width, height), has_alpha = picture.size, picture.mode == "RGBA"
    sides = struct.pack("<I", width - 1)[:3] + struct.pack("<I", height - 1)[:3]
    content = bytes([WEBP_ALPHA_FLAG * has_alpha, 0, 0, 0]) + sides
    return Block(b"VP8X", _riff_chunk(b"VP8X", content), content)


def _read_gif(data: bytes) -> Iterator[Block]:
    """Source: the GIF89a specification. Blocks are named `header`, `shown`, `remark` and `end`."""
    if not data.startswith(b"GIF8"):
        raise ValueError("neither PNG, WebP nor GIF")
    start = 13 + _palette_bytes(data, 10)
    yield Block(b"header", data[:start], b"")
    while start < len(data):
        kind = data[start]
        if kind == 0x2C:  # a picture: descriptor, palette, the least size of a code, data
            end = _after_blocks(data, start + 10 + _palette_bytes(data, start + 9) + 1)
            name = b"shown"
        elif kind == 0x21:
            end = _after_blocks(data, start + 2)
            label = data[start + 1 : start + 2]
            loops = data[start + 3 :].startswith(GIF_LOOP)
            name = b"remark" if label == b"\xfe" or (label == b"\xff" and not loops) else b"shown"
        else:
            end, name = len(data), b"end"
        yield Block(name, data[start:end], b"")
        start = end


def _palette_bytes(data: bytes, flags: int) -> int:
    if flags >= len(data):
        raise ValueError("cut short")
    return 3 << (data[flags] & 7) + 1 if data[flags] & 0x80 else 0


def _after_blocks(data: bytes, start: int) -> int:
    """Find where blocks end, each of which begins with its length; the last has none."""
    while start < len(data) and data[start]:
        start += data[start] + 1
    if start >= len(data):
        raise ValueError("cut short")
    return start + 1


def _unpack(form: str, data: bytes, start: int) -> tuple:
    if start + struct.calcsize(form) > len(data):
        raise ValueError("cut short")
    return struct.unpack_from(form, data, start)
