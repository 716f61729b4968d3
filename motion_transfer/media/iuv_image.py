"""One IUV image from bytes, and the two channel orders that circulate.

Caffe2's DensePose writes PNG files whose RGB is (V, U, I); others write (I, U, V). The part index
is the channel that never exceeds 24, so one frame with a larger value in a channel rules that
channel out.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, get_args

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import IuvFileError
from motion_transfer.media.image import read_bytes
from motion_transfer.media.iuv_lookalikes import (
    explain_grey,
    explain_picture,
    explain_scaled_uv,
)
from nhrr_core.iuv import PART_COUNT

ChannelOrder = Literal["iuv", "vui"]
CHANNEL_ORDERS: tuple[str, ...] = get_args(ChannelOrder)

IUV_SUFFIXES = (".png", ".bmp", ".tif", ".tiff")
LOSSY_SIGNATURES = {b"\xff\xd8\xff": "JPEG", b"RIFF": "WebP", b"\x00\x00\x00\x0cjP": "JPEG 2000"}
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"

Raw = UInt8[np.ndarray, "H W 3"]
"""An IUV image whose channels are still in the order of the file's RGB."""


def read_raw_iuv(path: Path, what: str = "IUV") -> Raw:
    """The pixels of an IUV image file in its own channel order.

    Raises: IuvFileError if the file is lossy, damaged, grey, 16-bit, or not a picture.
    """
    data = read_bytes(path, what)
    for signature, name in LOSSY_SIGNATURES.items():
        if data.startswith(signature):
            raise IuvFileError(
                f"{what} {path} is a {name} file; lossy compression destroys part indices,"
                " export the IUV as PNG"
            )
    if data.startswith(PNG_SIGNATURE):
        _check_png(data, f"{what} {path}")
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if pixels is None:
        raise IuvFileError(f"{what} {path} is not a readable image; export the IUV as PNG")
    if pixels.dtype != np.uint8:
        raise IuvFileError(
            f"{what} {path} has {pixels.dtype.itemsize * 8} bits a channel; an IUV image has 8"
        )
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        grey = pixels if pixels.ndim == 2 else pixels[..., 0]
        raise IuvFileError(f"{what} {path} {explain_grey(grey, path.stem)}")
    return cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGB if pixels.shape[2] == 4 else cv2.COLOR_BGR2RGB)


def decide_order(frames: Iterable[tuple[str, Raw]], what: str) -> ChannelOrder | None:
    """The channel order of a driver: reads frames until one of the two is ruled out.

    Args:
        frames: pairs of a place (for messages) and a raw frame, lazily.
        what: the driver or source, for messages.
    Returns: the order; None if every pixel of every frame is background.
    Raises: IuvFileError if neither order is possible, if both stay possible to the end, or if the
        frame that decides has its U and V scaled by their minimum and maximum.
    """
    seen = False
    for where, raw in frames:
        first, last = int(raw[..., 0].max()), int(raw[..., 2].max())
        if first > PART_COUNT and last > PART_COUNT:
            known = explain_picture(raw)
            raise IuvFileError(
                f"{where} is not an IUV image: neither its first nor its last channel stays within"
                f" 0..{PART_COUNT} (they reach {first} and {last})"
                + (f"; {known}" if known else "")
            )
        if first > PART_COUNT or last > PART_COUNT:
            order: ChannelOrder = "vui" if first > PART_COUNT else "iuv"
            scaled = explain_scaled_uv(raw if order == "iuv" else raw[..., ::-1])
            if scaled:
                raise IuvFileError(f"{where} is not an IUV image: {scaled}")
            return order
        seen = seen or bool(raw.any())
    if seen:
        raise IuvFileError(
            f"{what}: the channel order cannot be told, because both the first and the last channel"
            f" stay within 0..{PART_COUNT}; say it with --iuv-order iuv or vui"
        )
    return None


def to_iuv(raw: Raw, order: ChannelOrder, where: str) -> UInt8[np.ndarray, "H W 3"]:
    """The image as (I, U, V). Raises: IuvFileError if a part index exceeds 24."""
    part = raw[..., 0 if order == "iuv" else 2]
    highest = int(part.max())
    if highest > PART_COUNT:
        raise IuvFileError(
            f"{where} has part index {highest}; DensePose has parts 1 to {PART_COUNT}, and other"
            f" frames say that channel {1 if order == 'iuv' else 3} holds them"
        )
    return raw if order == "iuv" else cv2.cvtColor(raw, cv2.COLOR_BGR2RGB)


def _check_png(data: bytes, where: str) -> None:
    """Walk a PNG's chunks: decoders return half a picture for half a file without a word."""
    position = len(PNG_SIGNATURE)
    while position + 12 <= len(data):
        length = int.from_bytes(data[position : position + 4], "big")
        end = position + 12 + length
        if end > len(data):
            break
        body = memoryview(data)[position + 4 : end - 4]
        if zlib.crc32(body) != int.from_bytes(data[end - 4 : end], "big"):
            raise IuvFileError(f"{where} is damaged (wrong checksum); export it again")
        if body[:4] == b"IEND":
            return
        position = end
    raise IuvFileError(f"{where} is truncated; export it again")
