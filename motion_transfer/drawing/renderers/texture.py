"""The renderer without a network: the texture is completed, looked up, and softly cut out.

What the source hides takes the colour of its mirror image: first the other side of the body, then
the other face of the same limb. What is left takes the colours around it on the body's surface.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from motion_transfer.drawing.engines.interface import Occupied
from motion_transfer.drawing.hidden import show_hidden
from motion_transfer.drawing.renderers.interface import Appearance
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.textures import mirror_texture, pick_nearest
from motion_transfer.drawing.unfolding import smooth_coordinates
from motion_transfer.media.nearest import nearest_points
from nhrr_core import PART_GROUPS, load_uv_tables
from nhrr_core.uv_tables import TWIN_SIZE

TEXTURE_SIZE = 256
NEIGHBOURS = 12  # seen texels that a hidden one is mixed from; chosen by eye
OWN_SHARE = 0.05  # of a limb's texels: with fewer known, its own colours say too little
REFLECTION_METRES = 0.05  # patterns continue so far, then fade over as much again
NEAR_METRES = 0.01  # distances below this count alike, so that a single texel cannot dominate
EDGE_BLUR_SHARE = 1 / 180  # of the crop's side: the width over which the outline fades


@dataclass(frozen=True)
class TextureRecipe:
    """Makes `TextureRenderer`s: nothing has to be loaded."""

    name = "texture"
    content = ""
    execution = device = "cpu"
    texture_size = TEXTURE_SIZE
    occupies: Occupied = "nothing"

    def facts(self) -> dict[str, Any]:
        return {}

    def working_size(self, window_side: int) -> int:
        return window_side

    def make_ready(self, window_sides: Collection[int]) -> None:
        pass

    def appearance_of(self, source: Source) -> Appearance:
        worn = show_hidden(source)
        completed = complete_texture(worn.texture, worn.visibility)
        levels = np.rint((completed + 1) * 127.5).clip(0, 255).astype(np.uint8)
        return np.ascontiguousarray(levels.transpose(1, 2, 0))

    def renderer(self, appearance: Appearance) -> TextureRenderer:
        assert isinstance(appearance, np.ndarray)
        return TextureRenderer(appearance)


class TextureRenderer:
    """Draws a source by looking each pixel up in its completed texture, bilinearly."""

    name = "texture"
    occupies: Occupied = "nothing"
    feature_channels = 0

    def __init__(self, texture: UInt8[np.ndarray, "256 256 3"]) -> None:
        self._texture = texture

    def working_size(self, window_side: int) -> int:
        return window_side

    def batch_size(self, side: int) -> int:
        return 1

    def render(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S 4"]:
        pictures = np.zeros((*iuv.shape[:-1], 4), np.uint8)
        for index in range(len(iuv)):
            self._draw(pictures[index], iuv[index])
        return pictures

    def feature_image(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> Float[np.ndarray, "B D S S"]:
        raise NotImplementedError("there are no features")

    def _draw(self, picture: UInt8[np.ndarray, "S S 4"], iuv: UInt8[np.ndarray, "S S 3"]) -> None:
        """Draw into an empty picture."""
        left, top, width, height = cv2.boundingRect(np.ascontiguousarray(iuv[..., 0]))
        if not width:
            return
        person = np.s_[top : top + height, left : left + width]
        # to texels, whose first one's centre lies at 0
        x, y = smooth_coordinates(iuv[person]) * np.float32(TWIN_SIZE) - np.float32(0.5)
        border = cv2.BORDER_REPLICATE
        colours = cv2.remap(self._texture, x, y, cv2.INTER_LINEAR, borderMode=border)
        body = cv2.inRange(iuv[person][..., 0], 1, 255)
        opaque = cv2.cvtColor(colours, cv2.COLOR_RGB2RGBA)
        cv2.copyTo(opaque, body, picture[person])
        picture[..., 3] = soften(picture[..., 3])


def soften(mask: UInt8[np.ndarray, "S S"]) -> UInt8[np.ndarray, "S S"]:
    """Fade a 0/255 mask inwards: colours outside it are not known, so nothing may grow."""
    width = max(1, round(mask.shape[0] * EDGE_BLUR_SHARE)) * 2 + 1
    blurred = cv2.blur(mask, (width, width))
    return cv2.min(cv2.addWeighted(blurred, 2, blurred, 0, -255), mask)


def complete_texture(
    texture: Float32[np.ndarray, "3 T T"], visibility: Float32[np.ndarray, "1 T T"]
) -> Float32[np.ndarray, "3 256 256"]:
    """Fill every texel that is not visible; visible ones pass unchanged."""
    texture, visibility = (pick_nearest(each, TWIN_SIZE) for each in (texture, visibility))
    texture, shown = mirror_texture(texture, visibility)
    seen = shown.reshape(-1) > 0
    if seen.all() or not seen.any():
        return texture
    tables = load_uv_tables()
    points, part = tables.position.reshape(-1, 3), tables.part.reshape(-1)
    values = texture.reshape(3, -1).T.copy()
    for limb in PART_GROUPS.values():
        members = np.isin(part, limb)
        given = members & seen
        if given.sum() < OWN_SHARE * members.sum():
            given = seen  # the limb shows nothing to go by: its neighbours on the body must do
        hidden = members & ~seen
        if hidden.any():
            values[hidden] = _fill(points[hidden], points[given], values[given])
    return values.T.reshape(texture.shape)


def _fill(
    hidden: Float[np.ndarray, "N 3"],
    seen: Float[np.ndarray, "M 3"],
    colours: Float[np.ndarray, "M C"],
) -> Float[np.ndarray, "N C"]:
    """Guess the colours of hidden places on the body from those of seen ones.

    Near the border of what is seen, its pattern continues by reflection at the border; further
    away only a mean of the surroundings can be told.
    """
    distance, nearest = nearest_points(seen, hidden, NEIGHBOURS)
    weight = 1 / np.maximum(distance, NEAR_METRES) ** 2
    weight /= weight.sum(1, keepdims=True)
    mean = np.einsum("nk,nkc->nc", weight, colours[nearest])
    border = np.einsum("nk,nkc->nc", weight, seen[nearest])
    reflected = colours[nearest_points(seen, 2 * border - hidden)[1][:, 0]]
    blend = np.clip(2 - distance[:, :1] / REFLECTION_METRES, 0, 1)
    return (blend * reflected + (1 - blend) * mean).astype(colours.dtype)
