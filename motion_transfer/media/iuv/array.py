"""IUV in NumPy files: a stack of frames, or a folder with one array for each.

uint8 with three channels is IUV, also the quantised results of detectron2 (3 x H x W); floats with
two channels are global UV (see `global_uv`).
"""

from __future__ import annotations

import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from motion_transfer.errors import IuvFileError
from motion_transfer.media.iuv.global_uv import check_scale, global_to_iuv
from motion_transfer.media.iuv.stream import IuvStream, Raw

ARRAY_SHAPES = (
    "an IUV array is uint8, [N x] H x W x 3 or [N x] 3 x H x W; global UV is floats,"
    " [N x] H x W x 2"
)


class ArrayStream(IuvStream):
    """One file with a stack of frames or a single one (`files` None), or a folder with an array for
    each frame; mapped rather than loaded.

    A missing number's place is taken by the file before it, or, in `blank`, by nobody.
    """

    def __init__(
        self,
        path: Path,
        files: list[Path] | None = None,
        gaps: tuple[int, ...] = (),
        blank: frozenset[int] = frozenset(),
    ) -> None:
        self._files = files
        self._blank = blank
        self._stack = _map_stack(files[0] if files else path)
        self._holds_global_uv = self._stack.shape[-1] == 2
        self._largest_distance_texels = 0.0
        what = "global UV" if self._holds_global_uv else "IUV"
        kind = f"folder of {what} arrays" if files else f"{what} array"
        super().__init__(path, kind, len(files) if files else len(self._stack))
        self.gaps = gaps
        if self._holds_global_uv:
            self.order = "iuv"
            self.notes = (
                "global UV does not say the part: each pixel takes the nearest entry of the chart"
                " table",
            )
            self._check_scale()

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            frame = self._frame(index)
            if frame.shape[-1] == 2:
                frame, distance = global_to_iuv(frame, self.where(index))
                self._largest_distance_texels = max(self._largest_distance_texels, distance)
            yield np.ascontiguousarray(frame)

    def where(self, index: int) -> str:
        return f"frame {index}, {self._files[index]}" if self._files else super().where(index)

    def closing_notes(self) -> tuple[str, ...]:
        if not self._holds_global_uv:
            return ()
        return (
            f"the furthest pixel lay {self._largest_distance_texels:.2f} texels of 256 from its"
            " entry",
        )

    def _frame(self, index: int) -> np.ndarray:
        """Map H x W x 3 uint8, or H x W x 2 floats where the stream holds global UV."""
        if self._files is None:
            return self._stack[index]
        stack = _map_stack(self._files[index])
        if len(stack) != 1 or (stack.shape[-1] == 2) != self._holds_global_uv:
            raise IuvFileError(
                f"{self.where(index)} holds {stack.dtype} {list(stack.shape)}; every file of the"
                " folder must hold one frame, of the same kind as the first"
            )
        return np.zeros((*stack.shape[1:3], 3), np.uint8) if index in self._blank else stack[0]

    def _check_scale(self) -> None:
        for index in range(self.frame_count):
            frame = self._frame(index)
            if not np.isnan(frame).all():  # a frame that shows nobody says nothing of the scale
                check_scale(frame, self.where(index))
                return


def _map_array(path: Path) -> np.ndarray:
    """Map the array of a `.npy` from disk, or the only one of a `.npz` (or its `iuv`).

    Raises: IuvFileError if the file is damaged, holds objects, or several arrays.
    """
    try:
        if path.suffix.lower() == ".npy":
            return np.load(path, mmap_mode="r", allow_pickle=False)
        with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
            names = archive.namelist()
            name = names[0] if len(names) == 1 else "iuv.npy"
            if name not in names:
                raise IuvFileError(f"driver {path} holds {len(names)} arrays; name one of them iuv")
            # NumPy maps nothing inside an archive; the file is unlinked, its mapping stays alive
            unpacked = Path(folder) / "iuv.npy"
            with archive.open(name) as packed, unpacked.open("wb") as file:
                shutil.copyfileobj(packed, file)
            return np.load(unpacked, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise IuvFileError(f"driver {path} is not a whole NumPy array: {error}") from error


def _map_stack(path: Path) -> np.ndarray:
    """Map N x H x W x 3 (IUV) or 2 (global UV). Raises: IuvFileError if a file is neither."""
    array = _map_array(path)
    stack = array[None] if array.ndim == 3 else array
    if stack.ndim == 4 and stack.dtype == np.uint8 and 3 in (stack.shape[1], stack.shape[3]):
        return stack if stack.shape[3] == 3 else stack.transpose(0, 2, 3, 1)
    if stack.ndim == 4 and np.issubdtype(stack.dtype, np.floating) and stack.shape[3] == 2:
        return stack
    hint = ""
    if stack.ndim == 4 and np.issubdtype(stack.dtype, np.floating) and 3 in stack.shape[1::2]:
        hint = "; store I as it is, and round(255 U) and round(255 V), as uint8"
    raise IuvFileError(
        f"driver {path} holds {array.dtype} {list(array.shape)}; {ARRAY_SHAPES}{hint}"
    )
