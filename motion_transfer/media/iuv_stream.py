"""Drivers: IUV frames from a folder, one image, a lossless video or an array, decoded lazily.

A stream knows its length before anything is decoded, and any number of threads may read from it
at once, each its own range.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from motion_transfer.errors import InputError, IuvFileError
from motion_transfer.media.iuv_image import (
    CHANNEL_ORDERS,
    IUV_SUFFIXES,
    ChannelOrder,
    Raw,
    decide_order,
    read_raw_iuv,
    to_iuv,
)
from motion_transfer.media.iuv_video import VideoStream
from motion_transfer.media.stream import IuvStream

Missing = Literal["fail", "hold"]


class ImageStream(IuvStream):
    """A folder of IUV images in natural order, or a single one."""

    def __init__(self, path: Path, files: list[Path], gaps: tuple[int, ...] = ()) -> None:
        kind = "folder of IUV images" if path.is_dir() else "IUV image"
        super().__init__(path, kind, len(files))
        self.files = files
        self.gaps = gaps

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            yield read_raw_iuv(self.files[index], f"frame {index},")

    def where(self, index: int) -> str:
        return f"frame {index}, {self.files[index]}"


class ArrayStream(IuvStream):
    """A NumPy stack, N x H x W x 3 or N x 3 x H x W uint8, mapped rather than loaded."""

    def __init__(self, path: Path) -> None:
        self._frames = _map_array(path)
        shape = self._frames.shape
        if self._frames.dtype != np.uint8 or len(shape) != 4 or 3 not in (shape[1], shape[3]):
            raise IuvFileError(
                f"driver {path} holds {self._frames.dtype} {list(shape)}; an IUV stack is uint8,"
                " N x H x W x 3 or N x 3 x H x W"
            )
        if shape[3] != 3:
            self._frames = self._frames.transpose(0, 2, 3, 1)
        super().__init__(path, "IUV array", shape[0])

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            yield np.ascontiguousarray(self._frames[index])

    def where(self, index: int) -> str:
        return f"frame {index} of {self.path}"


class IuvReader:
    """A stream whose channel order is known: frames as (I, U, V), each checked."""

    def __init__(self, stream: IuvStream, order: ChannelOrder, height: int, width: int) -> None:
        self.stream = stream
        self.order: ChannelOrder = order
        self.height = height
        self.width = width

    def read(self, start: int, stop: int) -> Iterator[np.ndarray]:
        """Frames start..stop-1, H x W x 3 uint8.

        Raises: IuvFileError naming the frame that is broken, of another size, or not IUV.
        """
        for index, raw in enumerate(self.stream.read_raw(start, stop), start):
            if raw.shape[:2] != (self.height, self.width):
                raise IuvFileError(
                    f"{self.stream.where(index)} is {raw.shape[1]} x {raw.shape[0]}, but the driver"
                    f" began with {self.width} x {self.height}; all frames need one size"
                )
            yield to_iuv(raw, self.order, self.stream.where(index))


def open_stream(path: Path, *, missing: Missing = "fail") -> IuvStream:
    """Open a driver by what it is: a folder, an image, a `.npy`/`.npz` stack, or a video.

    Raises: InputError if it is missing or empty; IuvFileError if it is not IUV.
    """
    if not path.exists():
        raise InputError(f"driver {path} does not exist")
    if path.is_dir():
        stream: IuvStream = _open_folder(path, missing)
    elif path.suffix.lower() in IUV_SUFFIXES:
        stream = ImageStream(path, [path])
    elif path.suffix.lower() in (".npy", ".npz"):
        stream = ArrayStream(path)
    elif path.suffix.lower() in (".jpg", ".jpeg", ".webp"):
        read_raw_iuv(path, "driver")  # raises, with the reason
        raise IuvFileError(f"driver {path} may be lossy; export the IUV as PNG")
    else:
        stream = VideoStream(path)
    if stream.frame_count == 0:
        raise InputError(f"driver {path} holds no frames")
    return stream


def open_reader(stream: IuvStream, order: ChannelOrder | None = None) -> IuvReader:
    """Settle a stream's channel order (unless given) and frame size.

    Raises: IuvFileError if the order cannot be told; InputError if nobody is in any frame.
    """
    if order is not None and order not in CHANNEL_ORDERS:
        raise InputError(f"channel order {order!r}; supported are {', '.join(CHANNEL_ORDERS)}")
    height, width = next(iter(stream.read_raw(0, 1))).shape[:2]
    if order is None:
        frames = enumerate(stream.read_raw(0, stream.frame_count))
        order = decide_order(((stream.where(i), raw) for i, raw in frames), str(stream.path))
    if order is None:
        raise InputError(f"{stream.path}: no person in any frame, every pixel is background")
    return IuvReader(stream, order, height, width)


def list_gaps(gaps: tuple[int, ...]) -> str:
    """Missing numbers in words, the first few of them listed."""
    listed = ", ".join(map(str, gaps[:5])) + (", ..." if len(gaps) > 5 else "")
    return f"{len(gaps)} missing frame{'s' if len(gaps) > 1 else ''} ({listed})"


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """A sort key that puts frame_9 before frame_10."""
    return [(0, int(s)) if s.isdigit() else (1, s) for s in re.findall(r"\d+|\D+", name)]


def _open_folder(path: Path, missing: Missing) -> ImageStream:
    images = [
        file
        for file in path.iterdir()
        if file.suffix.lower() in IUV_SUFFIXES and not file.name.startswith(".")
    ]
    named = [file for file in images if file.stem.lower().endswith("iuv")]
    files = sorted(named or images, key=lambda file: natural_key(file.name))
    if not files:
        lossy = next((f for f in path.iterdir() if f.suffix.lower() in (".jpg", ".jpeg")), None)
        if lossy is not None:
            read_raw_iuv(lossy, "frame")  # raises, with the reason
        raise InputError(f"driver {path} holds no IUV images ({', '.join(IUV_SUFFIXES)})")
    held, gaps = _find_gaps(files)
    if gaps and missing == "fail":
        raise InputError(
            f"driver {path}: {list_gaps(gaps)}; add the files, or repeat the frame before with"
            " --missing hold"
        )
    return ImageStream(path, held, gaps)


def _find_gaps(files: list[Path]) -> tuple[list[Path], tuple[int, ...]]:
    """Files with each missing number's place taken by the file before it, and those numbers.

    Numbers count only where the names differ in nothing else; their usual step is allowed for.
    """
    pattern = re.compile(r"(.*?)(\d+)(\D*)$")
    matches = [pattern.match(file.name) for file in files]
    if not all(matches) or len({(m[1], m[3]) for m in matches if m}) != 1 or len(files) < 3:
        return files, ()
    numbers = [int(m[2]) for m in matches if m]
    step = Counter(b - a for a, b in pairwise(numbers)).most_common(1)[0][0]
    if step <= 0:
        return files, ()
    held, gaps = [files[0]], []
    for (before, number), file in zip(pairwise(numbers), files[1:], strict=True):
        between = range(before + step, number, step)
        gaps += between
        held += [held[-1]] * len(between) + [file]
    return held, tuple(gaps)


def _map_array(path: Path) -> np.ndarray:
    """The array of a `.npy`, or the only one of a `.npz`, mapped from disk."""
    try:
        if path.suffix.lower() == ".npy":
            return np.load(path, mmap_mode="r", allow_pickle=False)
        with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
            names = archive.namelist()
            name = names[0] if len(names) == 1 else "iuv.npy"
            if name not in names:
                raise IuvFileError(f"driver {path} holds {len(names)} arrays; name one of them iuv")
            unpacked = Path(folder) / "iuv.npy"  # unlinked at once; the mapping keeps it alive
            with archive.open(name) as packed, unpacked.open("wb") as file:
                shutil.copyfileobj(packed, file)
            return np.load(unpacked, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise IuvFileError(f"driver {path} is not a whole NumPy array: {error}") from error
