"""What stands behind a person: catalogue paper, studios, rooms, streets, gardens, clutter.

    sample_background -> Background -> paint_background -> linear light

Nothing here is a photo: every background is painted from a seed, with the kind of edges, colours
and blur that photos of its kind have. A network that learns from such pictures must tell a person
from all of them. Shares, sizes and colours were chosen by eye.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.picture.backgrounds.outdoors import paint_nature, paint_street
from motion_transfer.people.picture.backgrounds.rooms import paint_clutter, paint_indoor
from motion_transfer.people.picture.backgrounds.view import (
    Painting,
    Rgb,
    Rng,
    View,
    hsv,
    smooth_shade,
)
from motion_transfer.people.picture.paint import smooth_noise, to_linear

__all__ = ["FLOOR_SHARES", "KIND_SHARES", "Background", "paint_background", "sample_background"]

Light = Float32[np.ndarray, "H W 3"]

KIND_SHARES = {
    "plain": 0.2,
    "gradient": 0.1,
    "studio": 0.15,
    "indoor": 0.2,
    "street": 0.13,
    "nature": 0.12,
    "clutter": 0.1,
}
"""How often each kind is drawn: a little under half is what fashion catalogues use."""

FLOOR_SHARES = {"plain": 0.5, "gradient": 0.3, "studio": 1, "indoor": 1, "street": 1, "nature": 1}
"""How often a floor can be told from what is behind it (paper may run on under the feet)."""

BLUR_SHARES = {
    "indoor": (0.0, 0.012),
    "street": (0.004, 0.022),
    "nature": (0.003, 0.02),
    "clutter": (0.0, 0.005),
}
"""Least and most blur of what lies behind the person, as a share of the picture's height."""

WALL_SHARES = {"street": (0.1, 0.45), "nature": (0.12, 0.6)}
USUAL_WALL_SHARE = (0.45, 0.85)
"""How far away the person is, as a share of how far away the wall, the houses or the trees are."""

CAMERA_METRES = (0.9, 1.5)
_LINEAR = to_linear(np.arange(256, dtype=np.float32) / 255)


@dataclass(frozen=True)
class Background:
    """Everything that decides how a background looks; it is painted the same each time.

    Attributes:
        kind: A key of `KIND_SHARES`.
        seed: Decides what is placed where.
        colours: Four, 8-bit sRGB: the wall or paper, the floor, and two for things.
        has_floor: The person's shadow falls on something that is seen.
        blur: Standard deviation of the depth-of-field blur, share of the picture's height.
        exposure: Factor on all light.
        vignette: Light lost in the corners, 0..1.
        wall_share: Distance of the person over that of the wall, houses or trees.
        camera_metres: Height of the camera above the floor.
    """

    kind: str
    seed: int
    colours: tuple[Rgb, Rgb, Rgb, Rgb]
    has_floor: bool
    blur: float
    exposure: float
    vignette: float
    wall_share: float
    camera_metres: float


def sample_background(rng: Rng, kind: str | None = None) -> Background:
    """Draw a background.

    Args:
        kind: One of `KIND_SHARES`; None draws it by these shares.
    Raises: ValueError for an unknown kind.
    """
    kinds = list(KIND_SHARES)
    if kind is None:
        kind = kinds[rng.choice(len(kinds), p=list(KIND_SHARES.values()))]
    if kind not in KIND_SHARES:
        raise ValueError(f"unknown background {kind!r}; there are {', '.join(kinds)}")
    low, high = BLUR_SHARES.get(kind, (0.0, 0.0))
    return Background(
        kind=kind,
        seed=int(rng.integers(2**32)),
        colours=_paper_colours(rng) if kind in PAPERS else _colours(rng),
        has_floor=bool(rng.random() < FLOOR_SHARES.get(kind, 0)),
        blur=float(low + (high - low) * rng.random() ** 1.3),
        exposure=rng.uniform(0.8, 1.05),
        vignette=float(0.35 * rng.random() ** 2),
        wall_share=rng.uniform(*WALL_SHARES.get(kind, USUAL_WALL_SHARE)),
        camera_metres=rng.uniform(*CAMERA_METRES),
    )


def _paper_colours(rng: Rng) -> tuple[Rgb, Rgb, Rgb, Rgb]:
    """Draw white, grey, pastel or strong paper, its floor, and two more of its hue."""
    tone = rng.choice(["white", "grey", "dark", "pastel", "strong"], p=[0.4, 0.25, 0.08, 0.2, 0.07])
    hue = rng.random()
    saturation, value = {
        "white": (rng.uniform(0, 0.03), rng.uniform(0.92, 1)),
        "grey": (rng.uniform(0, 0.06), rng.uniform(0.55, 0.9)),
        "dark": (rng.uniform(0, 0.2), rng.uniform(0.08, 0.4)),
        "pastel": (rng.uniform(0.08, 0.3), rng.uniform(0.75, 0.97)),
        "strong": (rng.uniform(0.4, 0.85), rng.uniform(0.35, 0.9)),
    }[str(tone)]
    return (
        hsv(hue, saturation, value),
        hsv(hue, saturation * rng.uniform(0.5, 1.1), value * rng.uniform(0.8, 1.02)),
        hsv(hue + rng.normal(0, 0.06), saturation * rng.uniform(0.5, 1.5), rng.uniform(0.4, 1)),
        hsv(hue + rng.normal(0, 0.1), saturation, value * rng.uniform(0.4, 0.9)),
    )


def _colours(rng: Rng) -> tuple[Rgb, Rgb, Rgb, Rgb]:
    """Draw four colours of things: mostly muted, some strong."""
    saturation = np.clip(rng.gamma(2, 0.1, 4), 0, 0.9)
    value = np.clip(rng.beta([4, 3, 2, 2], [2, 3, 2, 2]), 0.05, 1)
    warm = rng.normal(0.09, 0.05, 4) % 1  # wood, brick, skin of buildings
    hue = np.where(rng.random(4) < 0.55, warm, rng.random(4))
    first, second, third, fourth = (hsv(*one) for one in zip(hue, saturation, value, strict=True))
    return first, second, third, fourth


def paint_background(
    background: Background, height: int, width: int, horizon_row: float, pixels_per_metre: float
) -> Light:
    """Paint a background; the same each time for the same arguments.

    Args:
        horizon_row: Where the camera's eye level lies in the picture, pixels from the top; it may
            lie outside.
        pixels_per_metre: The scale of things as far away as the person.
    Returns: linear light, RGB in [0, 1].
    """
    rng = np.random.default_rng(background.seed)
    wall_share, camera_metres = background.wall_share, background.camera_metres
    view = View(width, height, horizon_row, pixels_per_metre, wall_share, camera_metres)
    light = PAPERS.get(background.kind, _paint_scene)(background, view, rng)
    rows = light.reshape(height, -1)  # contiguous rows multiply faster
    # the corners lose as much light as the vignette says
    y = np.linspace(-1, 1, height, dtype=np.float32)[:, None] ** 2
    x = np.linspace(-1, 1, width, dtype=np.float32) ** 2
    half = np.float32(background.vignette / 2)
    rows *= np.float32(background.exposure) * ((1 - half * y) - half * np.repeat(x, 3))
    np.clip(rows, 0, 1, out=rows)
    return light


def _enlarged(small: Light, view: View) -> Light:
    return cv2.resize(small, (view.width, view.height), interpolation=cv2.INTER_LINEAR)


def _paint_plain(background: Background, view: View, rng: Rng) -> Light:
    """Paint seamless paper, lit a little from one side, with a bright or dim floor."""
    small = view.scaled(1 / 4)
    paper = _LINEAR[list(background.colours[0])]
    light = smooth_shade(small, rng, depth=rng.uniform(0, 0.15))[..., None] * paper
    if background.has_floor:
        rows = (np.arange(small.height, dtype=np.float32) - small.wall_row) / (0.3 * small.height)
        light *= (1 + rng.uniform(-0.12, 0.06) * np.clip(rows, 0, 1))[:, None, None]
    return _enlarged(light.astype(np.float32), view)


def _paint_gradient(background: Background, view: View, rng: Rng) -> Light:
    """Paint two or three colours in a row or in rings, sometimes mottled like a canvas."""
    small = view.scaled(1 / 4)
    y, x = np.ogrid[-1 : 1 : small.height * 1j, -1 : 1 : small.width * 1j]
    angle = rng.choice([np.pi / 2, rng.uniform(0, 2 * np.pi)])
    along = 0.5 + 0.4 * (np.cos(angle) * x + np.sin(angle) * y)
    if rng.random() < 0.45:  # a spot behind the person
        along = np.hypot(x - rng.normal(0, 0.2), y - rng.normal(-0.2, 0.2)) / rng.uniform(1, 1.8)
    if rng.random() < 0.4:
        waves = smooth_noise(along.shape, small.height / 4, rng)
        waves += 0.5 * smooth_noise(along.shape, small.height / 12, rng)
        along = along + rng.uniform(0.05, 0.25) * waves
    stops = np.stack([_LINEAR[list(colour)] for colour in background.colours[: rng.integers(2, 4)]])
    stops = stops * rng.uniform(0.5, 1.1, (len(stops), 1))
    places = np.linspace(0, 1, len(stops))
    channels = [np.interp(along, places, stops[:, c]) for c in range(3)]
    return _enlarged(np.stack(channels, -1).astype(np.float32), view)


def _paint_studio(background: Background, view: View, rng: Rng) -> Light:
    """Paint a floor that runs into a wall, round or with an edge, in a pool of light."""
    small = view.scaled(1 / 2)
    rows = np.arange(small.height, dtype=np.float32) + 0.5
    softness = small.height * rng.choice([0.004, rng.uniform(0.01, 0.12)])
    floor = 1 / (1 + np.exp(-np.clip((rows - small.wall_row) / softness, -30, 30)))
    shade = smooth_shade(small, rng, depth=rng.uniform(0.1, 0.5))
    nearer = np.clip((rows - small.wall_row) / small.height, 0, 1)
    floor_light = 1 + rng.uniform(-0.3, 0.3) * nearer
    crease = 1 - rng.uniform(0, 0.15) * np.exp(-(((rows - small.wall_row) / (2 * softness)) ** 2))
    wall, ground = _LINEAR[list(background.colours[0])], _LINEAR[list(background.colours[1])]
    column = wall * (1 - floor)[:, None] + ground * (floor * floor_light)[:, None]
    light = (column * crease[:, None]).astype(np.float32)[:, None] * shade[..., None]
    if rng.random() < 0.3:  # concrete or a painted canvas
        waves = smooth_noise(shade.shape, small.height / 5, rng)
        waves += 0.4 * smooth_noise(shade.shape, small.height / 30, rng)
        light *= 1 + np.float32(rng.uniform(0.01, 0.05)) * waves[..., None]
    return _enlarged(light, view)


def _paint_scene(background: Background, view: View, rng: Rng) -> Light:
    """Paint at the size that the blur leaves visible, then let it go out of focus."""
    sigma = background.blur * view.height
    small = view if sigma < 0.6 else view.scaled(1 / 2)  # less would show the halved pixels
    painting = Painting.start(small, background.colours, rng)
    SCENES[background.kind](painting)
    light = cv2.LUT(painting.image, _LINEAR)
    painting.add_lights(light)
    sigma *= small.height / view.height
    if sigma > 0.3:
        light = _defocus(light, sigma)
    return light if small is view else _enlarged(light, view)


def _defocus(light: Light, sigma_px: float) -> Light:
    """Blur like a lens with a round opening: a disc, not a bell."""
    radius = max(1, round(2 * sigma_px))  # a disc deviates from its middle by half its radius
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    if radius > 3:  # wide discs are dear: two boxes look alike
        return cv2.blur(cv2.blur(light, (radius + 1, radius + 1)), (radius + 1, radius + 1))
    return cv2.filter2D(light, -1, disc.astype(np.float32) / disc.sum())


PAPERS: dict[str, Callable[[Background, View, Rng], Light]] = {
    "plain": _paint_plain,
    "gradient": _paint_gradient,
    "studio": _paint_studio,
}
SCENES: dict[str, Callable[[Painting], None]] = {
    "indoor": paint_indoor,
    "street": paint_street,
    "nature": paint_nature,
    "clutter": paint_clutter,
}
