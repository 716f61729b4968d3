"""From a name to frames of IUV, whatever holds them: the table of formats says who opens what."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError, IuvFileError
from motion_transfer.media.folders import fill_gaps, list_files, list_gaps
from motion_transfer.media.iuv.formats import (
    CHANNEL_ORDERS,
    IUV_FORMATS,
    ChannelOrder,
    Missing,
    find_iuv_format,
    names_file,
)
from motion_transfer.media.iuv.image import read_raw_iuv
from motion_transfer.media.iuv.stream import IuvReader, IuvStream, decide_order, to_iuv


def open_stream(path: Path, *, missing: Missing = "fail") -> IuvStream:
    """Open a driver by what it is: a folder, a file of any format in the table, or a motion.

    Args:
        missing: What a number missing from a folder does: `fail`, `hold` (the frame before is
            repeated) or `background` (a frame without anybody).
    Raises: InputError if it is missing or empty; IuvFileError if it is not IUV.
    """
    if names_file(path) and not path.exists():
        raise InputError(f"driver {path} does not exist")
    stream: IuvStream
    if path.is_dir():  # what a folder is called says nothing of what lies in it
        stream = _open_folder(path, missing)
    else:
        stream = resolve_name(find_iuv_format(path).opener)(path)
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
    files, gaps = fill_gaps(named or frames[chosen.name])
    if gaps and missing == "fail":
        raise InputError(
            f"driver {path}: {list_gaps(gaps)}; add the files, or repeat the frame before with"
            " --missing hold"
        )
    repeated = (i for i in range(1, len(files)) if files[i] == files[i - 1])
    blank = frozenset(repeated if missing == "background" else ())
    return resolve_name(chosen.folder_opener)(path, files, gaps, blank)
