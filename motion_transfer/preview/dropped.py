"""Photos, videos and motions that the page sends: they stay in a folder of the user's.

A browser does not tell where a file lies that is dropped on a page, so that it gets a place here,
in a folder for each drop, in which a photo finds its IUV by name. Commands, saved jobs and renders
that wait name these files.
"""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path
from types import TracebackType
from typing import Self

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.iuv.formats import find_iuv_format
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, VIDEO_SUFFIXES, open_pictures
from motion_transfer.media.pictures.photo import explain_damage, open_image
from motion_transfer.media.publish import explain_disk_errors

MOST_FILE_BYTES = 2 * 2**30  # five minutes of a phone's 4K video
MOST_BYTES = 16 * 2**30  # of all that is in the folder: no full disk by mistake
LONGEST_NAME = 60  # characters; four bytes each still leave room for endings
NO_NAME = re.compile(r"[^\w.()-]+")
"""What is replaced in names: blanks, which shells part, marks of globs, and what is no text."""

CAPTURED = b"HIERARCHY"
"""How a BVH file begins, a motion that was captured."""

ENDINGS = {
    "PNG": ".png",
    "JPEG": ".jpg",
    "MPO": ".jpg",
    "WEBP": ".webp",
    "BMP": ".bmp",
    "TIFF": ".tif",
    "AVIF": ".avif",
    "HEIF": ".heic",
}
"""What a photo's file is called, by Pillow's name for what it holds."""


class DroppedFiles:
    """The folder of dropped files; it is made with the first of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._drops: dict[str, Path] = {}
        self.bytes = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())

    def begin(self, drop: str, name: str) -> Upload:
        """Begin to write a file.

        Args:
            drop: What was dropped together has the same word here, any.
            name: As the browser tells it.
        Raises: OutputError if it cannot be written.
        """
        with explain_disk_errors(self.folder):
            folder = self._drops.get(drop)
            if folder is None or not folder.is_dir():
                folder = self._drops[drop] = self._make_folder()
        return Upload(self, folder, clean_name(name))

    def _make_folder(self) -> Path:
        """Make a folder that nobody had before: other previews' jobs may name what is in theirs."""
        number = 1
        while True:
            folder = self.folder / str(number)
            try:
                folder.mkdir(parents=True)
            except (FileExistsError, NotADirectoryError):
                if not self.folder.is_dir():
                    raise OutputError(
                        f"{self.folder} is a file, where dropped files are to be kept; choose"
                        " another --folder"
                    ) from None
                number += 1
            else:
                return folder


class Upload:
    """One file on its way; it has its name only when it is whole, and shows something."""

    def __init__(self, files: DroppedFiles, folder: Path, name: str) -> None:
        self._files, self._folder, self._name = files, folder, name
        self._part = folder / f".{name}.part"
        self._size = 0

    def __enter__(self) -> Self:
        with explain_disk_errors(self._part):
            self._stream = self._part.open("xb")
        return self

    def write(self, data: bytes) -> None:
        """Add bytes. Raises: InputError when they are too many; OutputError of a full disk."""
        self._size += len(data)
        self._files.bytes += len(data)
        if self._size > MOST_FILE_BYTES or self._files.bytes > MOST_BYTES:
            raise InputError(
                f"{self._name} is too large: a file may have {MOST_FILE_BYTES // 2**30} GiB, and"
                f" all of {self._files.folder} {MOST_BYTES // 2**30} GiB"
            )
        with explain_disk_errors(self._part):
            self._stream.write(data)

    def finish(self, *, motion: bool = False) -> Path:
        """Give the file its name.

        Args:
            motion: Whether it may be a motion as well: arrays of IUV, or BVH.
        Raises: InputError if it is none of these.
        """
        with explain_disk_errors(self._part):
            self._stream.close()
            is_motion = motion and _is_motion(self._part, self._name)
            path = self._folder / (self._name if is_motion else name_for(self._part, self._name))
            number = 1
            while path.exists():  # of a drop of several folders
                number += 1
                path = path.with_name(f"{Path(self._name).stem}-{number}{path.suffix}")
            self._part.rename(path)
        return path

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stream.close()
        if self._part.exists():
            self._part.unlink()
            self._files.bytes -= self._size


def clean_name(name: str) -> str:
    """Make of what a browser calls a file the plain name of one: no folders, nothing hidden."""
    base = re.split(r"[/\\]", unicodedata.normalize("NFC", name))[-1]
    word = NO_NAME.sub("_", base).strip(".-_") or "photo"
    stem, dot, ending = word.rpartition(".")
    return f"{stem[:LONGEST_NAME]}.{ending[:8]}" if dot else word[:LONGEST_NAME]


def name_for(file: Path, name: str) -> str:
    """Name a file so that it is read as what it holds, see `media.pictures.formats`.

    Raises: InputError if it holds neither a picture nor a video.
    """
    suffix = Path(name).suffix.lower()
    try:
        with explain_damage(name), file.open("rb") as stream, open_image(stream, name) as image:
            holds = image.format or ""
    except InputError as error:
        if not _is_video(file):
            reason = str(error).removeprefix(f"{name} ")
            raise InputError(f"{name} is no video, and {reason}") from error
        # its ending may claim a photo, or IUV
        return name if suffix in VIDEO_SUFFIXES else f"{name}.mkv"
    if holds not in ENDINGS:  # GIF, which FFmpeg reads, whatever it is called
        return name if suffix == f".{holds.lower()}" else f"{name}.{holds.lower()}"
    return name if suffix in PHOTO_SUFFIXES else name + ENDINGS[holds]


def _is_motion(file: Path, name: str) -> bool:
    if Path(name).suffix.lower() == ".bvh":
        with file.open("rb") as stream:
            return stream.read(len(CAPTURED)) == CAPTURED
    return find_iuv_format(Path(name)).always_iuv  # whoever opens it looks at what it holds


def _is_video(file: Path) -> bool:
    try:
        open_pictures(file)  # no photo's ending: it is opened as a video
    except InputError:
        return False
    return True
