"""Rooms, and walls full of clutter; sizes are metres, chosen by eye as colours and chances are."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from motion_transfer.people.picture.backgrounds.view import (
    EVERYWHERE,
    Painting,
    Rgb,
    Rng,
    cells,
    hsv,
    scaled,
    smooth_shade,
    speckle,
)

WORDS = ("SALE", "NEW", "open", "26", "A", "cafe", "No. 7", "exit", "MODE", "&", "2nd", "hello")
FONTS = (cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_TRIPLEX, cv2.FONT_HERSHEY_SCRIPT_SIMPLEX)


def paint_indoor(painting: Painting) -> None:
    """Paint a wall across, things in front of it, a floor, and light from somewhere."""
    rng, view = painting.rng, painting.view
    _paint_wall(painting)
    for _ in range(rng.integers(0, 4)):
        (_window, _door, _picture, _picture)[rng.integers(4)](painting)
    _paint_floor(painting)
    for _ in range(rng.integers(0, 4)):
        (_cabinet, _sofa, _plant, _shelves, _lamp)[rng.integers(5)](painting)
    painting.shade_rows(EVERYWHERE, smooth_shade(view, rng, rng.uniform(0.1, 0.7)))


def _paint_wall(painting: Painting) -> None:
    """Paint plaster, wainscot, tiles, bricks, boards, a curtain or striped paper."""
    rng, view = painting.rng, painting.view
    style = rng.choice(["plaster", "wainscot", "tiles", "bricks", "boards", "curtain", "stripes"],
                       p=[0.3, 0.15, 0.12, 0.13, 0.1, 0.12, 0.08])  # fmt: skip
    x = ((np.arange(view.width, dtype=np.float32) + rng.uniform(0, 99)) / view.wall_ppm)[None]
    y = ((np.arange(view.height, dtype=np.float32) - view.wall_row) / view.wall_ppm)[:, None]
    if style == "plaster":
        painting.shade_rows(EVERYWHERE, 1 + 0.03 * speckle(view, rng, (0.2, 0.03)))
    elif style == "wainscot":
        top = view.wall_row - rng.uniform(0.7, 1.2) * view.wall_ppm
        painting.box(0, top, view.width, view.wall_row, painting.colours[2])
        panel = cells(x / 0.6, np.zeros_like(y), (0.06, 0), rng, 0)
        painting.shade_rows(slice(max(0, int(top)), None), panel[max(0, int(top)) :])
        rail = scaled(painting.colours[2], 1.2)
        painting.box(0, top, view.width, top + 0.06 * view.wall_ppm, rail)
    elif style in ("tiles", "bricks", "boards"):
        across, along, joint, spread = {
            "tiles": (rng.uniform(0.1, 0.3), rng.uniform(0.1, 0.3), (0.05, 0.05), 0.03),
            "bricks": (0.25, 0.075, (0.05, 0.14), 0.13),
            "boards": (rng.uniform(0.1, 0.2), 30.0, (0.06, 0.0), 0.08),  # longer than any wall
        }[str(style)]
        painting.shade_rows(EVERYWHERE, cells(x / across, y / along, joint, rng, spread))
    elif style == "curtain":
        fold = 2 * np.pi * x / rng.uniform(0.12, 0.35)
        waves = np.sin(fold + 0.8 * np.sin(fold / 2.7) + 0.3 * y)
        painting.shade_rows(EVERYWHERE, 0.85 + rng.uniform(0.1, 0.2) * waves)
    else:
        second = ((x / rng.uniform(0.1, 0.4)) % 1 < 0.5) & (y < np.inf)
        painting.image[second] = scaled(painting.colours[0], rng.uniform(0.75, 1.15))
    if rng.random() < 0.6:  # a skirting board
        top = view.wall_row - 0.1 * view.wall_ppm
        painting.box(0, top, view.width, view.wall_row, rng.choice([(235, 232, 226), (90, 70, 55)]))


def _paint_floor(painting: Painting) -> None:
    """Paint boards, tiles or a carpet, in perspective, darker along the wall."""
    rng, view = painting.rng, painting.view
    rows = view.floor_rows()
    if rows.start >= view.height:
        return
    painting.image[rows] = painting.colours[1]
    across, away = view.floor_metres()
    style = rng.integers(4)
    if style == 0:
        factor = cells(away / 1.2, across / 0.14, (0.01, 0.05), rng, 0.1)
    elif style == 1:
        factor = cells(across / 0.14, away / 1.2, (0.05, 0.01), rng, 0.1)
    elif style == 2:
        side = rng.uniform(0.3, 0.6)
        factor = cells(across / side, away / side, (0.04, 0.04), rng, 0.05)
    else:
        factor = 1 + 0.05 * speckle(view, rng, (0.1, 0.02))[rows]
    # furniture and the wall keep light from the floor's far edge
    near = np.arange(rows.stop - rows.start, dtype=np.float32)[:, None] / view.height
    painting.shade_rows(rows, factor * (1 - 0.35 * np.exp(-near / 0.03)))


def _place(painting: Painting, width_metres: float) -> tuple[float, float]:
    """Choose the left and right border of a thing somewhere along the wall, px."""
    middle = painting.rng.uniform(-0.05, 1.05) * painting.view.width
    half = 0.5 * width_metres * painting.view.wall_ppm
    return middle - half, middle + half


def _window(painting: Painting) -> None:
    """Paint a bright window with bars."""
    rng = painting.rng
    left, right = _place(painting, rng.uniform(0.8, 2))
    top, bottom = painting.view.row(rng.uniform(2, 2.5)), painting.view.row(rng.uniform(0.3, 1.1))
    frame = 0.06 * painting.view.wall_ppm
    painting.box(left, top, right, bottom, (238, 236, 230))
    glass = hsv(rng.uniform(0.5, 0.65), rng.uniform(0, 0.25), rng.uniform(0.8, 1))
    outside = hsv(rng.uniform(0.2, 0.4), rng.uniform(0.1, 0.5), rng.uniform(0.4, 0.8))
    across, down = rng.integers(1, 4, 2)
    for x0, x1 in pairwise(np.linspace(left, right, across + 1)):
        for i, (y0, y1) in enumerate(pairwise(np.linspace(top, bottom, down + 1))):
            low = i == down - 1 and down > 1
            painting.box(x0 + frame, y0 + frame, x1 - frame, y1 - frame, outside if low else glass)


def _door(painting: Painting) -> None:
    """Paint a door with two panels and a handle."""
    rng, view, ppm = painting.rng, painting.view, painting.view.wall_ppm
    left, right = _place(painting, 0.9)
    top, colour = view.row(2.05), painting.colours[rng.integers(2, 4)]
    frame, handle = 0.08 * ppm, (200, 190, 160)
    painting.box(left - frame, top - frame, right + frame, view.wall_row, scaled(colour, 1.25))
    painting.box(left, top, right, view.wall_row, colour)
    inner, panel = (right - left) * 0.18, scaled(colour, 0.88)
    for low, high in ((0.2, 0.9), (1.05, 1.9)):
        painting.box(left + inner, view.row(high), right - inner, view.row(low), panel)
    painting.box(right - 0.1 * ppm, view.row(1.05), right - 0.03 * ppm, view.row(1.0), handle)


def _picture(painting: Painting) -> None:
    """Hang up a framed picture or poster."""
    rng = painting.rng
    left, right = _place(painting, rng.uniform(0.3, 0.9))
    middle, half = painting.view.row(rng.uniform(1.4, 1.9)), rng.uniform(0.2, 0.5)
    half *= painting.view.wall_ppm
    rim = 0.04 * painting.view.wall_ppm
    frame: Rgb = ((30, 28, 26), (230, 228, 220), (120, 90, 55))[rng.integers(3)]
    painting.box(left, middle - half, right, middle + half, frame)
    inside = painting.inside(left + rim, middle - half + rim, right - rim, middle + half - rim)
    if inside.size:
        patch = rng.integers(20, 250, (rng.integers(2, 6), rng.integers(2, 5), 3)).astype(np.uint8)
        way = (cv2.INTER_NEAREST, cv2.INTER_CUBIC)[rng.integers(2)]
        inside[:] = cv2.resize(patch, inside.shape[1::-1], interpolation=way)


def _cabinet(painting: Painting) -> None:
    """Put up a cabinet with doors or drawers."""
    rng = painting.rng
    left, right = _place(painting, rng.uniform(0.6, 1.8))
    top, colour = painting.view.row(rng.uniform(0.5, 1.6)), painting.colours[rng.integers(2, 4)]
    bottom = painting.view.wall_row + 0.12 * painting.view.wall_ppm
    painting.box(left, top, right, bottom, scaled(colour, 0.7))
    rim = max(1.0, 0.025 * painting.view.wall_ppm)
    for x0, x1 in pairwise(np.linspace(left, right, rng.integers(2, 5))):
        painting.box(x0 + rim, top + rim, x1 - rim, bottom - 2 * rim, colour)
    painting.box(left, top, right, top + rim, scaled(colour, 1.3))


def _sofa(painting: Painting) -> None:
    """Put up a sofa or an armchair."""
    rng, ppm = painting.rng, painting.view.wall_ppm
    left, right = _place(painting, rng.uniform(0.9, 2.2))
    colour, base = painting.colours[rng.integers(2, 4)], painting.view.wall_row + 0.2 * ppm
    painting.box(left, base - 0.85 * ppm, right, base - 0.1 * ppm, scaled(colour, 0.85))
    painting.box(left, base - 0.45 * ppm, right, base - 0.08 * ppm, colour)
    for x in (left - 0.1 * ppm, right - 0.1 * ppm):
        painting.box(x, base - 0.65 * ppm, x + 0.2 * ppm, base - 0.05 * ppm, scaled(colour, 0.95))
    for x in rng.uniform(left, right - 0.4 * ppm, rng.integers(0, 3)):
        cushion = hsv(*rng.uniform((0, 0.1, 0.3), (1, 0.7, 0.95)))
        painting.box(x, base - 0.8 * ppm, x + 0.4 * ppm, base - 0.45 * ppm, cushion)


def _plant(painting: Painting) -> None:
    """Put up a pot with leaves."""
    rng, ppm = painting.rng, painting.view.wall_ppm
    left, right = _place(painting, 0.35)
    base, top = painting.view.wall_row + 0.15 * ppm, painting.view.row(0.25)
    painting.box(left, top, right, base, hsv(*rng.uniform((0, 0, 0.2), (0.12, 0.6, 0.9))))
    middle = (left + right) / 2
    hue, spread = rng.uniform(0.2, 0.42), rng.uniform(0.3, 0.8)
    for angle in rng.uniform(-1.2, 1.2, rng.integers(10, 26)):
        reach = rng.uniform(0.3, 1.2) * ppm
        x, y = middle + spread * reach * np.sin(angle), top - reach * np.cos(angle)
        axes = (max(1, int(rng.uniform(0.08, 0.22) * ppm)), max(1, int(0.05 * ppm)))
        green = hsv(hue, rng.uniform(0.3, 0.8), rng.uniform(0.15, 0.6))
        turn = np.degrees(angle) - 90 + rng.normal(0, 20)
        cv2.ellipse(painting.image, (int(x), int(y)), axes, turn, 0, 360, green, cv2.FILLED)


def _shelves(painting: Painting) -> None:
    """Put up shelves with books and boxes."""
    rng, ppm = painting.rng, painting.view.wall_ppm
    left, right = _place(painting, rng.uniform(0.7, 1.6))
    view, back = painting.view, scaled(painting.colours[3], 0.5)
    painting.box(left, view.row(2.0), right, view.wall_row, back)
    for level in np.arange(0.1, 2.0, 0.38):
        x, floor = left, view.row(level)
        while x < right:
            width, tall = max(rng.uniform(0.03, 0.16) * ppm, 1.5), rng.uniform(0.12, 0.32) * ppm
            if rng.random() < 0.85:
                book = hsv(rng.random(), 0.75 * rng.random() ** 2, rng.uniform(0.15, 0.95))
                painting.box(x, floor - tall, min(right, x + width), floor, book)
            x += width
        painting.box(left, floor, right, floor + max(1.0, 0.03 * ppm), painting.colours[3])


def _lamp(painting: Painting) -> None:
    """Put up a floor lamp that is switched on."""
    rng, ppm = painting.rng, painting.view.wall_ppm
    left, right = _place(painting, 0.4)
    middle, top = (left + right) / 2, painting.view.row(rng.uniform(1.4, 1.8))
    floor, low = painting.view.wall_row, top + 0.35 * ppm
    painting.box(middle - 0.02 * ppm, top, middle + 0.02 * ppm + 1, floor, (40, 38, 36))
    upper = [[left + 0.1 * ppm, top], [right - 0.1 * ppm, top]]
    shade = np.array([*upper, [right, low], [left, low]])
    cv2.fillConvexPoly(painting.image, shade.astype(np.int32), (255, 236, 200), cv2.LINE_AA)


def paint_clutter(painting: Painting) -> None:
    """Paint shapes, patches, words and posters of all sizes, in any colour."""
    rng, view, image = painting.rng, painting.view, painting.image
    if rng.random() < 0.5:
        painting.shade_rows(EVERYWHERE, 1 + 0.25 * speckle(view, rng, (0.15, 0.04, 0.01)))
    for _ in range(rng.integers(12, 45)):
        colour = hsv(*rng.uniform((0, 0, 0.02), (1, 1, 1)))
        x, y = (int(v) for v in rng.uniform((-0.1, -0.1), (1, 1)) * (view.width, view.height))
        across, down = (rng.lognormal(-2.1, 0.7, 2) * view.height).astype(int) + 1
        shape = rng.integers(7)
        if shape == 0:
            painting.box(x, y, x + across, y + down, colour)
        elif shape == 1:
            axes, turn = (int(across), int(down)), rng.uniform(0, 180)
            cv2.ellipse(image, (x, y), axes, turn, 0, 360, colour, cv2.FILLED, cv2.LINE_AA)
        elif shape == 2:
            corners = rng.normal((x, y), max(across, down), (rng.integers(3, 6), 2))
            cv2.fillPoly(image, [corners.astype(np.int32)], colour, cv2.LINE_AA)
        elif shape == 3:
            end = (x + int(rng.normal(0, view.width / 3)), y + int(rng.normal(0, view.height / 3)))
            cv2.line(image, (x, y), end, colour, int(rng.integers(1, 5)), cv2.LINE_AA)
        elif shape == 4:
            word, font = WORDS[rng.integers(len(WORDS))], FONTS[rng.integers(len(FONTS))]
            size = rng.uniform(0.3, 2.5) * view.height / 256
            cv2.putText(image, word, (x, y), font, size, colour, int(rng.integers(1, 4)))
        else:
            x1, y1 = x + 2 * int(across) + 2, y + 2 * int(down) + 2
            _patch(painting.inside(x, y, x1, y1), rng)


def _patch(inside: np.ndarray, rng: Rng) -> None:
    """Paint a rectangle of checks, stripes, dots or noise."""
    if not inside.size:
        return
    rows, columns = rng.integers(1, 12, 2)
    small = rng.integers(0, 256, (rows, columns, 3)).astype(np.uint8)
    if rng.random() < 0.5:  # two colours only
        pair = rng.integers(0, 256, (2, 3)).astype(np.uint8)
        small = pair[(np.arange(rows)[:, None] + np.arange(columns)) % 2]
    way = cv2.INTER_NEAREST if rng.random() < 0.7 else cv2.INTER_CUBIC
    inside[:] = cv2.resize(small, inside.shape[1::-1], interpolation=way)
