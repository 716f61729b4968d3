"""IUV images: one file, or a folder with one for each frame, every byte of them checked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import cv2
import numpy as np

from motion_transfer.errors import IuvFileError
from motion_transfer.media.files import read_bytes
from motion_transfer.media.iuv.lookalikes import explain_grey
from motion_transfer.media.iuv.stream import IuvStream, Raw
from motion_transfer.media.pictures.png import find_png_fault

LOSSY_SIGNATURES = {b"\xff\xd8\xff": "JPEG", b"RIFF": "WebP", b"\x00\x00\x00\x0cjP": "JPEG 2000"}
"""First bytes of a file and the format that they mean, whatever the file is called."""


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
    if fault := find_png_fault(data):
        raise IuvFileError(f"{what} {path} is {fault}; export it again")
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
