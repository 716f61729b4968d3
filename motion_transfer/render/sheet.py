"""A contact sheet: a dozen frames of a run on one picture."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.image import read_photo, write_png

SHEET_FRAMES = 12
SHEET_COLUMNS = 4
THUMBNAIL_PX = 320


class ContactSheet:
    """Collects thumbnails of evenly spread frames in a folder, from any thread or process."""

    def __init__(self, folder: Path, frame_count: int) -> None:
        count = min(SHEET_FRAMES, frame_count)
        self._folder = folder
        self._wanted = {
            int(index) for index in np.linspace(0, frame_count - 1, count).round().astype(int)
        }

    def offer(self, index: int, frame: UInt8[np.ndarray, "H W 3"]) -> None:
        """Keep a frame if it is one of the wanted; in any order."""
        if index in self._wanted:
            scale = min(1, THUMBNAIL_PX / max(frame.shape[:2]))
            size = (max(1, round(frame.shape[1] * scale)), max(1, round(frame.shape[0] * scale)))
            write_png(self._path(index), cv2.resize(frame, size, interpolation=cv2.INTER_AREA))

    def picture(self) -> UInt8[np.ndarray, "H W 3"]:
        """The sheet; every wanted frame must have been offered."""
        images = [read_photo(self._path(index)).rgb for index in sorted(self._wanted)]
        blank = np.full_like(images[0], 255)
        columns = min(SHEET_COLUMNS, len(images))
        images += [blank] * (-len(images) % columns)
        rows = [np.hstack(images[i : i + columns]) for i in range(0, len(images), columns)]
        return np.vstack(rows)

    def _path(self, index: int) -> Path:
        return self._folder / f"thumbnail_{index:06d}.png"
