"""IUV images: one file, or a folder with one for each frame, every byte of them checked."""

from __future__ import annotations

import io
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn, cast

import av
import numpy as np
from av.codec import CodecContext
from av.error import FFmpegError
from jaxtyping import UInt8
from PIL import Image, UnidentifiedImageError

from motion_transfer.errors import IuvFileError
from motion_transfer.media.container import hear_complaints
from motion_transfer.media.files import read_bytes
from motion_transfer.media.iuv.lookalikes import explain_grey
from motion_transfer.media.iuv.stream import IuvStream, Raw
from motion_transfer.media.quiet import quiet_libraries

LOSSY_SIGNATURES = {b"\xff\xd8\xff": "JPEG", b"RIFF": "WebP", b"\x00\x00\x00\x0cjP": "JPEG 2000"}
"""First bytes of a file and the format that they mean, whatever the file is called."""

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
PNG_DEPTH, PNG_INTERLACED = 24, 28  # where these bytes lie
FILTERS_BYTES = 2**16  # of the pixels, in which filters are looked at: to unpack all takes long
TRUNCATED = ("chunk too big", "0 bytes left", "IEND without all image", "no picture in it")
"""What FFmpeg says of a PNG that breaks off, and what is said here."""

LARGEST_PIXELS = 358_000_000
"""A larger picture is an attack; it is Pillow's limit, too, which holds for photos."""

TIFF_BITS, TIFF_COMPRESSION = 258, 259  # tags
TIFF_JPEG = (6, 7)
BMP_DEPTH = slice(28, 30)


class ImageStream(IuvStream):
    """A folder with an IUV image for each frame, or a single one (`files` None)."""

    def __init__(self, path: Path, files: list[Path] | None = None) -> None:
        self.files = files or [path]
        super().__init__(
            path, "folder of IUV images" if path.is_dir() else "IUV image", len(self.files)
        )

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            yield read_raw_iuv(self.files[index], f"frame {index},")

    def where(self, index: int) -> str:
        return f"frame {index}, {self.files[index]}"


def refuse_lossy(path: Path) -> NoReturn:
    """Say why a JPEG or WebP file is no IUV. Raises: IuvFileError."""
    read_raw_iuv(path, "driver")  # knows more of it, and raises
    raise IuvFileError(f"driver {path} may be lossy; export the IUV as PNG")


def read_raw_iuv(path: Path, what: str = "IUV") -> Raw:
    """Read an IUV image file in its own channel order.

    Raises: IuvFileError if the file is lossy, damaged, grey, 16-bit, or not a picture.
    """
    data = read_bytes(path, what)
    for signature, name in LOSSY_SIGNATURES.items():
        if data.startswith(signature):
            raise IuvFileError(
                f"{what} {path} is a {name} file; lossy compression destroys part indices,"
                " export the IUV as PNG"
            )
    try:
        pixels = _decode_rgb_png(data) if data.startswith(PNG_SIGNATURE) else None
        if pixels is None:
            pixels = _decode_any(data)
    except _UnfitError as error:
        raise IuvFileError(f"{what} {path} {error}") from error
    if pixels.ndim == 2:
        if pixels.any():
            raise IuvFileError(f"{what} {path} {explain_grey(pixels, path.stem)}")
        return np.zeros((*pixels.shape, 3), np.uint8)  # nobody; tools that shrink PNG make it grey
    return pixels


class _UnfitError(Exception):
    """What is wrong with a file, as the end of a sentence."""


def _decode_rgb_png(data: bytes) -> Raw | None:
    """Decode a PNG of 8 bits, RGB or RGBA, by FFmpeg; None if it is of another kind.

    FFmpeg is the fastest decoder here, and the one that tells what it dislikes: OpenCV writes that
    to standard error, and Pillow leaves rows black that are missing.
    Raises: _UnfitError.
    """
    width, height = (int.from_bytes(data[start : start + 4], "big") for start in (16, 20))
    _check_size(width, height)
    if b"IDAT" in data and b"acTL" in data[: data.index(b"IDAT")]:
        raise _UnfitError("is an animation; export one PNG for each frame")
    decoder = cast(av.VideoCodecContext, CodecContext.create("png", "r"))
    decoder.thread_count = 1  # frames are read in parallel already
    decoder.options = {"err_detect": "crccheck+explode"}
    with hear_complaints() as complaints:
        try:
            frames = decoder.decode(av.Packet(data))
        except (FFmpegError, MemoryError):
            frames = []
    reason = complaints[0][2].strip() if complaints else "no picture in it"
    if not frames or complaints:
        fault = "wrong checksum" if "CRC" in reason else reason
        kind = "truncated" if fault in TRUNCATED else "damaged"
        raise _UnfitError(f"is {kind} ({fault}); export it again")
    frame = frames[0]
    if frame.format.name not in ("rgb24", "rgba") or data[PNG_INTERLACED]:
        return None
    pixels = frame.to_ndarray()
    _check_filters(data, 1 + pixels[0].size)
    return np.ascontiguousarray(pixels[..., :3])


def _check_filters(data: bytes, row_bytes: int) -> None:
    """Refuse what begins with rows of an unknown kind, which FFmpeg takes as they are."""
    start = data.index(b"IDAT")
    packed = data[start + 4 : start + 4 + int.from_bytes(data[start - 4 : start], "big")]
    if max(zlib.decompressobj().decompress(packed, FILTERS_BYTES)[::row_bytes], default=0) > 4:
        raise _UnfitError("is damaged (rows of an unknown filter); export it again")


def _decode_any(data: bytes) -> Raw | UInt8[np.ndarray, "H W"]:
    """Decode any other picture by Pillow: H x W x 3, or H x W if it is grey.

    Raises: _UnfitError, also for numbers that are not 8 bits of red, green and blue.
    """
    try:
        with (
            warnings.catch_warnings(action="ignore"),
            quiet_libraries(),
            Image.open(io.BytesIO(data), formats=("PNG", "BMP", "TIFF")) as file,
        ):
            _check_size(*file.size)
            _check_numbers(file, data)
            if file.mode == "P":
                return np.array(file.convert("RGB"))
            pixels = np.array(file.convert("L") if file.mode in ("1", "LA") else file)
    except _UnfitError:
        raise
    except UnidentifiedImageError:
        raise _UnfitError("is not a readable image; export the IUV as PNG") from None
    except Exception as error:  # each of Pillow's plugins raises what its parser happens to meet
        reason = " ".join(str(error).split()) or type(error).__name__
        kind = "truncated" if "truncated" in reason else "damaged"
        raise _UnfitError(f"is {kind} ({reason}); export it again") from error
    return pixels if pixels.ndim == 2 else np.ascontiguousarray(pixels[..., :3])


def _check_numbers(file: Image.Image, data: bytes) -> None:
    """Refuse what Pillow would read as something else than 8 bits of I, U and V."""
    tags = getattr(file, "tag_v2", {})
    bits = max(tags.get(TIFF_BITS, (8,)))
    if file.format == "PNG":
        bits = max(8, data[PNG_DEPTH])
    if bits > 8 or file.mode.startswith("I"):
        bits = bits if bits > 8 else 16
        raise _UnfitError(f"has {bits} bits a channel; an IUV image has 8")
    if file.format == "BMP" and int.from_bytes(data[BMP_DEPTH], "little") == 16:
        raise _UnfitError("has 16 bits a pixel, fewer than 8 a channel; export the IUV as PNG")
    if tags.get(TIFF_COMPRESSION) in TIFF_JPEG:
        raise _UnfitError(
            "is a JPEG inside a TIFF; lossy compression destroys part indices, export the IUV as"
            " PNG"
        )
    if file.mode not in ("1", "L", "LA", "P", "RGB", "RGBA", "RGBX"):
        raise _UnfitError(f"holds {file.mode} pixels; an IUV image has I, U and V as RGB")
    if file.format == "PNG" and file.mode == "P" and b"PLTE" not in data:
        raise _UnfitError("is damaged (its palette is missing); export it again")
    count = getattr(file, "n_frames", 1)
    if count > 1:
        raise _UnfitError(f"holds {count} pictures; export one file for each frame")


def _check_size(width: int, height: int) -> None:
    if width * height > LARGEST_PIXELS:
        raise _UnfitError(f"is too large: {width} x {height} px")
    if not width * height:
        raise _UnfitError("is damaged (it has no pixels); export it again")
