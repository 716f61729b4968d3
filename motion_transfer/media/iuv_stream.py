"""Drivers: IUV frames of every kind that circulates, decoded lazily.

Folders of images or arrays, one image, a lossless video, a NumPy stack (also quantised results and
global UV), a detectron2 dump. What only looks like IUV is refused with the reason.

A stream knows its length before anything is decoded, and any number of threads may read from it
at once, each its own range.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from motion_transfer.errors import InputError, IuvFileError
from motion_transfer.media.iuv_array import ARRAY_SUFFIXES, ArrayFolder, ArrayStream
from motion_transfer.media.iuv_dump import DUMP_SUFFIXES, DumpStream
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

Missing = Literal["fail", "hold", "background"]


class ImageStream(IuvStream):
    """A folder of IUV images in natural order, or a single one.

    A missing number's place is taken by the file before it, or, in `blank`, by nobody.
    """

    def __init__(
        self,
        path: Path,
        files: list[Path],
        gaps: tuple[int, ...] = (),
        blank: frozenset[int] = frozenset(),
    ) -> None:
        kind = "folder of IUV images" if path.is_dir() else "IUV image"
        super().__init__(path, kind, len(files))
        self.files = files
        self.gaps = gaps
        self._blank = blank

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            raw = read_raw_iuv(self.files[index], f"frame {index},")
            yield np.zeros_like(raw) if index in self._blank else raw

    def where(self, index: int) -> str:
        return f"frame {index}, {self.files[index]}"


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
    """Open a driver by what it is: a folder, an image, an array, a detectron2 dump, or a video.

    Args:
        missing: what a number missing from a folder does: `fail`, `hold` (the frame before is
            repeated) or `background` (a frame without anybody).
    Raises: InputError if it is missing or empty; IuvFileError if it is not IUV.
    """
    if not path.exists():
        raise InputError(f"driver {path} does not exist")
    stream: IuvStream
    if path.is_dir():
        stream = _open_folder(path, missing)
    elif path.suffix.lower() in IUV_SUFFIXES:
        stream = ImageStream(path, [path])
    elif path.suffix.lower() in ARRAY_SUFFIXES:
        stream = ArrayStream(path)
    elif path.suffix.lower() in DUMP_SUFFIXES:
        stream = DumpStream(path)
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
    order = stream.order or order
    if order is None:
        frames = enumerate(stream.read_raw(0, stream.frame_count))
        order = decide_order(((stream.where(i), raw) for i, raw in frames), str(stream.path))
    if order is None:
        raise InputError(f"{stream.path}: no person in any frame, every pixel is background")
    return IuvReader(stream, order, height, width)


def read_single_iuv(path: Path, order: ChannelOrder | None, what: str) -> np.ndarray | None:
    """The IUV of one picture from any kind of file, H x W x 3 uint8; None if it shows nobody.

    Args:
        order: force the channel order; None: find it out.
        what: what the file is wanted for, for messages.
    Raises: IuvFileError if it is not IUV, or holds several frames.
    """
    where = f"{what} {path}"
    if path.suffix.lower() not in (*ARRAY_SUFFIXES, *DUMP_SUFFIXES):
        raw = read_raw_iuv(path, what)
    else:
        if not path.exists():
            raise InputError(f"{where} does not exist")
        stream = open_stream(path)
        if stream.frame_count != 1:
            raise IuvFileError(
                f"{where} holds {stream.frame_count} frames, and one is wanted; take it out with"
                " `mt iuv convert`"
            )
        raw, order = next(iter(stream.read_raw(0, 1))), stream.order or order
    order = order or decide_order([(where, raw)], where)
    return None if order is None else to_iuv(raw, order, where)


def list_gaps(gaps: tuple[int, ...]) -> str:
    """Missing numbers in words, the first few of them listed."""
    listed = ", ".join(map(str, gaps[:5])) + (", ..." if len(gaps) > 5 else "")
    return f"{len(gaps)} missing frame{'s' if len(gaps) > 1 else ''} ({listed})"


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """A sort key that puts frame_9 before frame_10."""
    return [(0, int(s)) if s.isdigit() else (1, s) for s in re.findall(r"\d+|\D+", name)]


def _open_folder(path: Path, missing: Missing) -> IuvStream:
    """Its IUV images, those named so first; without images, its arrays."""
    inside = sorted(
        (file for file in path.iterdir() if not file.name.startswith(".")),
        key=lambda file: natural_key(file.name),
    )
    images = [file for file in inside if file.suffix.lower() in IUV_SUFFIXES]
    named = [file for file in images if file.stem.lower().endswith("iuv")]
    persons = [file for file in images if file.stem.lower().endswith("_inds")]
    files = named or [file for file in images if file not in persons]
    arrays = [file for file in inside if file.suffix.lower() in ARRAY_SUFFIXES]
    if not (files or arrays):
        lossy = [file for file in inside if file.suffix.lower() in (".jpg", ".jpeg")]
        for file in (*persons[:1], *lossy[:1]):
            read_raw_iuv(file, "frame")  # raises, with the reason
        raise InputError(f"driver {path} holds no IUV images ({', '.join(IUV_SUFFIXES)})")
    held, gaps = _find_gaps(files or arrays)
    if gaps and missing == "fail":
        raise InputError(
            f"driver {path}: {list_gaps(gaps)}; add the files, or repeat the frame before with"
            " --missing hold"
        )
    repeated = (i for i in range(1, len(held)) if held[i] == held[i - 1])
    blank = frozenset(repeated if missing == "background" else ())
    kind = ImageStream if files else ArrayFolder
    return kind(path, held, gaps, blank)


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
