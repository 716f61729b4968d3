"""Pictures that are printed on shirts. Each draws into the square (0, 0)..(1, 1) of a canvas.

Convention: the first ink stands out from the cloth, the others from each other. Coordinates were
drawn by eye.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from motion_transfer.people.clothes.fabrics.colours import Colour, mix
from motion_transfer.people.clothes.prints.canvas import Points, PrintCanvas

Inks = tuple[Colour, ...]
_WHITE: Colour = (0.97, 0.96, 0.94)
_DARK: Colour = (0.08, 0.08, 0.10)


def _circle(centre: tuple[float, float], radius: float, points: int = 40) -> Points:
    turn = np.linspace(0, 2 * np.pi, points, endpoint=False)
    return np.stack([centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn)], axis=1)


def _ridge(rng: Generator, level: float, height: float, sharp: bool) -> Points:
    """Outline hills or peaks from their tops down to y = 1."""
    if sharp:
        x = np.concatenate([[0], np.sort(rng.uniform(0.1, 0.9, 5)), [1]])
        y = level - height * rng.uniform(0.0, 1.0, 7) * np.array([0.2, 1, 0.3, 1, 0.4, 1, 0.2])
    else:
        x = np.linspace(0, 1, 24)
        start = rng.uniform(0, 6, 2)
        y = level - height * (0.5 + 0.35 * np.sin(5 * x + start[0]) + 0.15 * np.sin(11 * x))
    return np.concatenate([np.stack([x, y], axis=1), [[1, 1], [0, 1]]])


def _within_disc(points: Points) -> Points:
    """Draw points outside the disc about the middle in to its edge."""
    aside = points - 0.5
    far = np.linalg.norm(aside, axis=1, keepdims=True)
    return 0.5 + aside * np.minimum(1.0, 0.48 / np.maximum(far, 1e-6))


def sunset(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw a sun cut by bars over hills."""
    canvas.disc((0.5, 0.45), 0.4, inks[1])
    for bar in range(4):
        y = 0.5 + bar * 0.075
        gap = [[0, y], [1, y], [1, y + 0.012 * (bar + 1)], [0, y + 0.012]]
        canvas.polygon(np.array(gap), None)
    for layer in range(2):
        hills = _ridge(rng, 0.8 + 0.1 * layer, 0.2, sharp=False)
        hills[:, 1] = np.minimum(hills[:, 1], 0.95)
        canvas.polygon(hills, mix(inks[0], inks[2], 0.5 * (1 - layer)))


def palm(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw a palm tree before a sun."""
    if rng.random() < 0.7:
        canvas.disc((0.5, 0.45), 0.36, inks[1])
    lean = rng.uniform(-0.15, 0.15)
    rise = np.linspace(0, 1, 8)
    x, y = 0.5 - lean + lean * 1.5 * rise**1.5, 0.96 - 0.62 * rise
    half = 0.028 - 0.014 * rise
    trunk = np.stack([np.append(x - half, (x + half)[::-1]), np.append(y, y[::-1])], axis=1)
    canvas.polygon(trunk, inks[0])
    reach = np.linspace(0, 1, 10)
    for angle in np.linspace(-2.9, -0.2, 7) + rng.normal(0, 0.08, 7):
        length = rng.uniform(0.32, 0.42)
        spine_x = x[-1] + length * reach * np.cos(angle)
        spine_y = y[-1] + length * (reach * np.sin(angle) * 0.8 + 0.75 * reach**2)
        broad = 0.05 * np.sin(np.pi * reach**0.7)
        upper, lower = spine_y - broad, spine_y + broad * 0.5
        blade = [np.append(spine_x, spine_x[::-1]), np.append(upper, lower[::-1])]
        canvas.polygon(np.stack(blade, axis=1), inks[0])
    ground = np.array([[0.18, 0.98], [0.5, 0.9], [0.82, 0.98]])
    canvas.polygon(ground, inks[2])


def cat(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw a cat's face."""
    fur, dark = inks[0], inks[1]
    for side in (-1, 1):
        ear = np.array([[0.12, 0.45], [0.36, 0.22], [0.10, 0.02]])
        inner = np.array([[0.16, 0.36], [0.30, 0.24], [0.14, 0.11]])
        for points, ink in ((ear, fur), (inner, inks[2])):
            canvas.polygon(np.stack([0.5 + side * (0.5 - points[:, 0]), points[:, 1]], 1), ink)
    head = _circle((0.5, 0.55), 0.42)
    head[:, 1] = 0.55 + (head[:, 1] - 0.55) * 0.9
    canvas.polygon(head, fur)
    wide = rng.uniform(0.05, 0.085)
    for side in (-1, 1):
        x = 0.5 + side * 0.17
        canvas.disc((x, 0.5), wide, dark)
        canvas.disc((x + 0.02, 0.48), wide * 0.3, _WHITE)
        for tilt in (-0.05, 0.0, 0.05):
            whisker = [[0.5 + side * 0.14, 0.66 + tilt * 0.3], [0.5 + side * 0.44, 0.64 + tilt]]
            canvas.line(np.array(whisker), 0.012, dark)
        mouth = np.linspace(0, np.pi, 8)
        points = [0.5 + side * (0.05 - 0.05 * np.cos(mouth)), 0.66 + 0.05 * np.sin(mouth)]
        canvas.line(np.stack(points, axis=1), 0.014, dark)
    canvas.polygon(np.array([[0.45, 0.6], [0.55, 0.6], [0.5, 0.66]]), inks[2])


def star(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw a star, with or without a contour."""
    turn = np.arange(10) * np.pi / 5 - np.pi / 2
    inner = rng.uniform(0.38, 0.5)
    for size, ink in ((0.48, inks[0]), (0.36, inks[1])):
        radius = np.where(np.arange(10) % 2, inner, 1.0) * size
        points = [0.5 + radius * np.cos(turn), 0.52 + radius * np.sin(turn)]
        canvas.polygon(np.stack(points, axis=1), ink)
        if rng.random() < 0.5:
            return


def heart(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw a heart, with or without a contour."""
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    x = np.sin(turn) ** 3
    y = -(13 * np.cos(turn) - 5 * np.cos(2 * turn) - 2 * np.cos(3 * turn) - np.cos(4 * turn)) / 16
    for size, ink in ((0.48, inks[0]), (0.4, inks[1])):
        canvas.polygon(np.stack([0.5 + size * x, 0.46 + size * y], axis=1), ink)
        if rng.random() < 0.6:
            return


def mountain(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw peaks with snow in a round badge."""
    canvas.disc((0.5, 0.5), 0.48, inks[0])
    canvas.disc((0.5, 0.5), 0.45, inks[1])
    canvas.disc((rng.uniform(0.3, 0.7), 0.3), 0.09, inks[2])
    for x, top, ink in ((0.33, 0.42, inks[2]), (0.62, 0.28, inks[0])):
        slope = np.linspace(0, 1, 12)[:, None]
        left = np.array([x, top]) + slope * np.array([-0.45, 0.6])
        right = np.array([x, top]) + slope * np.array([0.45, 0.6])
        canvas.polygon(_within_disc(np.concatenate([left[::-1], right])), ink)
        snow = [[0, 0], [0.09, 0.12], [0.04, 0.1], [0, 0.14], [-0.05, 0.1], [-0.09, 0.12]]
        canvas.polygon(np.array(snow) + (x, top), _WHITE)  # noqa: RUF005


def wave(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw rolling waves under a disc."""
    canvas.disc((rng.uniform(0.3, 0.7), 0.36), 0.22, inks[1])
    x = np.linspace(0, 1, 40)
    for layer in range(4):
        level = 0.48 + 0.12 * layer
        phase = (x * 3 + layer * 0.4) % 1
        crest = level - 0.09 * np.sin(np.pi * phase) ** 3
        ink = (inks[0], inks[2])[layer % 2]
        under = np.stack([np.append(x, x[::-1]), np.append(crest, crest[::-1] + 0.09)], axis=1)
        canvas.polygon(under, ink)


def shapes(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw overlapping discs, bars and triangles."""
    for _ in range(int(rng.integers(4, 8))):
        ink = inks[int(rng.integers(len(inks)))]
        x, y = rng.uniform(0.2, 0.8, 2).tolist()
        size = rng.uniform(0.08, 0.2)
        corners = int(rng.choice([3, 4, 40]))
        outline = _circle((0, 0), size, corners)
        turn = rng.uniform(0, np.pi)
        cosine, sine = np.cos(turn), np.sin(turn)
        stretch = np.array([1.0, rng.choice([0.25, 1.0]) if corners == 4 else 1.0])
        outline = (outline * stretch) @ np.array([[cosine, sine], [-sine, cosine]])
        canvas.polygon(np.add(outline, (x, y)), ink)


def scene(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw a framed landscape: graded sky, a sun, ridges."""
    canvas.box(0.02, 0.02, 0.98, 0.98, inks[0])
    high, low = inks[1], mix(inks[2], _WHITE, 0.5)
    for row in np.linspace(0, 1, 14)[:-1]:
        canvas.box(0.07, 0.07 + 0.86 * row, 0.93, 0.93, mix(high, low, min(1.0, 1.3 * row)))
    canvas.disc((rng.uniform(0.3, 0.7), rng.uniform(0.28, 0.42)), rng.uniform(0.07, 0.13), _WHITE)
    sharp = bool(rng.random() < 0.6)
    for layer in range(3):
        ridge = _ridge(rng, 0.6 + 0.12 * layer, 0.28, sharp)
        ridge = 0.07 + 0.86 * np.clip(ridge, 0, 1)
        canvas.polygon(ridge, mix(inks[2], _DARK, 0.25 + 0.3 * layer))


def flower(canvas: PrintCanvas, inks: Inks, rng: Generator) -> None:
    """Draw one large blossom on a stem."""
    stem = np.array([[0.5, 0.4], [0.52, 0.7], [0.48, 0.98]])
    green = mix(inks[2], (0.2, 0.4, 0.2), 0.6)
    canvas.line(stem, 0.03, green)
    for side in (-1, 1):
        leaf = np.array([[0.0, 0.0], [0.12, -0.12], [0.28, -0.14], [0.18, -0.01]])
        canvas.polygon(np.add(leaf * (side, 1), (0.5, 0.85)), green)
    petals = int(rng.integers(5, 9))
    for turn in np.arange(petals) * 2 * np.pi / petals:
        centre = (0.5 + 0.19 * np.cos(turn), 0.36 + 0.19 * np.sin(turn))
        canvas.disc(centre, 0.62 / petals, inks[0])
    canvas.disc((0.5, 0.36), 0.11, inks[1])


PICTURES: dict[str, Callable[[PrintCanvas, Inks, Generator], None]] = {
    paint.__name__: paint
    for paint in (sunset, palm, cat, star, heart, mountain, wave, shapes, scene, flower)
}
"""Name of a picture -> what paints it."""
