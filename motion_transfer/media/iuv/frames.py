"""IUV frames that are at hand already, as a stream."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.iuv.stream import IuvStream, Raw


class FrameStream(IuvStream):
    """An array of frames; one that is mapped from a file is read as it is needed."""

    def __init__(self, frames: UInt8[np.ndarray, "N H W 3"], name: Path) -> None:
        """Take frames; `name` is what messages call them."""
        super().__init__(name, "array in memory", len(frames))
        self._frames = frames

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        yield from map(np.ascontiguousarray, self._frames[start:stop])
