"""IUV in NumPy files: a stack of frames, or a folder with one array for each.

uint8 with three channels is IUV, also the quantised results of detectron2 (3 x H x W); floats with
two channels are global UV (see `global_uv`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from motion_transfer.errors import IuvFileError
from motion_transfer.media.iuv.array_file import ArrayFile
from motion_transfer.media.iuv.global_uv import check_scale, global_to_iuv
from motion_transfer.media.iuv.stream import IuvStream, Raw


class ArrayStream(IuvStream):
    """One file with a stack of frames or a single one (`files` None), or a folder with an array for
    each frame.
    """

    def __init__(self, path: Path, files: list[Path] | None = None) -> None:
        self._files = files
        self._stack = ArrayFile(files[0] if files else path)
        self._holds_global_uv = self._stack.shape[-1] == 2
        self._largest_distance_texels = 0.0
        what = "global UV" if self._holds_global_uv else "IUV"
        kind = f"folder of {what} arrays" if files else f"{what} array"
        super().__init__(path, kind, len(files) if files else len(self._stack))
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
        """Read H x W x 3 uint8, or H x W x 2 floats where the stream holds global UV."""
        where = self.where(index)
        if self._files is None:
            return self._stack.read(index, where)
        stack = ArrayFile(self._files[index])
        if len(stack) != 1 or (stack.shape[-1] == 2) != self._holds_global_uv:
            raise IuvFileError(
                f"{where} holds {stack.dtype} {list(stack.shape)}; every file of the folder must"
                " hold one frame, of the same kind as the first"
            )
        return stack.read(0, where)

    def _check_scale(self) -> None:
        for index in range(self.frame_count):
            frame = self._frame(index)
            if not np.isnan(frame).all():  # a frame that shows nobody says nothing of the scale
                check_scale(frame, self.where(index))
                return
