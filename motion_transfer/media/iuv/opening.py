"""From a name to frames of IUV, whatever holds them: the table of formats says who opens what."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError, IuvFileError
from motion_transfer.media.files import check_readable
from motion_transfer.media.folders import (
    Numbering,
    describe_rest,
    list_files,
    list_gaps,
    number_frames,
)
from motion_transfer.media.iuv.formats import (
    CHANNEL_ORDERS,
    IUV_FORMATS,
    ChannelOrder,
    IuvFormat,
    Missing,
    find_iuv_format,
    names_file,
)
from motion_transfer.media.iuv.image import read_raw_iuv
from motion_transfer.media.iuv.stream import IuvReader, IuvStream, Raw, decide_order, to_iuv


def open_stream(path: Path, *, missing: Missing = "fail") -> IuvStream:
    """Open a driver by what it is: a folder, a file of any format in the table, or a motion.

    Args:
        missing: What a number missing from a folder or a dump does: `fail`, `hold` (the frame
            before is repeated) or `background` (a frame without anybody).
    Raises: InputError if it is missing or empty; IuvFileError if it is not IUV.
    """
    if names_file(path):
        check_readable(path, "driver", folder=True)
    row = find_iuv_format(path)
    stream: IuvStream
    if path.is_dir():  # what a folder is called says nothing of what lies in it
        stream = _open_folder(path, missing)
    elif row.lister:
        stream = _open_listed(path, row, missing)
    else:
        stream = resolve_name(row.opener)(path)
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


def read_single_iuv(
    path: Path, order: ChannelOrder | None, what: str
) -> UInt8[np.ndarray, "H W 3"] | None:
    """Read the IUV of one picture from any kind of file; None if it shows nobody.

    Args:
        order: Forces the channel order; None finds it out.
        what: What the file is wanted for, for messages.
    Raises: IuvFileError if it is not IUV, or holds several frames.
    """
    where = f"{what} {path}"
    if not find_iuv_format(path).always_iuv:
        raw = read_raw_iuv(path, what)  # a picture's IUV is a picture, and not a video
    else:
        if names_file(path):
            check_readable(path, what)
        stream = open_stream(path)
        if stream.frame_count != 1:
            raise IuvFileError(
                f"{where} holds {stream.frame_count} frames, and one is wanted; take it out with"
                " `mt iuv convert`"
            )
        raw, order = next(iter(stream.read_raw(0, 1))), stream.order or order
    order = order or decide_order([(where, raw)], where)
    return None if order is None else to_iuv(raw, order, where)


def _open_folder(path: Path, missing: Missing) -> IuvStream:
    """Open the files of the first format of which there are any."""
    rows = [row for row in IUV_FORMATS if row.folder_opener]
    inside = list_files(path)
    # Caffe2 writes an index of persons beside each IUV image
    persons = [file for file in inside if file.stem.lower().endswith("_inds")]
    frames = {
        row.name: [file for file in inside if row.claims(file) and file not in persons]
        for row in rows
    }
    chosen = next((row for row in rows if frames[row.name]), None)
    if chosen is None:
        lossy = [file for file in inside if find_iuv_format(file).refused]
        for file in (*persons[:1], *lossy[:1]):
            read_raw_iuv(file, "frame")  # raises, with the reason
        raise InputError(f"driver {path} holds no IUV images ({', '.join(rows[0].suffixes)})")
    # photos may lie between the IUV that was made of them
    named = [file for file in frames[chosen.name] if file.stem.lower().endswith("iuv")]
    files = named or frames[chosen.name]
    numbering = number_frames([file.name for file in files], f"driver {path}")
    stream = _open_numbered(path, chosen.folder_opener, files, numbering, missing)
    stems = {re.sub("_iuv$", "", file.stem, flags=re.IGNORECASE) for file in named}
    photos = [file for file in inside if file.stem in stems]  # that the IUV was made of
    stream.notes += describe_rest(path, files, {*persons, *photos})
    return stream


def _open_listed(path: Path, row: IuvFormat, missing: Missing) -> IuvStream:
    """Open a file that holds frames by name, in the order of the names where these are numbered."""
    listed: list[tuple[str | None, object]] = resolve_name(row.lister)(path)
    names = [name for name, _ in listed if name and any(map(str.isdecimal, Path(name).name))]
    numbering, note = Numbering(range(len(listed))), ""
    if len(names) == len(listed):
        twice = next((name for name, count in Counter(names).items() if count > 1), None)
        if twice:
            note = f"{twice} is in it more than once: frames play in the order of the file"
        else:
            numbering = number_frames(names, f"driver {path}")
            if list(dict.fromkeys(numbering.order)) != list(range(len(listed))):
                note = "frames play in the order of their numbers, and not in that of the file"
    stream = _open_numbered(path, row.opener, [item for _, item in listed], numbering, missing)
    stream.notes += (note,) if note else ()
    return stream


def _open_numbered(
    path: Path, opener: str, items: Sequence[object], numbering: Numbering, missing: Missing
) -> IuvStream:
    """Open items as frames in their order, with missing numbers' places filled."""
    if numbering.gaps and missing == "fail":
        raise InputError(
            f"driver {path}: {list_gaps(numbering.gaps)}; add the files, or repeat the frame before"
            " with --missing hold"
        )
    stream: IuvStream = resolve_name(opener)(path, [items[index] for index in numbering.order])
    if missing == "background":
        stream = _BlankedStream(stream, numbering.held)
    stream.gaps = numbering.gaps
    return stream


class _BlankedStream(IuvStream):
    """Another stream, some of whose frames show nobody."""

    def __init__(self, stream: IuvStream, blank: frozenset[int]) -> None:
        super().__init__(stream.path, stream.kind, stream.frame_count)
        self.frame_rate, self.order, self.notes = stream.frame_rate, stream.order, stream.notes
        self._stream = stream
        self._blank = blank

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index, raw in enumerate(self._stream.read_raw(start, stop), start):
            yield np.zeros_like(raw) if index in self._blank else raw

    def where(self, index: int) -> str:
        return self._stream.where(index)

    def closing_notes(self) -> tuple[str, ...]:
        return self._stream.closing_notes()
