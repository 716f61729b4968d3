"""Where results are laid out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.render.compose import Comparison, paste
from motion_transfer.render.window import Window

Image = UInt8[np.ndarray, "H W 3"]


@dataclass(frozen=True)
class Canvas:
    """An empty output, and how a rendered crop is laid into it.

    Attributes:
        background: an empty output frame, without the comparison's other panels.
        crop: the output is the window itself, at the renderer's working size.
        comparison: adds source and IUV beside the result, if wanted.
    """

    background: Image
    crop: bool
    comparison: Comparison | None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the output."""
        height, width = self.comparison.size if self.comparison else self.background.shape[:2]
        return width, height

    def lay_out(
        self, iuv: Image, crop: Image, rgba: UInt8[np.ndarray, "S S 4"], window: Window
    ) -> Image:
        """An output frame from a target IUV, its crop, and what was rendered for the crop."""
        frame = self.background.copy()
        if self.crop:
            side = len(frame)  # of the largest shot's window; others are enlarged to it
            paste(frame, rgba, Window(0, 0, side))
            iuv = cv2.resize(crop, (side, side), interpolation=cv2.INTER_NEAREST_EXACT)
        else:
            paste(frame, rgba, window)
        return self.comparison.frame(iuv, frame) if self.comparison else frame
