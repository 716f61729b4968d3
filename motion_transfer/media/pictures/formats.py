"""The table of formats for pictures of people: photos, files of several pictures, videos.

A new format is a row here and the module that its `opener` names, which is imported when the first
file of that format is opened; nothing else is imported.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from motion_transfer.errors import InputError
from motion_transfer.media.folders import describe_rest, list_files

if TYPE_CHECKING:
    from motion_transfer.media.pictures.stream import PictureStream

PHOTOS = "motion_transfer.media.pictures.stream:PhotoStream"
SEVERAL = "motion_transfer.media.pictures.several:open_several"


@dataclass(frozen=True)
class PictureFormat:
    """One row of the table: `opener`, a `package.module:name`, makes the `PictureStream` of a path.

    Suffixes are lower case.
    """

    name: str
    suffixes: tuple[str, ...]
    opener: str


PHOTO_FORMATS = [
    PictureFormat("PNG", (".png", ".apng"), SEVERAL),
    # a phone's JPEG may hold more pictures, such as depth, and yet is one photo
    PictureFormat("JPEG", (".jpg", ".jpeg"), PHOTOS),
    PictureFormat("WebP", (".webp",), SEVERAL),
    PictureFormat("BMP", (".bmp",), PHOTOS),
    PictureFormat("TIFF", (".tif", ".tiff"), SEVERAL),
    PictureFormat("AVIF", (".avif",), SEVERAL),
    PictureFormat("HEIC", (".heic", ".heif", ".hif"), PHOTOS),  # with the extra `heic`
]
"""Formats of photos; the first picture is the photo where a file holds several."""

VIDEO = PictureFormat(
    "video",
    (".mp4", ".mov", ".mkv", ".webm", ".avi"),
    "motion_transfer.media.pictures.video:FilmedVideo",
)
"""Also what a name without a row is taken for: FFmpeg knows more containers than any list, GIF
with its times among them."""

PHOTO_SUFFIXES = tuple(suffix for row in PHOTO_FORMATS for suffix in row.suffixes)
VIDEO_SUFFIXES = VIDEO.suffixes


def open_pictures(path: Path) -> PictureStream:
    """Open a photo, a folder of photos (in natural order), or a video.

    Raises: InputError if it is missing, empty, or none of these.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if path.is_dir():
        photos = list_photos(path)
        stream = resolve_name(PHOTOS)(path, photos)
        stream.notes += describe_rest(path, photos)
        return stream
    rows = (row for row in PHOTO_FORMATS if path.suffix.lower() in row.suffixes)
    return resolve_name(next(rows, VIDEO).opener)(path)


def list_photos(folder: Path) -> list[Path]:
    """List the photos of a folder in natural order. Raises: InputError if there are none."""
    files = [file for file in list_files(folder) if file.suffix.lower() in PHOTO_SUFFIXES]
    if not files:
        raise InputError(f"{folder} holds no pictures ({', '.join(PHOTO_SUFFIXES)})")
    return files
