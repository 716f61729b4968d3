"""Where things lie in a background, and what those who paint them share."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.people.picture.paint import smooth_noise

Rgb = tuple[int, int, int]
"""8-bit sRGB."""
Row = Float32[np.ndarray, "..."]
Rng = np.random.Generator
EVERYWHERE = slice(None)
"""All rows of a picture."""


def hsv(hue: float, saturation: float, value: float) -> Rgb:
    """Mix a colour of a hue (any number, 1 is a full turn), saturation and value (kept in 0..1)."""
    saturation, value = min(max(float(saturation), 0), 1), min(max(float(value), 0), 1)
    red, green, blue = colorsys.hsv_to_rgb(float(hue) % 1, saturation, value)
    return round(255 * red), round(255 * green), round(255 * blue)


def scaled(colour: Rgb, factor: float) -> Rgb:
    """Make a colour lighter or darker, in sRGB values."""
    red, green, blue = (min(255, max(0, round(channel * factor))) for channel in colour)
    return red, green, blue


@dataclass(frozen=True)
class View:
    """The picture and the room in it: a floor, and a wall across.

    Attributes:
        width, height: Pixels.
        horizon: Row of the camera's eye level.
        ppm: Pixels per metre where the person stands.
        wall_share: Distance of the person over that of the wall.
        camera_metres: Height of the camera above the floor.
    """

    width: int
    height: int
    horizon: float
    ppm: float
    wall_share: float
    camera_metres: float

    @property
    def wall_ppm(self) -> float:
        """Count the pixels per metre at the wall."""
        return self.ppm * self.wall_share

    @property
    def wall_row(self) -> float:
        """Find the row where the wall meets the floor."""
        return self.horizon + self.camera_metres * self.wall_ppm

    def scaled(self, factor: float) -> View:
        """Take the same view in a smaller picture."""
        width, height = (max(2, round(side * factor)) for side in (self.width, self.height))
        factor = height / self.height
        return replace(
            self, width=width, height=height, horizon=self.horizon * factor, ppm=self.ppm * factor
        )

    def row(self, metres: float) -> float:
        """Find the row of a height above the floor, at the wall."""
        return self.wall_row - metres * self.wall_ppm

    def floor_rows(self) -> slice:
        """Find the rows in which the floor is seen."""
        return slice(int(np.clip(np.ceil(self.wall_row), 0, self.height)), self.height)

    def floor_metres(self) -> tuple[Row, Row]:
        """Find places on the floor: metres across (rows x W) and from the camera (rows x 1)."""
        rows = self.floor_rows()
        below = np.arange(rows.start, rows.stop, dtype=np.float32)[:, None] + 0.5 - self.horizon
        metres_per_pixel = self.camera_metres / np.maximum(below, 1e-3)
        across = np.arange(self.width, dtype=np.float32) + 0.5 - self.width / 2
        focal = 3.5 * self.ppm  # the person stands about so many metres away
        return (metres_per_pixel * across).astype(np.float32), metres_per_pixel * focal


@dataclass
class Painting:
    """A picture being painted.

    Attributes:
        view: Where things lie in it.
        colours: The wall or sky, the floor, and two for things.
        rng: Decides what is where.
        image: 8-bit sRGB.
        lights: Bright discs to add once it is linear: x, y, radius in px, linear RGB.
    """

    view: View
    colours: tuple[Rgb, Rgb, Rgb, Rgb]
    rng: Rng
    image: UInt8[np.ndarray, "h w 3"]
    lights: list[tuple[int, int, int, tuple[float, float, float]]] = field(default_factory=list)

    @classmethod
    def start(cls, view: View, colours: tuple[Rgb, Rgb, Rgb, Rgb], rng: Rng) -> Painting:
        """Begin with a picture of nothing but the first colour."""
        return cls(view, colours, rng, np.full((view.height, view.width, 3), colours[0], np.uint8))

    def box(self, left: float, top: float, right: float, bottom: float, colour: Rgb) -> None:
        """Fill a rectangle, in px."""
        self.inside(left, top, right, bottom)[:] = colour

    def inside(self, left: float, top: float, right: float, bottom: float) -> np.ndarray:
        """Show what of a rectangle is in the picture, to be painted on; it may be nothing."""
        x0, y0, x1, y1 = (int(max(0, side)) for side in (left, top, right, bottom))
        return self.image[y0:y1, x0:x1]

    def shade_rows(self, rows: slice, factor: Row) -> None:
        """Multiply rows by factors that broadcast to rows x w."""
        part = self.image[rows]
        if part.size:
            # cv2 rounds and saturates in one pass
            factor = np.broadcast_to(factor, part.shape[:2]).astype(np.float32)
            self.image[rows] = cv2.multiply(part, cv2.merge([factor] * 3), dtype=cv2.CV_8U)

    def add_lights(self, linear: Float32[np.ndarray, "h w 3"]) -> None:
        """Draw the lights into the linear picture."""
        for x, y, radius, colour in self.lights:
            cv2.circle(linear, (x, y), radius, colour, cv2.FILLED, cv2.LINE_AA)


def smooth_shade(view: View, rng: Rng, depth: float) -> Float32[np.ndarray, "H W"]:
    """Let light fall off around a spot; it is 1 at its brightest, and loses `depth` at most."""
    y = np.linspace(-1, 1, view.height, dtype=np.float32)[:, None]
    x = np.linspace(-1, 1, view.width, dtype=np.float32)
    spot_x, spot_y = rng.normal(0, 0.5), rng.normal(-0.2, 0.4)
    away = ((x - np.float32(spot_x)) ** 2 + (y - np.float32(spot_y)) ** 2) / 4
    return 1 - np.float32(depth) * np.clip(away, 0, 1)


def cells(u: Row, v: Row, joint: tuple[float, float], rng: Rng, spread: float) -> Row:
    """Draw the brightness of bricks, tiles or boards: one number a cell, another in the joints.

    Args:
        u, v: Across and along, in cells; they broadcast. Every other row of v is shifted by half.
        joint: How much of a cell its joints take, in u and in v.
        spread: Standard deviation of the cells' brightness.
    """
    row = np.floor(v)
    shifted = u + np.float32(0.5) * (row % 2)
    column = np.floor(shifted)
    table = (1 + spread * rng.standard_normal(1024)).astype(np.float32)
    # any hash will do that gives neighbours different numbers
    index = (column * 37 + row * 101).astype(np.int32) & 1023
    brightness = table[index]
    in_joint = (shifted - column < joint[0]) | (v - row < joint[1])
    brightness[in_joint] = rng.choice([0.6, 0.75, 1.2])
    return brightness


def speckle(view: View, rng: Rng, waves: tuple[float, ...]) -> Row:
    """Draw noise of several wavelengths (shares of the height), each half as strong as the last."""
    total = np.zeros((view.height, view.width), np.float32)
    for octave, wave in enumerate(waves):
        total += 0.5**octave * smooth_noise(total.shape, max(1.5, wave * view.height), rng)
    return total
