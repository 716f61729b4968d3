"""Printed cloth: drawn motifs and soft random shapes, each as one repeat.

The convention is that of `fabric_repeats`.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from motion_transfer.people.fabric_repeats import Colours, Repeat, blended, span

_SHIFT = 4  # cv2 draws in sixteenths of a pixel


class _Drawing:
    """A canvas that wraps around. Coordinates are shares of its side; twice the final size."""

    def __init__(self, ground: Float32[np.ndarray, " 3"], side_texels: int) -> None:
        self.finer = 2 if side_texels < 360 else 1
        self.side = side_texels * self.finer
        self.pixels: UInt8[np.ndarray, "s s 3"] = np.empty((self.side, self.side, 3), np.uint8)
        self.pixels[:] = np.rint(ground)

    def shape(self, points: Float[np.ndarray, "N 2"], colour: Float32[np.ndarray, " 3"]) -> None:
        """Fill a closed outline."""
        for corners in self._wrapped(points, 0.01):
            cv2.fillPoly(self.pixels, [corners], _ink(colour), cv2.LINE_AA, _SHIFT)

    def line(
        self, points: Float[np.ndarray, "N 2"], width: float, colour: Float32[np.ndarray, " 3"]
    ) -> None:
        """Draw an open line; `width` is a share of the side."""
        thick = max(1, round(width * self.side))
        for corners in self._wrapped(points, width):
            cv2.polylines(
                self.pixels, [corners], False, _ink(colour), thick, cv2.LINE_AA, _SHIFT
            )

    def repeat(self, metres: float) -> Repeat:
        """The finished cloth, `metres` a side."""
        side = self.side // self.finer
        pixels = self.pixels
        if self.finer > 1:
            pixels = cv2.resize(pixels, (side, side), interpolation=cv2.INTER_AREA)
        return Repeat(pixels, metres, metres)

    def _wrapped(self, points: Float[np.ndarray, "N 2"], margin: float) -> list[np.ndarray]:
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        across = [n for n in (-1, 0, 1) if low[0] + n < 1 and high[0] + n > 0]
        down = [n for n in (-1, 0, 1) if low[1] + n < 1 and high[1] + n > 0]
        unit = self.side * (1 << _SHIFT)
        return [
            np.rint((points + (x, y)) * unit).astype(np.int32) for x in across for y in down
        ]


def _ink(colour: Float32[np.ndarray, " 3"]) -> tuple[float, float, float]:
    red, green, blue = colour.tolist()
    return (red, green, blue)


def _scattered(rng: np.random.Generator, cells: int) -> Float[np.ndarray, "N 2"]:
    """One place near the middle of each of cells x cells fields, in shares of the side."""
    rows, columns = np.mgrid[0:cells, 0:cells]
    grid = np.stack([columns + (rows % 2) * 0.5, rows], axis=-1).reshape(-1, 2)
    return (grid + rng.uniform(0.2, 0.8, grid.shape)) / cells


_TURN = np.linspace(0, 2 * np.pi, 40, endpoint=False)


def _polar(radius: np.ndarray, turn: float) -> Float[np.ndarray, "N 2"]:
    angle = _TURN + turn
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


_LEAF = np.stack(
    [
        np.concatenate([np.linspace(0, 1, 8), np.linspace(1, 0, 8)[1:-1]]),
        np.concatenate(
            [np.sin(np.linspace(0, np.pi, 8)) ** 0.8, -np.sin(np.linspace(0, np.pi, 8))[1:-1]]
        )
        * 0.24,
    ],
    axis=1,
)


def _turned(
    points: Float[np.ndarray, "N 2"], angle: float, size: float
) -> Float[np.ndarray, "N 2"]:
    cosine, sine = np.cos(angle) * size, np.sin(angle) * size
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def _shaded(colour: Float32[np.ndarray, " 3"], share: float) -> Float32[np.ndarray, " 3"]:
    """Lighter for a positive share, darker for a negative one."""
    end = 255.0 if share > 0 else 0.0
    return colour + (end - colour) * np.float32(abs(share))


def flowers(
    colours: Colours, scale: float, rng: np.random.Generator, texels_per_metre: float
) -> Repeat:
    """Blossoms `scale` across, with leaves, of one of several habits."""
    cells = 3 if scale > 0.06 else 4
    metres = scale * cells * rng.uniform(0.9, 1.3)
    drawing = _Drawing(colours[0], span(metres, texels_per_metre)[1])
    metres *= span(metres, texels_per_metre)[0]
    size = scale / metres
    cells = max(cells, round(cells * metres / (scale * cells * 1.3)))
    petals = int(rng.choice([5, 5, 6, 8, 12]))
    depth = rng.uniform(0.12, 0.4)
    heart = _shaded(colours[-1], 0.3) if len(colours) > 3 else _shaded(colours[1], -0.45)
    green = colours[2] if len(colours) > 2 else _shaded(colours[1], -0.3)
    lobes = 1 - depth + depth * np.abs(np.cos(_TURN * petals / 2)) ** 0.7
    for place in _scattered(rng, cells):
        radius = size / 2 * rng.uniform(0.55, 1.05)
        turn = rng.uniform(0, 2 * np.pi)
        bloom = colours[1] if len(colours) < 4 or rng.random() < 0.6 else colours[3]
        for _ in range(int(rng.integers(0, 3))):
            angle = rng.uniform(0, 2 * np.pi)
            leaf = place + _turned(_LEAF, angle, radius * rng.uniform(1.4, 2.0))
            drawing.shape(leaf, _shaded(green, rng.uniform(-0.2, 0.2)))
        drawing.shape(place + _polar(radius * lobes, turn), _shaded(bloom, rng.uniform(0, 0.15)))
        drawing.shape(place + _polar(radius * 0.62 * lobes, turn + 0.3), _shaded(bloom, -0.14))
        drawing.shape(place + _polar(radius * 0.22 * lobes, turn), heart)
    return drawing.repeat(metres)


def leaves(
    colours: Colours, scale: float, rng: np.random.Generator, texels_per_metre: float
) -> Repeat:
    """Fronds `scale` long, crossing."""
    metres = scale * 2.4
    periods, side = span(metres, texels_per_metre)
    metres *= periods
    drawing = _Drawing(colours[0], side)
    size = scale / metres
    fingers = int(rng.integers(5, 9))
    for place in _scattered(rng, 3 * periods):
        colour = colours[int(rng.integers(1, len(colours)))]
        colour = _shaded(colour, rng.uniform(-0.25, 0.2))
        angle = rng.uniform(0, 2 * np.pi)
        stem = np.stack([np.linspace(-0.5, 0.5, 6), 0.08 * np.linspace(-1, 1, 6) ** 2], axis=1)
        for at in np.linspace(0.1, 0.95, fingers):
            root = np.array([at - 0.5, 0.08 * (2 * at - 1) ** 2])
            length = 0.42 * np.sin(np.pi * (0.15 + 0.8 * at))
            for side_sign in (-1, 1):
                blade = _turned(_LEAF, side_sign * rng.uniform(0.7, 1.0), length) + root
                drawing.shape(place + _turned(blade, angle, size), colour)
        drawing.line(place + _turned(stem, angle, size), 0.02 * size, _shaded(colour, -0.3))
    return drawing.repeat(metres)


def leopard(
    colours: Colours, scale: float, rng: np.random.Generator, texels_per_metre: float
) -> Repeat:
    """Broken rings with a darker middle; `scale` is the distance of two rings."""
    cells = 6
    metres = scale * cells
    periods, side = span(metres, texels_per_metre)
    drawing = _Drawing(colours[0], side)
    cells *= periods
    metres *= periods
    dark = colours[1]
    middle = colours[0] * 0.65 + dark * 0.35
    for place in _scattered(rng, cells):
        wobble = 1 + 0.18 * np.sin(_TURN * 2 + rng.uniform(0, 6)) + rng.uniform(-0.15, 0.15)
        ring = _polar(0.33 / cells * wobble, rng.uniform(0, 6)) * rng.uniform(0.75, 1.25, 2)
        drawing.shape(place + ring * 0.85, middle)
        start = int(rng.integers(0, 40))
        for piece in range(int(rng.integers(2, 4))):
            first = start + piece * 14
            arc = ring[np.arange(first, first + int(rng.integers(6, 11))) % 40]
            drawing.line(place + arc, rng.uniform(0.16, 0.24) / cells, dark)
    return drawing.repeat(metres)


def abstract(
    colours: Colours, scale: float, rng: np.random.Generator, texels_per_metre: float
) -> Repeat:
    """Loose brush strokes about `scale` long."""
    metres = scale * 2.5
    periods, side = span(metres, texels_per_metre)
    metres *= periods
    drawing = _Drawing(colours[0], side)
    size = scale / metres
    for place in _scattered(rng, 4 * periods):
        colour = _shaded(colours[int(rng.integers(1, len(colours)))], rng.uniform(-0.15, 0.15))
        bend = rng.normal(0, 0.35)
        along = np.linspace(-0.5, 0.5, 7)
        stroke = np.stack([along, bend * along**2], axis=1)
        stroke = _turned(stroke, rng.normal(0.5, 0.6), size * rng.uniform(0.4, 1.1))
        drawing.line(place + stroke, size * rng.uniform(0.05, 0.2), colour)
    return drawing.repeat(metres)


def torus_noise(
    rng: np.random.Generator, cells: int, texels: int
) -> Float32[np.ndarray, "T T"]:
    """Smooth noise that wraps around: about -2..2, `cells` humps a side."""
    grid = rng.standard_normal((cells, cells), dtype=np.float32)
    grid = cv2.copyMakeBorder(grid, 2, 2, 2, 2, cv2.BORDER_WRAP)
    step = cells / texels
    matrix = np.array([[step, 0, 1.5 + step / 2], [0, step, 1.5 + step / 2]])
    return cv2.warpAffine(
        grid, matrix, (texels, texels), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    )


def _laid_over(
    ground: Float32[np.ndarray, "T T 3"],
    colour: Float32[np.ndarray, " 3"],
    height: Float32[np.ndarray, "T T"],
    texels_per_cell: float,
) -> Float32[np.ndarray, "T T 3"]:
    """Cover the ground with a colour where height > 0, with an edge about a texel wide."""
    cover = np.clip(height * texels_per_cell * 0.6 + 0.5, 0, 1)[..., None]
    return ground + (colour - ground) * cover


def camouflage(
    colours: Colours, scale: float, rng: np.random.Generator, texels_per_metre: float
) -> Repeat:
    """Overlapping blots about `scale` across."""
    cells = 6
    periods, side = span(scale * cells, texels_per_metre)
    cells *= periods
    cloth = np.broadcast_to(colours[0], (side, side, 3))
    for colour, least in zip(colours[1:], (0.0, 0.35, 0.7), strict=False):
        height = torus_noise(rng, cells, side) + 0.35 * torus_noise(rng, cells * 3, side)
        cloth = _laid_over(cloth, colour, height - least, side / cells)
    return Repeat(cv2.convertScaleAbs(cloth), scale * cells, scale * cells)


def marble(
    colours: Colours, scale: float, rng: np.random.Generator, texels_per_metre: float
) -> Repeat:
    """Veins `scale` apart."""
    cells = 5
    periods, side = span(scale * cells, texels_per_metre)
    cells *= periods
    height = torus_noise(rng, cells, side) + 0.4 * torus_noise(rng, cells * 2, side)
    height += 0.15 * torus_noise(rng, cells * 5, side)
    share = np.exp(-np.abs(height) * rng.uniform(2.5, 5.0))
    return Repeat(blended(colours, share), scale * cells, scale * cells)


def zebra(
    colours: Colours, scale: float, rng: np.random.Generator, texels_per_metre: float
) -> Repeat:
    """Forking stripes about `scale` apart."""
    bands = 8
    periods, side = span(scale * bands, texels_per_metre)
    bands *= periods
    along = (np.arange(side, dtype=np.float32) + 0.5)[:, None] * (bands / side)
    phase = along + 0.9 * torus_noise(rng, bands // 2, side)
    height = np.sin(2 * np.pi * phase) + 0.3 * torus_noise(rng, bands, side)
    ground = np.broadcast_to(colours[0], (side, side, 3))
    cloth = _laid_over(ground, colours[1], height, side / bands / 6)
    return Repeat(cv2.convertScaleAbs(cloth), scale * bands, scale * bands)
