"""NumPy's files read frame by frame.

They are not mapped into memory: where a mapped file becomes shorter while it is read, the operating
system ends the process.
"""

from __future__ import annotations

import math
import os
import shutil
import tempfile
import warnings
import weakref
import zipfile
from pathlib import Path
from textwrap import shorten
from typing import IO

import numpy as np

from motion_transfer.errors import IuvFileError
from motion_transfer.media.files import check_readable

ARRAY_SHAPES = (
    "an IUV array is uint8, [N x] H x W x 3 or [N x] 3 x H x W; global UV is floats,"
    " [N x] H x W x 2"
)

LARGEST_FRAME_BYTES = 2**30
"""16K (15360 x 8640) fits, also as global UV. A header may claim anything."""

LARGEST_SHRINKAGE = 500
"""How many times smaller a file may have become by compression. Frames without anybody become 1000
times smaller, the most that ZIP can do; those with somebody, at 1 % of the pixels, 100 times."""

SURELY_UNPACKED_BYTES = 2**30  # however small it was packed: this is written in a second or two


class ArrayFile:
    """The stack of frames in a `.npy`, or in the only array of a `.npz` (or its `iuv`).

    Any number of threads may read from it at once.

    Attributes:
        shape: N x H x W x C as frames are given; C is 3 for IUV, and 2 for global UV.
        dtype: uint8 for IUV, floats for global UV.
    """

    def __init__(self, path: Path) -> None:
        """Raises: IuvFileError if the file is damaged, or holds anything else; InputError."""
        check_readable(path, "driver")
        self._path = path
        try:
            self._file = _unpack(path) if path.suffix.lower() == ".npz" else path.open("rb")
            weakref.finalize(self, self._file.close)
            stored, self._fortran, self.dtype = _read_header(self._file)
        except IuvFileError:
            raise
        # a ZIP's directory and an array's header, a Python literal, can be broken in any way
        except Exception as error:
            reason = shorten(str(error) or type(error).__name__, 200)
            raise IuvFileError(f"driver {path} is not a whole NumPy array: {reason}") from None
        self._start_bytes = self._file.tell()
        stack = stored if len(stored) == 4 else (1, *stored)
        self._planar = _is_planar(path, stored, stack, self.dtype)
        count, *frame_shape = stack
        self._frame_shape = tuple(frame_shape)
        self._frame_bytes = math.prod(frame_shape) * self.dtype.itemsize
        if self._frame_bytes > LARGEST_FRAME_BYTES or not self._frame_bytes:
            raise IuvFileError(
                f"driver {path} claims frames of {_list_sides(frame_shape)}; a frame has at least a"
                f" pixel and at most {LARGEST_FRAME_BYTES:,} bytes"
            )
        held = os.fstat(self._file.fileno()).st_size - self._start_bytes
        if held < count * self._frame_bytes:
            raise IuvFileError(
                f"driver {path} is not a whole NumPy array: of {count} frames it holds"
                f" {held // self._frame_bytes}; export it again"
            )
        height, width, channels = (*frame_shape[1:], 3) if self._planar else frame_shape
        self.shape = (count, height, width, channels)
        # in Fortran's order the bytes of all frames lie between each other
        self._mapped = (
            np.memmap(self._file, self.dtype, "r", self._start_bytes, stack, "F")
            if self._fortran and count > 1
            else None
        )

    def __len__(self) -> int:
        return self.shape[0]

    def read(self, index: int, where: str) -> np.ndarray:
        """Read a frame, H x W x C.

        Args:
            where: Names the frame, for messages.
        Raises: IuvFileError if the file has become shorter.
        """
        if self._mapped is not None:
            return self._turn(self._mapped[index])
        place = self._start_bytes + index * self._frame_bytes
        data = np.empty(self._frame_bytes, np.uint8)
        try:
            read_bytes = os.preadv(self._file.fileno(), [data.data], place)
        except OSError as error:
            raise IuvFileError(f"{where} cannot be read: {error.strerror}") from error
        if read_bytes < self._frame_bytes:
            raise IuvFileError(f"{where} is gone: the file became shorter while it was read")
        order = "F" if self._fortran else "C"
        return self._turn(np.ndarray(self._frame_shape, self.dtype, data.data, order=order))

    def _turn(self, frame: np.ndarray) -> np.ndarray:
        return frame.transpose(1, 2, 0) if self._planar else frame


def _unpack(path: Path) -> IO[bytes]:
    """Unpack the array of an archive to a file without a name."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        name = names[0] if len(names) == 1 else "iuv.npy"
        if name not in names:
            raise IuvFileError(f"driver {path} holds {len(names)} arrays; name one of them iuv")
        size = archive.getinfo(name).file_size
        free = shutil.disk_usage(tempfile.gettempdir()).free
        if size > free or size > max(
            SURELY_UNPACKED_BYTES, LARGEST_SHRINKAGE * path.stat().st_size
        ):
            raise IuvFileError(
                f"driver {path} unpacks to {size:,} bytes, with {free:,} free in"
                f" {tempfile.gettempdir()}; save the array as .npy"
            )
        unpacked = tempfile.TemporaryFile()  # noqa: SIM115 (the caller closes it)
        try:
            with archive.open(name) as packed:
                shutil.copyfileobj(packed, unpacked)
        except BaseException:
            unpacked.close()
            raise
        unpacked.seek(0)
        return unpacked


def _read_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Read shape, whether it is in Fortran's order, and dtype, up to where the data begin."""
    readers = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    version = np.lib.format.read_magic(file)
    if version not in readers:  # version 3 is for names of fields, and plain numbers have none
        raise ValueError(f"it is of version {version[0]}.{version[1]}; versions 1 and 2 are read")
    with warnings.catch_warnings():  # of headers that Python 2 wrote, and of odd literals
        warnings.simplefilter("ignore")
        return readers[version](file)


def _is_planar(
    path: Path, stored: tuple[int, ...], stack: tuple[int, ...], dtype: np.dtype
) -> bool:
    """Tell 3 x H x W from H x W x C. Raises: IuvFileError if it is neither IUV nor global UV."""
    frames = len(stack) == 4 and min(stack) >= 0
    floats = np.issubdtype(dtype, np.floating)
    if frames and dtype == np.uint8 and 3 in stack[1::2]:
        return stack[3] != 3
    if frames and floats and stack[3] == 2:
        return False
    hint = ""
    if frames and floats and 3 in stack[1::2]:
        hint = "; store I as it is, and round(255 U) and round(255 V), as uint8"
    dtype_name = shorten(str(dtype), 40)
    raise IuvFileError(
        f"driver {path} holds {dtype_name} {_list_sides(stored)}; {ARRAY_SHAPES}{hint}"
    )


def _list_sides(shape: tuple[int, ...] | list[int]) -> str:
    return shorten(str(list(shape)), 80)
