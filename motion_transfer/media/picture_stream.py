"""Raw pictures as a clip: a photo, a folder of photos, or a video of any container.

Frames come one after the other, upright and at a constant rate; only a few are in memory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.image import read_photo
from motion_transfer.media.iuv_stream import natural_key

PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")

Frame = UInt8[np.ndarray, "H W 3"]


class PictureStream(ABC):
    """RGB frames of one size.

    Attributes:
        frame_rate: None where the frames come without one.
        start_seconds: when the first frame is shown, on the clock of the file's sound.
        notes: what the user should know of how this clip is read, in sentences.
    """

    def __init__(self, path: Path, frame_count: int, height: int, width: int) -> None:
        self.path = path
        self.frame_count = frame_count
        self.height = height
        self.width = width
        self.frame_rate: Fraction | None = None
        self.start_seconds = Fraction(0)
        self.notes: tuple[str, ...] = ()

    @abstractmethod
    def read(self) -> Iterator[Frame]:
        """Every frame in order. Raises: InputError naming the frame that is broken."""

    @abstractmethod
    def where(self, index: int) -> str:
        """The place of a frame, for messages."""


class PhotoStream(PictureStream):
    """Photos of one size, turned upright as their EXIF says; transparency shows white."""

    def __init__(self, path: Path, files: list[Path]) -> None:
        self._files = files
        first = read_photo(files[0], "picture")
        super().__init__(path, len(files), *first.rgb.shape[:2])

    def read(self) -> Iterator[Frame]:
        for index, file in enumerate(self._files):
            picture = read_photo(file, "picture").on_white()
            if picture.shape[:2] != (self.height, self.width):
                raise InputError(
                    f"{self.where(index)} is {picture.shape[1]} x {picture.shape[0]}, but the first"
                    f" picture is {self.width} x {self.height}; pictures of one clip need one size,"
                    " give others one by one"
                )
            yield picture

    def where(self, index: int) -> str:
        return f"frame {index}, {self._files[index]}" if self.path.is_dir() else str(self.path)


def open_pictures(path: Path) -> PictureStream:
    """Open a photo, a folder of photos (in natural order), or a video.

    Raises: InputError if it is missing, empty, or none of these.
    """
    from motion_transfer.media.picture_video import VideoPictures

    if not path.exists():
        raise InputError(f"{path} does not exist")
    if path.is_dir():
        return PhotoStream(path, list_photos(path))
    if path.suffix.lower() in PHOTO_SUFFIXES:
        return PhotoStream(path, [path])
    return VideoPictures(path)


def list_photos(folder: Path) -> list[Path]:
    """The photos of a folder in natural order. Raises: InputError if there are none."""
    files = sorted(
        (
            file
            for file in folder.iterdir()
            if file.suffix.lower() in PHOTO_SUFFIXES and not file.name.startswith(".")
        ),
        key=lambda file: natural_key(file.name),
    )
    if not files:
        raise InputError(f"{folder} holds no pictures ({', '.join(PHOTO_SUFFIXES)})")
    return files
