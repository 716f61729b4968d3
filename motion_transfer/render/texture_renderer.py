"""The renderer that needs no weights: the completed texture, looked up and softly cut out."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from jaxtyping import UInt8

from motion_transfer.render.completion import complete_texture
from motion_transfer.render.renderer import Occupied
from motion_transfer.render.source import Source
from nhrr_core import load_uv_layout, sample_features
from nhrr_core.iuv import PART_COUNT
from nhrr_core.uv_layout import CHART_SIZE

EDGE_BLUR_SHARE = 1 / 180  # of the crop's side: the width over which the outline fades


class TextureRenderer:
    """Draws a source by looking up each (I, U, V) in a table of its 25 x 256 x 256 colours.

    8-bit IUV has no more values than that, so the texture is sampled once per source, by the same
    sampler as the network's, and a frame costs one look-up a pixel.
    """

    name = "texture"
    batch_size = 1
    occupies: Occupied = "nothing"

    def __init__(self, table: UInt8[np.ndarray, "25 256 256 4"]) -> None:
        self._table = table.view(np.uint32).reshape(-1)

    def working_size(self, window_side: int) -> int:
        return window_side

    def render(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S 4"]:
        return np.stack([self._draw(crop) for crop in iuv])

    def _draw(self, iuv: UInt8[np.ndarray, "S S 3"]) -> UInt8[np.ndarray, "S S 4"]:
        index = cv2.transform(iuv.astype(np.float32), CODE_WEIGHTS).astype(np.int32)
        rgba = self._table.take(index).view(np.uint8).reshape(*iuv.shape[:2], 4)
        rgba[..., 3] = soften(rgba[..., 3])
        return rgba


def tabulate_texture(source: Source) -> UInt8[np.ndarray, "25 256 256 4"]:
    """RGB of every (I, V, U) of a source's completed texture, and coverage: 0 for part 0."""
    layout = load_uv_layout()
    texture = complete_texture(source.texture, source.visibility, layout)
    v, u = np.mgrid[:CHART_SIZE, :CHART_SIZE].astype(np.uint8)
    codes = np.stack([np.stack([np.full_like(u, i), u, v]) for i in range(PART_COUNT + 1)])
    colours = sample_features(texture, torch.from_numpy(codes), layout.charts)
    table = np.zeros((PART_COUNT + 1, CHART_SIZE, CHART_SIZE, 4), np.uint8)
    table[..., :3] = ((colours + 1) * 127.5).round().clamp(0, 255).permute(0, 2, 3, 1).numpy()
    table[1:, ..., 3] = 255
    return table


CODE_WEIGHTS = np.array([[CHART_SIZE**2, 1, CHART_SIZE]], np.float32)
"""(I, U, V) to its row in the table; below 2**24, hence exact in float32."""


def soften(mask: UInt8[np.ndarray, "S S"]) -> UInt8[np.ndarray, "S S"]:
    """Fade a 0/255 mask inwards: colours outside it are not known, so nothing may grow."""
    width = max(1, round(mask.shape[0] * EDGE_BLUR_SHARE)) * 2 + 1
    blurred = cv2.blur(mask, (width, width))
    return cv2.min(cv2.addWeighted(blurred, 2, blurred, 0, -255), mask)
