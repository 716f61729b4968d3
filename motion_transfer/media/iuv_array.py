"""IUV in NumPy files: stacks, one array for each frame, quantised DensePose results, global UV."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
import zlib
from abc import abstractmethod
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from motion_transfer.errors import IuvFileError
from motion_transfer.media.global_uv import check_scale, global_to_iuv
from motion_transfer.media.iuv_image import Raw
from motion_transfer.media.stream import IuvStream

ARRAY_SUFFIXES = (".npy", ".npz")
ARRAY_SHAPES = (
    "an IUV array is uint8, [N x] H x W x 3 or [N x] 3 x H x W; global UV is floats,"
    " [N x] H x W x 2"
)


class _ArrayFrames(IuvStream):
    """What one file and a folder of files have in common: frames of IUV or of global UV.

    Attributes:
        largest_distance_texels: from global UV to the nearest table entry, in the frames read so
            far; see `global_uv.global_to_iuv`.
    """

    def __init__(self, path: Path, kind: str, frame_count: int, *, holds_global_uv: bool) -> None:
        super().__init__(path, kind.format("global UV" if holds_global_uv else "IUV"), frame_count)
        self.largest_distance_texels = 0.0
        self.holds_global_uv = holds_global_uv
        if holds_global_uv:
            self.order = "iuv"
            self.notes = (
                "global UV does not say the part: each pixel takes the nearest entry of the chart"
                " table",
            )
            self._check_scale()

    @abstractmethod
    def _frame(self, index: int) -> np.ndarray:
        """H x W x 3 uint8, or H x W x 2 floats where the stream holds global UV."""

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            frame = self._frame(index)
            if frame.shape[-1] == 2:
                frame, distance = global_to_iuv(frame, self.where(index))
                self.largest_distance_texels = max(self.largest_distance_texels, distance)
            yield np.ascontiguousarray(frame)

    def _check_scale(self) -> None:
        """Hold the first frame that shows somebody to CBI's scale."""
        for index in range(self.frame_count):
            frame = self._frame(index)
            if not np.isnan(frame).all():
                check_scale(frame, self.where(index))
                return


class ArrayStream(_ArrayFrames):
    """One file with a stack of frames or a single one, mapped rather than loaded.

    uint8 with three channels is IUV, also the quantised results of detectron2 (3 x H x W); floats
    with two channels are global UV (see `global_uv`).
    """

    def __init__(self, path: Path) -> None:
        self._stack = _as_stack(map_array(path), path)
        super().__init__(
            path, "{} array", len(self._stack), holds_global_uv=self._stack.shape[-1] == 2
        )

    def where(self, index: int) -> str:
        return f"frame {index} of {self.path}"

    def _frame(self, index: int) -> np.ndarray:
        return self._stack[index]


class ArrayFolder(_ArrayFrames):
    """A folder with one array for each frame; `blank` frames show nobody."""

    def __init__(
        self, path: Path, files: list[Path], gaps: tuple[int, ...], blank: frozenset[int]
    ) -> None:
        self._files = files
        self._blank = blank
        first = _as_stack(map_array(files[0]), files[0])
        super().__init__(
            path, "folder of {} arrays", len(files), holds_global_uv=first.shape[-1] == 2
        )
        self.gaps = gaps

    def where(self, index: int) -> str:
        return f"frame {index}, {self._files[index]}"

    def _frame(self, index: int) -> np.ndarray:
        path = self._files[index]
        stack = _as_stack(map_array(path), path)
        if len(stack) != 1 or (stack.shape[-1] == 2) != self.holds_global_uv:
            raise IuvFileError(
                f"{self.where(index)} holds {stack.dtype} {list(stack.shape)}; every file of the"
                " folder must hold one frame, of the same kind as the first"
            )
        return np.zeros((*stack.shape[1:3], 3), np.uint8) if index in self._blank else stack[0]


def map_array(path: Path) -> np.ndarray:
    """The array of a `.npy`, or the only one of a `.npz`, mapped from disk.

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
            unpacked = Path(folder) / "iuv.npy"  # unlinked at once; the mapping keeps it alive
            with archive.open(name) as packed, unpacked.open("wb") as file:
                shutil.copyfileobj(packed, file)
            return np.load(unpacked, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise IuvFileError(f"driver {path} is not a whole NumPy array: {error}") from error


def _as_stack(array: np.ndarray, path: Path) -> np.ndarray:
    """N x H x W x 3 (IUV) or N x H x W x 2 (global UV). Raises: IuvFileError for anything else."""
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
