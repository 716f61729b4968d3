"""Pictures laid over surfaces: photographed cloth, skin and hair, shared by all who wear them.

Where a painted texture is made for one person, in floats and no larger than is seen of it, such a
picture is one of a folder's, and stays the bytes of its file however many people it dresses. It is
kept at several sizes (a mip pyramid), so that cloth far away has no grain.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

LEVELS = 4
"""Sizes kept of a picture: whole, a half, a quarter, an eighth."""

MULTIPLE = 2 ** (LEVELS - 1)
"""Sides are multiples of it, so that each size is exactly half of the one before."""

Colour = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture at LEVELS sizes.

    Attributes:
        height, width: Of the largest, texels.
        texels: Red, green, blue (sRGB) and alpha, row by row, the sizes one after the other.
    """

    height: int
    width: int
    texels: UInt8[np.ndarray, "N 4"]

    @classmethod
    def of(cls, rgba: UInt8[np.ndarray, "H W 4"]) -> Picture:
        """Make the smaller sizes; sides that do not halve well are stretched a little first.

        Colours under what is transparent are replaced by those around, or dark rims would show.
        """
        height, width = (
            max(MULTIPLE, round(side / MULTIPLE) * MULTIPLE) for side in rgba.shape[:2]
        )
        if rgba.shape[:2] != (height, width):
            rgba = cv2.resize(rgba, (width, height), interpolation=cv2.INTER_LINEAR)
        if rgba[..., 3].min() < 255:
            rgba = _bled(rgba)
        sizes = [np.ascontiguousarray(rgba)]
        while len(sizes) < LEVELS:
            rows, columns = sizes[-1].shape[:2]
            half = (columns // 2, rows // 2)
            sizes.append(cv2.resize(sizes[-1], half, interpolation=cv2.INTER_AREA))
        return cls(height, width, np.concatenate([size.reshape(-1, 4) for size in sizes]))

    @property
    def whole(self) -> UInt8[np.ndarray, "H W 4"]:
        """The largest size."""
        return self.texels[: self.height * self.width].reshape(self.height, self.width, 4)


def _bled(rgba: UInt8[np.ndarray, "H W 4"]) -> UInt8[np.ndarray, "H W 4"]:
    """Spread the colours of what is opaque over what is not, alpha as it was."""
    weight = (rgba[..., 3:] > 127).astype(np.float32)
    colour = rgba[..., :3] * weight
    # each round fills twice as far as the one before, and only what is empty still
    for reach in (3, 7, 15, 31, 63):
        size = (reach, reach)
        around = cv2.blur(weight[..., 0], size)[..., None]
        spread = cv2.blur(colour, size) / np.maximum(around, 1e-6)
        empty = weight == 0
        colour = np.where(empty & (around > 1e-5), spread, colour)
        weight = np.where(empty & (around > 1e-5), np.float32(1), weight)
    return np.concatenate([np.rint(colour).clip(0, 255).astype(np.uint8), rgba[..., 3:]], 2)


@dataclass(frozen=True, eq=False)
class Overlay:
    """A picture over a piece, and what is changed of it there.

    Attributes:
        picture: Over all texture coordinates of the piece.
        normals: Directions of the surface in its tangent space: red along u, green against v, blue
            outward; None: those of the geometry.
        gain: Multiplies the colours, sRGB.
        tint: What becomes of the mean colour, sRGB; brighter texels become brighter than it.
        tint_share: How much of that, 0 leaves the picture's colours.
        mean: The mean brightness of what the piece shows, in (0, 1].
        contrast: How much of the picture's differences in brightness a tint keeps.
        cut_out: The picture's alpha says where the piece is.
    """

    picture: Picture
    normals: Picture | None = None
    gain: Colour = (1.0, 1.0, 1.0)
    tint: Colour = (0.0, 0.0, 0.0)
    tint_share: float = 0.0
    mean: float = 1.0
    contrast: float = 1.0
    cut_out: bool = False


def mean_brightness(picture: Picture, corner_uv: Float32[np.ndarray, "F 3 2"]) -> float:
    """Measure how bright the opaque part of what some triangles show is, in (0, 1]."""
    whole = picture.whole
    size = np.array([picture.width, picture.height])
    column, row = np.clip(corner_uv.mean(1) * size, 0, size - 1).astype(int).T
    seen = whole[row, column]
    opaque = seen[seen[:, 3] > 127]
    chosen = opaque if len(opaque) else seen
    return max(float(chosen[:, :3].mean()) / 255, 0.03) if len(chosen) else 1.0
