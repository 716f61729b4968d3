"""Printed cloth: drawn motifs and soft random shapes, each as one repeat.

The convention is that of `repeats`.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Float32
from numpy.random import Generator

from motion_transfer.people.clothes.fabrics.repeats import Colours, Repeat, blended, span

_SHIFT = 4  # cv2 draws in sixteenths of a pixel

Column = Float[np.ndarray, "K 1"]
Outlines = Float[np.ndarray, "K N 2"]
"""Corners (x, y) of several shapes, in shares of the repeat's side."""


class _Drawing:
    """A canvas that wraps around. Coordinates are shares of its side."""

    def __init__(
        self, ground: Float32[np.ndarray, " 3"], metres: float, texels_per_metre: float
    ) -> None:
        self.metres, side = metres, span(metres, texels_per_metre)[1]
        self.finer = 2 if side < 130 else 1
        self.side = side * self.finer
        self.pixels = np.full((self.side, self.side, 3), np.rint(ground), np.uint8)

    def fill(self, outlines: Outlines, colours: Float[np.ndarray, "K 3"]) -> None:
        """Fill closed outlines one after another, each in its colour.

        They come all at once, because the arithmetic of one takes longer than to draw it.
        """
        unit = self.side << _SHIFT
        corners = np.rint(outlines * unit).astype(np.int32)
        low, high = corners.min(axis=1, keepdims=True), corners.max(axis=1, keepdims=True)
        # what reaches over an edge is drawn again beyond the opposite one
        moves = np.array([(x, y) for x in (-unit, 0, unit) for y in (-unit, 0, unit)], np.int32)
        seen = ((low + moves < unit) & (high + moves > 0)).all(axis=2)
        which, move = np.nonzero(seen)
        copies = corners[which] + moves[move, None]
        for points, colour in zip(copies, colours[which].tolist(), strict=True):
            cv2.fillPoly(self.pixels, [points], colour, cv2.LINE_AA, _SHIFT)

    def repeat(self) -> Repeat:
        """Finish the cloth."""
        pixels, side = self.pixels, self.side // self.finer
        if self.finer > 1:
            pixels = cv2.resize(pixels, (side, side), interpolation=cv2.INTER_AREA)
        return Repeat(pixels, self.metres, self.metres)


def _scattered(rng: Generator, cells: int, loose: float = 0.3) -> Float[np.ndarray, "K 1 2"]:
    """Choose a place in each of cells x cells fields, at most `loose` fields off their middles."""
    rows, columns = np.mgrid[0:cells, 0:cells]
    # every other row is staggered, or the eye would find columns
    grid = np.stack([columns + (rows % 2) * 0.5, rows], axis=-1).reshape(-1, 1, 2)
    return (grid + rng.uniform(0.5 - loose, 0.5 + loose, grid.shape)) / cells


_TURN = np.linspace(0, 2 * np.pi, 40, endpoint=False)
_UP = np.linspace(0, 1, 8)
_BULGE = np.sin(np.pi * _UP)
_SIDES = np.stack([_UP, _BULGE**0.8 * 0.24], 1), np.stack([_UP, -_BULGE * 0.24], 1)
_LEAF = np.concatenate([_SIDES[0], _SIDES[1][-2:0:-1]])
"""The outline of a leaf 1 long, up one side and down the other."""


def _polar(radius: Float[np.ndarray, "K N"], turn: Column) -> Outlines:
    angle = _TURN + turn
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def _turned(points: Float[np.ndarray, "*K N 2"], angle: Column, size: Column) -> Outlines:
    """Copy a shape (or shapes), each turned and scaled in its own way."""
    x, y = points[..., 0], points[..., 1]
    cosine, sine = np.cos(angle) * size, np.sin(angle) * size
    return np.stack([x * cosine - y * sine, x * sine + y * cosine], axis=-1)


def _shaded(colour: Float[np.ndarray, "*K 3"], share: Column | float) -> Float[np.ndarray, "K 3"]:
    """Make colours lighter for a positive share, darker for a negative one."""
    share = np.broadcast_to(share, (*np.shape(share)[:-1], 1))
    return colour + (np.where(share > 0, 255.0, 0.0) - colour) * np.abs(share)


def _picked(rng: Generator, colours: Colours, count: int, vary: float) -> Float[np.ndarray, "K 3"]:
    """Pick colours other than the ground, each made lighter or darker by up to `vary`."""
    chosen = colours[rng.integers(1, len(colours), count)]
    return _shaded(chosen, rng.uniform(-vary, vary, (count, 1)))


def flowers(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print blossoms `scale` across, some smaller, with leaves; of one habit."""
    cells = 3 if scale > 0.05 else 4
    metres = scale * cells * rng.uniform(0.95, 1.5)
    drawing = _Drawing(colours[0], metres, texels_per_metre)
    places = _scattered(rng, cells, 0.22)
    column = (len(places), 1)
    radius = scale / metres / 2 * rng.uniform(0.5, 1.0, column)
    turn = rng.uniform(0, 2 * np.pi, column)
    petals = int(rng.choice([5, 5, 6, 8, 12]))
    depth = rng.uniform(0.12, 0.4)
    lobes = 1 - depth + depth * np.abs(np.cos(_TURN * petals / 2)) ** 0.7

    green = colours[2] if len(colours) > 2 else _shaded(colours[1], -0.3)
    for _ in range(2):
        leaf = _turned(_LEAF, rng.uniform(0, 2 * np.pi, column), radius * 1.8)
        grown = rng.random(len(places)) < 0.6
        shades = _shaded(green, rng.uniform(-0.25, 0.2, column))
        drawing.fill((places + leaf)[grown], shades[grown])
    bloom = np.repeat(colours[1:2], len(places), axis=0)
    if len(colours) > 3:
        bloom[rng.random(len(places)) < 0.4] = colours[3]
    heart = _shaded(colours[-1], 0.3) if len(colours) > 3 else _shaded(bloom, -0.45)
    drawing.fill(places + _polar(radius * lobes, turn), _shaded(bloom, 0.1))
    drawing.fill(places + _polar(radius * 0.62 * lobes, turn + 0.3), _shaded(bloom, -0.12))
    middles = places + _polar(radius * 0.22 * np.ones(len(_TURN)), turn)
    drawing.fill(middles, np.broadcast_to(heart, (len(places), 3)))
    return drawing.repeat()


def _frond(fingers: int, rng: Generator) -> Float[np.ndarray, "N 2"]:
    """Outline a feathered leaf 1 long, its stem along x, around all its blades."""
    at = np.linspace(0.05, 0.95, fingers)[:, None]
    length = 0.45 * np.sin(np.pi * (0.15 + 0.8 * at))
    sides = []
    for sign in (1, -1):
        blades = _turned(_LEAF[::2] * (1, 0.45), rng.uniform(0.75, 0.95, (fingers, 1)), length)
        blades[..., 0] += at - 0.5
        blades[..., 1] = (blades[..., 1] + 0.01) * sign
        sides.append(blades.reshape(-1, 2)[::sign])
    return np.concatenate(sides)


def leaves(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print leaves `scale` long, crossing: feathered ones, or broad ones with a rib."""
    metres = scale * 2.4
    drawing = _Drawing(colours[0], metres, texels_per_metre)
    feathered = rng.random() < 0.6
    outline = _frond(int(rng.integers(6, 10)), rng) if feathered else _LEAF * (1, 1.1) - (0.5, 0)
    rib = np.array([[-0.5, 0.012], [-0.5, -0.012], [0.46, 0.0]])
    places = _scattered(rng, 4)
    column = (len(places), 1)
    angle = rng.uniform(0, 2 * np.pi, column)
    length = scale / metres * rng.uniform(0.6, 1.1, column)
    shades = _picked(rng, colours, len(places), 0.3)
    # Each leaf, then its rib; a rib has as many corners, most of them the same one.
    rib = np.pad(rib, ((0, len(outline) - len(rib)), (0, 0)), mode="edge")
    both = np.stack([_turned(shape, angle, length) for shape in (outline, rib)], axis=1)
    both += places[:, None]
    inks = np.stack([shades, _shaded(shades, -0.3)], axis=1)
    drawing.fill(both.reshape(-1, *outline.shape), inks.reshape(-1, 3))
    return drawing.repeat()


def leopard(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print broken rings with a darker middle; `scale` is the distance of two rings."""
    cells = 6
    metres = scale * cells
    drawing = _Drawing(colours[0], metres, texels_per_metre)
    places = _scattered(rng, cells, 0.2)
    count, steps = len(places), len(_TURN)
    lumps = np.sin(_TURN * rng.integers(2, 4, (count, 1)) + rng.uniform(0, 6, (count, 1)))
    radius = (1 + 0.15 * lumps) * rng.uniform(0.28, 0.46, (count, 1)) / cells
    rings = _polar(radius, np.zeros((1, 1))) * rng.uniform(0.8, 1.2, (count, 1, 2))
    middle = colours[0] * 0.65 + colours[1] * 0.35
    drawing.fill(places + rings[:, ::3] * 0.85, np.broadcast_to(middle, (count, 3)))
    points = 8  # of each of the three arcs that a ring is broken into
    starts = rng.integers(steps, size=(count, 1)) + np.array([0, 13, 26])
    along = (starts[..., None] + np.arange(points) * 10 // 7) % steps
    arcs = rings[np.arange(count)[:, None, None], along]
    taper = np.sin(np.linspace(0.5, np.pi - 0.5, points))[:, None]
    thick = taper * rng.uniform(0.6, 1.2, (count, 3, 1, 1))
    inner = (arcs * (1 - 0.45 * thick))[:, :, ::-1]
    spots = np.concatenate([arcs * (1 + 0.2 * thick), inner], axis=2) + places[:, None]
    spots = spots[rng.random((count, 3)) < 0.85]
    drawing.fill(spots, np.broadcast_to(colours[1], (len(spots), 3)))
    return drawing.repeat()


def abstract(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print loose brush strokes about `scale` long, in about one direction or in all."""
    metres = scale * 2.2
    drawing = _Drawing(colours[0], metres, texels_per_metre)
    places = _scattered(rng, 4)
    column = (len(places), 1)
    along = np.linspace(-0.5, 0.5, 9)
    middle = rng.normal(0, 0.5, column) * along**2
    half = rng.uniform(0.04, 0.15) * (1 - (2 * along) ** 4) ** 0.5
    half = half * rng.uniform(0.5, 1.2, column) * rng.uniform(0.8, 1.0, (len(places), 9))
    both = np.concatenate([middle + half, (middle - half)[:, ::-1]], axis=1)
    there_and_back = np.broadcast_to(np.concatenate([along, along[::-1]]), both.shape)
    strokes = _turned(
        np.stack([there_and_back, both], axis=-1),
        rng.normal(0.5, rng.choice([0.25, 3.0]), column),
        scale / metres * rng.uniform(0.4, 1.1, column),
    )
    drawing.fill(places + strokes, _picked(rng, colours, len(places), 0.15))
    return drawing.repeat()


def _torus_noise(rng: Generator, cells: int, texels: int) -> Float32[np.ndarray, "T T"]:
    """Draw smooth noise that wraps around: about -2..2, `cells` humps a side."""
    grid = rng.standard_normal((cells, cells), dtype=np.float32)
    grid = cv2.copyMakeBorder(grid, 2, 2, 2, 2, cv2.BORDER_WRAP)
    whole = max(cells + 4, round((cells + 4) * texels / cells))
    finer = min(4 * (cells + 4), whole)  # cubic is slow, and needless from there on
    noise = cv2.resize(grid, (finer, finer), interpolation=cv2.INTER_CUBIC)
    noise = cv2.resize(noise, (whole, whole), interpolation=cv2.INTER_LINEAR)
    first = round(2 * texels / cells)
    return noise[first : first + texels, first : first + texels]


def _lay_over(
    cloth: Float32[np.ndarray, "T T 3"],
    colour: Float32[np.ndarray, " 3"],
    height: Float32[np.ndarray, "T T"],
    texels_per_cell: float,
) -> None:
    """Cover cloth, in place, with a colour where height > 0, with an edge about a texel wide."""
    cover = np.clip(height * np.float32(texels_per_cell * 0.6) + np.float32(0.5), 0, 1)
    fresh = colour - cloth
    fresh *= cv2.merge([cover, cover, cover])
    cloth += fresh


def camouflage(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print overlapping blots about `scale` across."""
    cells = 4
    metres = scale * cells
    side = span(metres, texels_per_metre)[1]
    cloth = np.full((side, side, 3), colours[0], np.float32)
    for colour, least in zip(colours[1:], (0.0, 0.35, 0.7), strict=False):
        height = _torus_noise(rng, cells, side) + 0.35 * _torus_noise(rng, cells * 3, side)
        _lay_over(cloth, colour, height - np.float32(least), side / cells)
    return Repeat(cv2.convertScaleAbs(cloth), metres, metres)


def marble(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print veins `scale` apart."""
    cells = 4
    metres = scale * cells
    side = span(metres, texels_per_metre)[1]
    height = _torus_noise(rng, cells, side) + 0.4 * _torus_noise(rng, cells * 2, side)
    height += 0.15 * _torus_noise(rng, cells * 5, side)
    share = np.exp(np.abs(height) * np.float32(-rng.uniform(2.5, 5.0)))
    return Repeat(blended(colours, share), metres, metres)


def zebra(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print forking stripes about `scale` apart."""
    bands = 8
    metres = scale * bands
    side = span(metres, texels_per_metre)[1]
    along = (np.arange(side, dtype=np.float32) + 0.5)[:, None] * np.float32(bands / side)
    phase = along + 0.9 * _torus_noise(rng, bands // 2, side)
    height = np.sin(np.float32(2 * np.pi) * phase) + 0.3 * _torus_noise(rng, bands, side)
    cloth = np.full((side, side, 3), colours[0], np.float32)
    _lay_over(cloth, colours[1], height, side / bands / 6)
    return Repeat(cv2.convertScaleAbs(cloth), metres, metres)
