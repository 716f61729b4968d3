"""The table of IUV formats: which there are, how their files are known and found, who opens them.

A new format is a row here and the module that its `opener` names, which is imported when the first
file of that format is opened. Help and option parsing read this table: it imports nothing heavy.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from motion_transfer.media.files import check_readable

ChannelOrder = Literal["iuv", "vui"]
"""What a file's red, green and blue hold."""

Missing = Literal["hold", "background", "fail"]
"""What a frame does that is missing or shows nobody: the one before is repeated, nobody is shown,
or the run fails."""

DriverKind = Literal["iuv", "pictures"]

CHANNEL_ORDERS: tuple[str, ...] = get_args(ChannelOrder)
MISSING: tuple[str, ...] = get_args(Missing)
DRIVER_KINDS: tuple[str, ...] = get_args(DriverKind)


@dataclass(frozen=True)
class IuvFormat:
    """One row of the table.

    Attributes:
        name: What a file of this format is.
        opener: Makes the stream of a path, as `package.module:name`.
        folder_opener: Makes the stream of a folder with such a file for each frame, from the
            folder and its files, in the order of frames; empty where no folders of this format are
            read.
        suffixes: File name endings, lower case.
        scheme: What names begin with that are no files; empty for files.
        lister: Lists what a file holds for each frame, as pairs of a name (or None) and whatever
            `opener` understands, which then gets the path and a list of those, in the order of
            frames; empty where a file's frames have no names.
        always_iuv: Whether the name alone says that it is IUV; of others the first frames are
            looked at, since they may be pictures of a person as well.
        several: Whether one file may hold several frames.
        has_sound: Whether a file may hold sound.
        refused: Whether the opener does nothing but say why such a file is no IUV.
        help: The format in the words of `--help`.
    """

    name: str
    opener: str
    folder_opener: str = ""
    suffixes: tuple[str, ...] = ()
    scheme: str = ""
    lister: str = ""
    always_iuv: bool = False
    several: bool = True
    has_sound: bool = False
    refused: bool = False
    help: str = ""

    def claims(self, path: Path | str) -> bool:
        """Tell whether a name is one of this format's."""
        if self.scheme:
            return str(path).startswith(self.scheme)
        return Path(path).suffix.lower() in self.suffixes


HERE = "motion_transfer.media.iuv"
VIDEO = IuvFormat(
    "lossless video",
    f"{HERE}.video:VideoStream",
    suffixes=(".mkv", ".avi", ".mov"),
    has_sound=True,
    help="lossless video",
)
"""Also what a name without a row is taken for: FFmpeg knows more containers than any list."""

IUV_FORMATS = [
    IuvFormat(
        "IUV image",
        f"{HERE}.image:ImageStream",
        f"{HERE}.image:ImageStream",
        (".png", ".bmp", ".tif", ".tiff"),
        several=False,
        help="a folder of images, one image",
    ),
    VIDEO,
    IuvFormat(
        "array",
        f"{HERE}.array:ArrayStream",
        f"{HERE}.array:ArrayStream",
        (".npy", ".npz"),
        always_iuv=True,
        help=".npy, .npz",
    ),
    IuvFormat(
        "detectron2 dump",
        f"{HERE}.dump:DumpStream",
        lister=f"{HERE}.dump:list_photos",
        suffixes=(".pkl", ".pickle", ".pth", ".pt"),
        always_iuv=True,
        help="detectron2's results.pkl",
    ),
    IuvFormat(
        "motion",
        "motion_transfer.people:open_motion",
        scheme="people:",
        always_iuv=True,
        help="people:MOTION",
    ),
    IuvFormat(
        "lossy picture",
        f"{HERE}.image:refuse_lossy",
        suffixes=(".jpg", ".jpeg", ".webp"),
        several=False,
        refused=True,
    ),
]
"""In a folder with files of several formats, the first one with a `folder_opener` counts."""


def register_iuv_format(row: IuvFormat) -> None:
    """Add a row. Raises: ValueError if an ending or the scheme has one already."""
    for other in IUV_FORMATS:
        shared = {*row.suffixes, row.scheme} & {*other.suffixes, other.scheme} - {""}
        if shared:
            raise ValueError(f"{', '.join(sorted(shared))} belongs to {other.name} already")
    IUV_FORMATS.append(row)


def find_iuv_format(path: Path | str) -> IuvFormat:
    """Find the row of a file or scheme by its name; a lossless video's where there is none."""
    # a scheme goes first: `people:walk.bvh` ends as a file does
    rows = sorted(IUV_FORMATS, key=lambda row: not row.scheme)
    return next((row for row in rows if row.claims(path)), VIDEO)


def names_file(path: Path | str) -> bool:
    """Tell whether a driver's name means a file or folder, and not a motion, say."""
    return not find_iuv_format(path).scheme


def iuv_suffixes(*, several: bool = False) -> tuple[str, ...]:
    """List the endings of files that may be IUV, or only of those that may hold several frames."""
    rows = (row for row in IUV_FORMATS if not row.refused and (row.several or not several))
    return tuple(suffix for row in rows for suffix in row.suffixes)


def driver_help() -> str:
    """List what a driver of IUV may be, in the words of `--help`; names that are no files last."""
    files = [row.help for row in IUV_FORMATS if row.help and not row.scheme]
    others = [row.help for row in IUV_FORMATS if row.help and row.scheme]
    return "; or ".join([", ".join(files), *others])


def list_iuv_names(photo: Path) -> list[Path]:
    """List where a photo's IUV is looked for: `STEM_IUV.png` and `STEM_iuv.png` beside it."""
    return [photo.with_name(f"{photo.stem}_{word}.png") for word in ("IUV", "iuv")]


def list_clip_iuv_names(clip: Path) -> list[Path]:
    """List where the IUV of a video, or of a folder of photos, is looked for, all beside it.

    It is `STEM_IUV.mkv` or `STEM_iuv.mkv`, another file that holds the IUV of many frames, or a
    folder `STEM_IUV` or `STEM_iuv`. Nothing is looked for beside a folder given as `.` or `/`.
    """
    return [
        clip.with_name(f"{clip.stem}_{word}{suffix}")
        for word in ("IUV", "iuv")
        if clip.name
        for suffix in (*iuv_suffixes(several=True), "")
    ]


def find_iuv_of(photo: Path) -> Path | None:
    """Find the IUV that lies beside a photo; None means that it has to be estimated.

    Raises: InputError if there is no such photo, or it is no file.
    """
    check_readable(photo, "source")
    # a photo's name may be so long that there cannot be one for its IUV
    return next((path for path in list_iuv_names(photo) if os.path.exists(path)), None)  # noqa: PTH110 (raises)
