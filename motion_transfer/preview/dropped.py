"""Photos and videos that the page sends: written to files that commands and saved jobs can name.

A browser does not tell where a file lies that is dropped on a page, so that it gets a place here:
`NAME.sources/` beside the job file, and in it a folder for each drop, in which a photo finds its
IUV by name.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from pathlib import Path
from types import TracebackType
from typing import Self

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, VIDEO_SUFFIXES, open_pictures
from motion_transfer.media.pictures.photo import explain_damage, open_image
from motion_transfer.media.publish import explain_disk_errors, extend_name

MOST_FILE_BYTES = 512 * 2**20  # a minute of a phone's 4K video has about 400 MiB
MOST_BYTES = 2 * 2**30  # of one preview: that many of them, and no full disk by mistake
LONGEST_NAME = 60  # characters; four bytes each still leave room for endings
NO_NAME = re.compile(r"[^\w.()-]+")
"""What is replaced in names: blanks, which shells part, marks of globs, and what is no text."""

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
    """The folder of one preview's dropped files; it is made with the first of them."""

    def __init__(self, job_file: Path) -> None:
        self.folder = job_file.with_name(extend_name(job_file.stem, ".sources"))
        self._drops: dict[str, Path] = {}
        self._written: list[Path] = []
        self.bytes = 0

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
            except FileExistsError:
                if not self.folder.is_dir():
                    raise OutputError(
                        f"{self.folder} is a file, where dropped photos are to be kept; choose"
                        " another --job-file"
                    ) from None
                number += 1
            else:
                return folder

    def add(self, path: Path) -> None:
        """Take a finished file as one of ours."""
        self._written.append(path)

    def clean(self, named: Collection[Path]) -> None:
        """Remove what was written, but for what is named, and folders that are empty then."""
        for path in self._written:
            if path not in named:
                path.unlink(missing_ok=True)
        for folder in (*self._drops.values(), self.folder):
            try:
                folder.rmdir()
            except OSError:  # something is in it, or it was never made
                continue


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
                f"{self._name} is too large to be sent; start again with its path as --source"
            )
        with explain_disk_errors(self._part):
            self._stream.write(data)

    def finish(self) -> Path:
        """Give the file its name. Raises: InputError if it is neither a photo nor a video."""
        with explain_disk_errors(self._part):
            self._stream.close()
            path = self._folder / name_for(self._part, self._name)
            number = 1
            while path.exists():  # of a drop of several folders
                number += 1
                path = path.with_name(f"{Path(self._name).stem}-{number}{path.suffix}")
            self._part.rename(path)
        self._files.add(path)
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


def _is_video(file: Path) -> bool:
    try:
        open_pictures(file)  # no photo's ending: it is opened as a video
    except InputError:
        return False
    return True
