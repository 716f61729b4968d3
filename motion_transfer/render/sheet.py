"""A contact sheet: a dozen frames of a run on one picture."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import UInt8

SHEET_FRAMES = 12
SHEET_COLUMNS = 4
THUMBNAIL_PX = 320


class ContactSheet:
    """Collects thumbnails of evenly spread frames; memory does not grow with the run."""

    def __init__(self, frame_count: int) -> None:
        count = min(SHEET_FRAMES, frame_count)
        wanted = np.linspace(0, frame_count - 1, count).round().astype(int)
        self._thumbnails: dict[int, np.ndarray | None] = {int(i): None for i in wanted}

    def offer(self, index: int, frame: UInt8[np.ndarray, "H W 3"]) -> None:
        """Keep a frame if it is one of the wanted; from any thread, in any order."""
        if index in self._thumbnails:
            scale = min(1, THUMBNAIL_PX / max(frame.shape[:2]))
            size = (max(1, round(frame.shape[1] * scale)), max(1, round(frame.shape[0] * scale)))
            self._thumbnails[index] = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)

    def picture(self) -> UInt8[np.ndarray, "H W 3"]:
        """The sheet; every wanted frame must have been offered."""
        images = [image for _, image in sorted(self._thumbnails.items()) if image is not None]
        blank = np.full_like(images[0], 255)
        columns = min(SHEET_COLUMNS, len(images))
        images += [blank] * (-len(images) % columns)
        rows = [np.hstack(images[i : i + columns]) for i in range(0, len(images), columns)]
        return np.vstack(rows)
