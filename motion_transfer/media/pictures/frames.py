"""Pictures that are at hand already, as a stream."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.pictures.stream import Frame, PictureStream


class FramePictures(PictureStream):
    """An array of RGB frames."""

    def __init__(
        self, frames: UInt8[np.ndarray, "N H W 3"], name: Path, frame_rate: Fraction | None = None
    ) -> None:
        """Take frames; `name` is what messages call them."""
        super().__init__(name, len(frames), *frames.shape[1:3])
        self._frames = frames
        self.frame_rate = frame_rate

    def read(self) -> Iterator[Frame]:
        yield from map(np.ascontiguousarray, self._frames)
