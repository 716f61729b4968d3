"""Panels of cloth made into textures: folds, seams, hems, plackets, pockets, prints.

Convention: while it is worked on, a panel is sRGB H x W x 3 float32 with a relief H x W in metres;
the finished texture is linear, H x W x 4, as `Material` wants it.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32
from numpy.random import Generator

from motion_transfer.people.clothes.cuts import Places
from motion_transfer.people.clothes.fabrics import Colour

_TILE = 640  # texels; larger than any panel's side
_FURROW = 0.0008  # metres, of a seam

_SRGB = np.arange(256) / 255
_LINEAR = np.where(_SRGB <= 0.04045, _SRGB / 12.92, ((_SRGB + 0.055) / 1.055) ** 2.4)
_LINEAR = _LINEAR.astype(np.float32)[None]
"""What sRGB bytes stand for (IEC 61966-2-1): for OpenCV, a table is faster than powers."""


@cache
def _crease_tiles() -> Float32[np.ndarray, "tiles H W"]:
    """Reliefs of creased cloth of deviation 1, with ridges in several directions."""
    rng = np.random.default_rng(20)  # always the same tiles; a garment's seed chooses windows
    tiles = []
    for angle in (30, -35, 65, -60, 45, 85):
        side = _TILE // 2  # the noise is drawn at a quarter of the scale: it is slow
        waves = np.zeros((_TILE, _TILE), np.float32)
        for along, across, gain in ((55, 11, 1.0), (30, 5, 0.3)):
            noise = rng.normal(size=(side, side)).astype(np.float32)
            noise = cv2.GaussianBlur(noise, (0, 0), sigmaX=along / 4, sigmaY=across / 4)
            turn = cv2.getRotationMatrix2D((side / 2, side / 2), angle, 1)
            noise = cv2.warpAffine(noise, turn, (side, side))[side // 4 : -side // 4]
            noise = noise[:, side // 4 : -side // 4]
            noise = cv2.resize(noise, (_TILE, _TILE), interpolation=cv2.INTER_CUBIC)
            noise /= noise.std()
            waves += gain * (np.sqrt(noise**2 + 0.05) - 0.8)  # rounded ridges
        tiles.append(waves / waves.std())
    return np.stack(tiles)


def creases(shape: tuple[int, int], rng: Generator, height: float) -> Float32[np.ndarray, "H W"]:
    """Make a relief of creased cloth whose deviation is about `height` metres."""
    tiles, parts = _crease_tiles(), []
    for _ in range(2):  # two of them crossed: few outfits then have the same creases
        tile = tiles[rng.integers(len(tiles))]
        y, x = (int(rng.integers(_TILE - side + 1)) for side in shape)
        parts.append(tile[y : y + shape[0], x : x + shape[1]])
    # 0.8 and 0.6 keep the deviation: their squares sum to 1
    return cv2.addWeighted(parts[0], 0.8 * height, parts[1], 0.6 * height, 0.0)


class Panel:
    """A garment's panel while it is decorated.

    Attributes:
        colours: H x W x 3 sRGB, changed in place.
        shade: H x W, by which the colours are multiplied in the end; changed in place.
        relief: H x W metres, changed in place.
    """

    def __init__(
        self,
        colours: Float32[np.ndarray, "H W 3"],
        shade: np.ndarray | None = None,
        relief: np.ndarray | None = None,
    ) -> None:
        self.colours = colours
        self.shade = np.ones(colours.shape[:2], np.float32) if shade is None else shade
        self.relief = np.zeros(colours.shape[:2], np.float32) if relief is None else relief

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in texels."""
        height, width = self.colours.shape[:2]
        return height, width

    def __getitem__(self, at: tuple[slice, slice]) -> Panel:
        """Take part of the panel; changes to it are changes to the whole."""
        return Panel(self.colours[at], self.shade[at], self.relief[at])

    def tint(self, cover: np.ndarray, colour: Colour) -> None:
        """Lay a colour over, `cover` (H x W, 0..1) of the way."""
        at = _box(cover)
        part = self.colours[at]
        part += cover[at][..., None] * (np.asarray(colour, np.float32) - part)

    def dim(self, cover: np.ndarray, share: float) -> None:
        """Darken by a share where `cover` is 1."""
        at = _box(cover)
        self.shade[at] *= 1 - np.float32(share) * cover[at]

    def raise_by(self, cover: np.ndarray, metres: float) -> None:
        """Lift where `cover` is 1."""
        at = _box(cover)
        self.relief[at] += np.float32(metres) * cover[at]

    def stitch(self, distance: np.ndarray, place: float, strength: float = 0.14) -> None:
        """Sew a seam where a distance takes a value: a dark line in a shallow furrow."""
        cover = line(distance, place, 0.005)
        self.dim(cover, strength)
        self.raise_by(cover, -_FURROW)

    def ribs(self, cover: np.ndarray, deep: float = 0.14) -> None:
        """Knit ribs along the columns where `cover` is 1."""
        ribs = (np.arange(cover.shape[1]) % 3 == 0).astype(np.float32)
        self.dim(cover * ribs, deep)

    def decal(
        self, image: Float32[np.ndarray, "h w 4"], across: np.ndarray, down: np.ndarray
    ) -> None:
        """Print an image where `across` and `down` (H x W) run from 0 to 1 over it.

        Args:
            image: sRGB and coverage, 0..1.
        """
        at = _box(((across > 0) & (across < 1) & (down > 0) & (down < 1)).astype(np.float32))
        x = across[at] * np.float32(image.shape[1]) - np.float32(0.5)
        y = down[at] * np.float32(image.shape[0]) - np.float32(0.5)
        if x.size == 0:
            return
        ink = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        part = self.colours[at]
        part += ink[..., 3:] * (ink[..., :3] - part)

    def texture(self) -> Float32[np.ndarray, "H W 4"]:
        """Finish the texture: linear RGB and relief."""
        shaded = cv2.multiply(self.colours, cv2.merge([self.shade] * 3))
        out = np.empty((*self.relief.shape, 4), np.float32)
        light = cv2.LUT(cv2.convertScaleAbs(shaded, alpha=255), _LINEAR)
        cv2.mixChannels([light, self.relief], [out], [0, 0, 1, 1, 2, 2, 3, 3])
        return out


def _box(cover: np.ndarray) -> tuple[slice, slice]:
    """Find the rows and columns outside of which `cover` is 0: details are small, panels large."""
    rows = np.flatnonzero(cover.max(1) > 0)
    if len(rows) == 0:
        return slice(0, 0), slice(0, 0)
    columns = np.flatnonzero(cover[rows[0] : rows[-1] + 1].max(0) > 0)
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def band(distance: np.ndarray, start: float, end: float, soft: float = 0.003) -> np.ndarray:
    """Cover where start < distance < end by 1, with edges `soft` metres wide; 0..1."""
    inside = np.minimum(distance - np.float32(start), np.float32(end) - distance)
    return np.clip(inside * np.float32(1 / soft) + 0.5, 0, 1)


def line(distance: np.ndarray, place: float, width: float = 0.004) -> np.ndarray:
    """Cover a line where a distance takes a value; 0..1."""
    return band(distance, place - width / 2, place + width / 2)


def front_of(at: Places) -> np.ndarray:
    """Cover the front of the trunk by 1, back and sleeves by 0."""
    return ((at.y < -0.03) & (at.on_arm < 0.5)).astype(np.float32)


def disc(at: Places, x: float, z: float, radius: float) -> np.ndarray:
    """Cover a circle on the front, seen from the front; 0..1."""
    away = np.sqrt((at.x - np.float32(x)) ** 2 + (at.z - np.float32(z)) ** 2)
    return band(away, -1, radius) * front_of(at)


def box(at: Places, x: tuple[float, float], z: tuple[float, float]) -> np.ndarray:
    """Measure the distance inside a rectangle seen from the front or the back, metres."""
    across = np.minimum(at.x - np.float32(x[0]), np.float32(x[1]) - at.x)
    return np.minimum(across, np.minimum(at.z - np.float32(z[0]), np.float32(z[1]) - at.z))
