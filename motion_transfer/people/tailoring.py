"""Panels of cloth made into textures: folds, seams, hems, plackets, pockets, prints.

Convention: while it is worked on, a panel is sRGB H x W x 3 float32 with a relief H x W in metres;
the finished texture is linear, H x W x 4, as `Material` wants it.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.cuts import Places
from motion_transfer.people.fabrics import Colour

_TILE = 640  # texels; larger than any panel's side


def _linear_table() -> np.ndarray:
    value = np.arange(256) / 255
    table = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return table.astype(np.float32)[None]


_LINEAR = _linear_table()


def linear(colours: Float32[np.ndarray, "H W 3"]) -> Float32[np.ndarray, "H W 3"]:
    """sRGB 0..1 to linear, through eight bits."""
    return cv2.LUT(cv2.convertScaleAbs(colours, alpha=255), _LINEAR)


@cache
def crease_tiles() -> np.ndarray:
    """Reliefs of creased cloth, tiles x _TILE x _TILE, deviation 1, ridges in several directions."""
    rng = np.random.default_rng(20)
    tiles = []
    for angle in (20, -25, 65, -60, 5, 90):
        waves = np.zeros((_TILE, _TILE), np.float32)
        for along, across, gain in ((40, 7, 1.0), (22, 3.5, 0.35)):
            noise = rng.normal(size=(_TILE * 2, _TILE * 2)).astype(np.float32)
            noise = cv2.GaussianBlur(noise, (0, 0), sigmaX=along, sigmaY=across)
            turn = cv2.getRotationMatrix2D((_TILE, _TILE), angle, 1)
            noise = cv2.warpAffine(noise, turn, (2 * _TILE, 2 * _TILE))
            noise = noise[_TILE // 2 : -_TILE // 2, _TILE // 2 : -_TILE // 2]
            noise /= noise.std()
            waves += gain * (np.sqrt(noise**2 + 0.05) - 0.8)  # rounded ridges
        tiles.append(waves / waves.std())
    return np.stack(tiles)


def creases(shape: tuple[int, int], rng: np.random.Generator) -> Float32[np.ndarray, "H W"]:
    """A relief of creased cloth of deviation about 1."""
    height, width = shape
    tiles = crease_tiles()
    out = np.zeros(shape, np.float32)
    for gain in (0.8, 0.6):
        tile = tiles[rng.integers(len(tiles))]
        y, x = rng.integers(_TILE - height + 1), rng.integers(_TILE - width + 1)
        out += gain * tile[y : y + height, x : x + width]
    return out


class Panel:
    """A garment's panel while it is decorated.

    Attributes:
        colours: H x W x 3 sRGB, changed in place.
        relief: H x W metres, changed in place.
    """

    def __init__(self, colours: Float32[np.ndarray, "H W 3"]) -> None:
        self.colours = np.ascontiguousarray(colours)
        self.relief = np.zeros(colours.shape[:2], np.float32)

    def tint(self, cover: np.ndarray, colour: Colour) -> None:
        """Lay a colour over, `cover` (H x W, 0..1) of the way."""
        rows, columns = _box(cover)
        if rows is None:
            return
        part = self.colours[rows, columns]
        part += cover[rows, columns, None] * (np.float32(colour) - part)

    def dim(self, cover: np.ndarray, share: float) -> None:
        """Darken by a share where `cover` is 1."""
        rows, columns = _box(cover)
        if rows is None:
            return
        self.colours[rows, columns] *= 1 - np.float32(share) * cover[rows, columns, None]

    def raise_by(self, cover: np.ndarray, metres: float) -> None:
        """Lift where `cover` is 1."""
        self.relief += np.float32(metres) * cover

    def texture(self) -> Float32[np.ndarray, "H W 4"]:
        """The finished texture."""
        return cv2.merge([*cv2.split(linear(self.colours)), self.relief])


def _box(cover: np.ndarray) -> tuple[slice | None, slice]:
    """Rows and columns outside of which `cover` is 0; None for nothing at all."""
    rows = np.flatnonzero(cover.max(1) > 0)
    if len(rows) == 0:
        return None, slice(0, 0)
    columns = np.flatnonzero(cover[rows[0] : rows[-1] + 1].max(0) > 0)
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def band(distance: np.ndarray, start: float, end: float, soft: float = 0.003) -> np.ndarray:
    """1 where start < distance < end, with edges `soft` metres wide; 0..1."""
    inside = np.minimum(distance - np.float32(start), np.float32(end) - distance)
    return np.clip(inside * np.float32(1 / soft) + 0.5, 0, 1)


def line(distance: np.ndarray, place: float, width: float = 0.004) -> np.ndarray:
    """A line where a distance takes a value; 0..1."""
    return band(distance, place - width / 2, place + width / 2)


def front_of(at: Places) -> np.ndarray:
    """1 on the front of the trunk, 0 on back and sleeves."""
    return ((at.y < -0.03) & (at.on_arm < 0.5)).astype(np.float32)


def disc(at: Places, x: float, z: float, radius: float) -> np.ndarray:
    """1 inside a circle on the front, seen from the front."""
    away = np.sqrt((at.x - np.float32(x)) ** 2 + (at.z - np.float32(z)) ** 2)
    return band(away, -1, radius) * front_of(at)


def box(at: Places, x: tuple[float, float], z: tuple[float, float]) -> np.ndarray:
    """Distance inside a rectangle seen from the front or the back, metres."""
    across = np.minimum(at.x - np.float32(x[0]), np.float32(x[1]) - at.x)
    return np.minimum(across, np.minimum(at.z - np.float32(z[0]), np.float32(z[1]) - at.z))
