"""Small copies of a clip's pictures, which can be had in any order."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.image import encode_jpeg, read_photo
from motion_transfer.media.picture_stream import open_pictures

LONGEST_SIDE = 720


@dataclass(frozen=True)
class Proxies:
    """JPEG files of a clip's frames in a folder."""

    folder: Path

    @classmethod
    def make(cls, clip: Path, folder: Path, stop: threading.Event) -> Self:
        """Decode a clip once; until `stop` is set. Raises: InputError, OSError."""
        folder.mkdir()
        proxies = cls(folder)
        for index, picture in enumerate(open_pictures(clip).read()):
            if stop.is_set():
                break
            scale = min(1, LONGEST_SIDE / max(picture.shape[:2]))
            size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
            small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
            proxies._file(index).write_bytes(encode_jpeg(small))
        return proxies

    def read(self, index: int) -> UInt8[np.ndarray, "h w 3"]:
        """A frame, made small. Raises: InputError if it was not there."""
        return read_photo(self._file(index), "picture").rgb

    def _file(self, index: int) -> Path:
        return self.folder / f"{index:08d}.jpg"
