"""Streets and gardens; sizes are metres, chosen by eye as colours and chances are."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from motion_transfer.people.picture.backgrounds.view import Painting, cells, hsv, scaled, speckle
from motion_transfer.people.picture.paint import smooth_noise


def paint_street(painting: Painting) -> None:
    """Paint sky, houses with windows, a pavement and a road, cars and people far away."""
    rng, view = painting.rng, painting.view
    _sky(painting)
    left = rng.uniform(-0.6, 0) * view.width
    while left < view.width:
        right = left + rng.uniform(3, 9) * view.wall_ppm
        if rng.random() < 0.9:
            _house(painting, left, right)
        left = right + rng.choice([0.0, 0.0, rng.uniform(0, 2)]) * view.wall_ppm
    if rng.random() < 0.4:
        _trees(painting)
    _road(painting)
    for _ in range(rng.integers(0, 4)):
        _car(painting)
    for _ in range(rng.integers(0, 5)):
        _passer_by(painting)
    for x in rng.uniform(0, view.width, rng.integers(0, 3)):
        thick = max(1.0, 0.1 * view.wall_ppm)
        painting.box(x, 0, x + thick, view.wall_row + 0.2 * view.wall_ppm, (70, 70, 68))
    if rng.random() < 0.35:
        _bokeh(painting, hues=(0.02, 0.16))


def _sky(painting: Painting) -> None:
    """Paint a sky: clear, hazy or overcast, brightest at the horizon."""
    rng, view = painting.rng, painting.view
    top = np.array(hsv(0.58 + rng.normal(0, 0.02), rng.uniform(0, 0.5), rng.uniform(0.65, 1)))
    low = np.array(hsv(0.57, rng.uniform(0, 0.15), rng.uniform(0.85, 1)))
    share = np.linspace(0, 1, view.height)[:, None] ** 1.5
    painting.image[:] = (top * (1 - share) + low * share).astype(np.uint8)[:, None]


def _house(painting: Painting, left: float, right: float) -> None:
    """Paint a facade: rows of windows, and perhaps a shop below."""
    rng, view, ppm = painting.rng, painting.view, painting.view.wall_ppm
    base = painting.colours[rng.integers(0, 4)]
    wall = scaled(base, rng.uniform(0.7, 1.2))
    roof = view.wall_row - rng.uniform(4, 14) * ppm
    painting.box(left, roof, right, view.wall_row, wall)
    glass = hsv(rng.uniform(0.5, 0.65), rng.uniform(0, 0.3), rng.uniform(0.1, 0.7))
    wide, storey = rng.uniform(0.7, 1.6) * ppm, rng.uniform(2.6, 3.4) * ppm
    step, tall = wide * rng.uniform(1.3, 2.4), storey * rng.uniform(0.45, 0.7)
    frame = scaled(wall, rng.choice([0.75, 1.3]))
    rim = max(1.0, 0.08 * ppm)
    # windows above the ground floor, on a grid that begins outside of the picture
    for bottom in np.arange(view.wall_row - 1.25 * storey, max(roof, 0), -storey):
        for x in np.arange(max(left, left % step - step) + 0.3 * wide, right - wide, step):
            painting.box(x - rim, bottom - tall - rim, x + wide + rim, bottom + rim, frame)
            painting.box(x, bottom - tall, x + wide, bottom, scaled(glass, rng.uniform(0.6, 1.5)))
    if rng.random() < 0.6:  # a shop
        sign = hsv(*rng.uniform((0, 0, 0.1), (1, 0.9, 0.95)))
        painting.box(left, view.row(3.1), right, view.row(2.5), sign)
        panes = np.arange(left + 0.2 * ppm, right, rng.uniform(1, 2.2) * ppm)
        for x0, x1 in pairwise(panes):
            inside = hsv(rng.uniform(0.05, 0.15), rng.uniform(0, 0.5), rng.uniform(0.1, 0.9))
            painting.box(x0, view.row(2.4), x1 - rim, view.row(0.3), inside)


def _road(painting: Painting) -> None:
    """Paint a pavement of slabs and asphalt, with a kerb or a line between."""
    rng, view = painting.rng, painting.view
    rows = view.floor_rows()
    if rows.start >= view.height:
        return
    grey = rng.uniform(0.3, 0.7)
    painting.image[rows] = hsv(rng.uniform(0.05, 0.65), rng.uniform(0, 0.1), grey)
    across, away = view.floor_metres()
    if rng.random() < 0.5:
        side = rng.uniform(0.4, 1)
        painting.shade_rows(rows, cells(across / side, away / side, (0.04, 0.04), rng, 0.06))
    else:
        painting.shade_rows(rows, 1 + 0.06 * speckle(view, rng, (0.15, 0.02))[rows])
    kerb = view.wall_row + rng.uniform(0.05, 0.5) * view.wall_ppm
    painting.box(0, kerb, view.width, kerb + max(1.0, 0.1 * view.wall_ppm), (205, 205, 198))
    painting.box(0, view.wall_row, view.width, kerb, hsv(0.6, 0.03, 0.6 * grey))


def _car(painting: Painting) -> None:
    """Paint a parked car: body, windows, wheels, lamps."""
    rng, view, ppm = painting.rng, painting.view, painting.view.wall_ppm
    x, ground = rng.uniform(-0.2, 1) * view.width, view.wall_row + rng.uniform(0, 0.4) * ppm
    long, colour = rng.uniform(3.8, 4.8) * ppm, hsv(*rng.uniform((0, 0, 0.05), (1, 0.8, 0.95)))
    place = np.array([x, ground])
    cabin = np.array([[0.15, -0.9], [0.3, -1.45], [0.72, -1.45], [0.9, -0.9]]) * (long, ppm)
    body = np.array([[0, -0.35], [0.02, -0.85], [0.15, -0.95], [0.9, -0.95], [1, -0.8], [1, -0.35]])
    for outline, shade in ((cabin, scaled(colour, 0.9)), (body * (long, ppm), colour)):
        cv2.fillPoly(painting.image, [(outline + place).astype(np.int32)], shade)
    panes = (cabin - cabin.mean(0)) * 0.8 + cabin.mean(0) + place
    cv2.fillPoly(painting.image, [panes.astype(np.int32)], (35, 42, 50))
    for share in (0.2, 0.8):
        centre = (int(x + share * long), int(ground - 0.3 * ppm))
        cv2.circle(painting.image, centre, max(1, int(0.32 * ppm)), (25, 25, 26), cv2.FILLED)
    painting.box(x, ground - 0.8 * ppm, x + 0.2 * ppm, ground - 0.65 * ppm, (250, 90, 70))


def _passer_by(painting: Painting) -> None:
    """Paint somebody far off, not to be mistaken for the person: blurred, and small."""
    rng, view = painting.rng, painting.view
    # at most half as tall as the person would be
    ppm = min(0.5 * view.ppm, view.wall_ppm * rng.uniform(1, 1.4))
    x = rng.uniform(0, 1) * view.width
    feet = view.horizon + view.camera_metres * ppm
    coat, legs = (hsv(*rng.uniform((0, 0, 0.05), (1, 0.6, 0.8))) for _ in range(2))
    skin = ((225, 180, 150), (150, 105, 80), (90, 62, 48))[rng.integers(3)]
    painting.box(x - 0.15 * ppm, feet - 0.85 * ppm, x + 0.15 * ppm, feet, legs)
    painting.box(x - 0.22 * ppm, feet - 1.48 * ppm, x + 0.22 * ppm, feet - 0.8 * ppm, coat)
    head = (int(x), int(feet - 1.6 * ppm))
    cv2.circle(painting.image, head, max(1, int(0.12 * ppm)), skin, cv2.FILLED)


def paint_nature(painting: Painting) -> None:
    """Paint leaves in light and shade, sky between them, trunks, and grass or a path below."""
    rng = painting.rng
    _sky(painting)
    hills = rng.random() < 0.25
    if hills:
        hue = rng.uniform(0.1, 0.36)
        for share in (0.5, 0.75, 1.0):
            _hill(painting, share, hue)
    else:
        _trees(painting)
    _meadow(painting)
    if not hills and rng.random() < 0.5:
        _bokeh(painting, hues=(0.12, 0.28))


def _leaf_colours(painting: Painting) -> np.ndarray:
    """Mix 256 colours, from deep shade to leaves in the sun; now and then autumn or blossom."""
    rng = painting.rng
    hues = rng.uniform(0.2, 0.36), rng.uniform(0.03, 0.14), rng.uniform(0.85, 0.95)
    hue = rng.choice(hues, p=[0.8, 0.15, 0.05])
    strength = rng.uniform(0.3, 0.8)
    stops = np.array(
        [
            hsv(hue + 0.05, 0.8 * strength, 0.06),
            hsv(hue, strength, rng.uniform(0.2, 0.4)),
            hsv(hue - 0.03, 0.9 * strength, rng.uniform(0.45, 0.7)),
            hsv(hue - 0.07, 0.6 * strength, rng.uniform(0.75, 1)),
        ]
    )
    places = np.linspace(0, 255, 4)
    ramp = [np.interp(np.arange(256), places, stops[:, channel]) for channel in range(3)]
    return np.stack(ramp, -1).astype(np.uint8)


def _trees(painting: Painting) -> None:
    """Paint foliage over the whole height, with gaps of sky above, and trunks in it."""
    rng, view = painting.rng, painting.view
    colours = _leaf_colours(painting)
    leaves = speckle(view, rng, (0.35, 0.12, 0.04, 0.012))
    light = np.clip(90 + 55 * leaves, 0, 255).astype(np.uint8)
    gaps = speckle(view, rng, (0.5, 0.1, 0.03))
    height = np.linspace(1, -1, view.height, dtype=np.float32)[:, None]
    # gaps are wider towards the top
    leafy = gaps + 0.8 * height < rng.uniform(0.6, 2.2)
    cv2.copyTo(colours[light], leafy.view(np.uint8), painting.image)
    bark = hsv(rng.uniform(0.04, 0.1), rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.45))
    for x in rng.uniform(0, view.width, rng.integers(0, 6)):
        thick, lean = rng.uniform(0.1, 0.45) * view.wall_ppm, rng.normal(0, 0.06) * view.height
        corners = np.array([[x, view.wall_row + 3], [x + thick, view.wall_row + 3],
                            [x + 0.7 * thick + lean, 0], [x + 0.2 * thick + lean, 0]])  # fmt: skip
        shade = scaled(bark, rng.uniform(0.6, 1.3))
        cv2.fillPoly(painting.image, [corners.astype(np.int32)], shade, cv2.LINE_AA)
    for _ in range(rng.integers(0, 25)):  # branches and leaves close by
        x, y = (int(v) for v in rng.uniform(0, 1, 2) * (view.width, view.height))
        axes = tuple(int(v) for v in 1 + rng.uniform(0.005, 0.03, 2) * view.height)
        leaf: list[int] = colours[rng.integers(90, 256)].tolist()
        cv2.ellipse(painting.image, (x, y), axes, rng.uniform(0, 180), 0, 360, leaf, cv2.FILLED)


def _hill(painting: Painting, share: float, hue: float) -> None:
    """Paint a wooded ridge; `share` 0 is far and hazy, 1 is near."""
    rng, view = painting.rng, painting.view
    x = np.linspace(0, 1, view.width, dtype=np.float32)
    waves = smooth_noise((1, view.width), 0.3 * view.width, rng)
    waves = 0.06 * waves[0] + rng.uniform(-0.08, 0.08) * np.sin(3 * x)
    waves += 0.006 * smooth_noise((1, view.width), 3, rng)[0]
    ridge = view.wall_row - (0.35 - 0.3 * share) * view.height + waves * view.height
    haze = np.array(hsv(hue + 0.2 * (1 - share), 0.1 + 0.35 * share, 0.9 - 0.55 * share))
    below = np.arange(view.height, dtype=np.float32)[:, None] > ridge
    texture = 1 + 0.25 * share * speckle(view, rng, (0.08, 0.02))
    wood = np.clip(texture[..., None] * haze, 0, 255).astype(np.uint8)
    cv2.copyTo(wood, below.view(np.uint8), painting.image)


def _meadow(painting: Painting) -> None:
    """Paint grass, sand, leaves or a path up to the trees."""
    rng, view = painting.rng, painting.view
    rows = view.floor_rows()
    if rows.start >= view.height:
        return
    colours = _leaf_colours(painting)
    if rng.random() < 0.3:  # earth or sand
        base = np.array(hsv(rng.uniform(0.06, 0.12), rng.uniform(0.15, 0.5), 1)) / 255
        colours = ((80 + 0.55 * np.arange(256))[:, None] * base).astype(np.uint8)
    blades = speckle(view, rng, (0.2, 0.05, 0.01))[rows]
    grain = rng.standard_normal(blades.shape, np.float32)
    grain = cv2.blur(grain, (1, max(1, round(0.03 * view.height)) | 1))
    light = np.clip(125 + 16 * blades + 32 * grain, 0, 255).astype(np.uint8)
    painting.image[rows] = colours[light]


def _bokeh(painting: Painting, hues: tuple[float, float]) -> None:
    """Paint lamps or sunlit leaves that the lens turns into discs, above the ground."""
    rng, view = painting.rng, painting.view
    radius = rng.uniform(0.016, 0.04) * view.height
    lowest = max(0.1, view.wall_row / view.height)
    for _ in range(rng.integers(5, 30)):
        x = int(rng.uniform(0, view.width))
        y = int(rng.uniform(0, lowest) * view.height)
        red, green, blue = hsv(rng.uniform(*hues), rng.uniform(0.1, 0.7), 1)
        bright = rng.uniform(0.35, 1.1) / 255
        colour = (red * bright, green * bright, blue * bright)
        painting.lights.append((x, y, max(1, int(radius * rng.uniform(0.6, 1.3))), colour))
