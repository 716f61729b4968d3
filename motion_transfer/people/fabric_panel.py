"""From a repeat, or from none, to a whole panel of cloth with its grain.

Convention: shapes are (height, width) in texels; cloth without grain is sRGB-encoded uint8,
H x W x 3; threads are H x W float32 of mean 0 and deviation about 1; a finished panel is
H x W x 3 float32 in 0..1.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from motion_transfer.people.fabric_grain import smooth_noise
from motion_transfer.people.fabric_repeats import Colours, Repeat, blended

Panel = Float32[np.ndarray, "H W 3"]
Cloth = UInt8[np.ndarray, "H W 3"]
Threads = Float32[np.ndarray, "H W"]

# Shadows between threads take a share of the colour's own brightness, and fibres that stand out
# catch light on the darkest cloth too.
_OF_COLOUR = 0.85
_OF_LIGHT = 0.06


def lay(
    repeat: Repeat,
    angle: float,
    start: Float[np.ndarray, " 2"],
    shape: tuple[int, int],
    texels_per_metre: float,
) -> Cloth:
    """Cover a panel with a repeat.

    Args:
        angle: in radians; the pattern is turned clockwise about the panel's first corner.
        start: where in the repeat that corner lies, as shares (0..1) of its width and height.
    """
    high, wide = repeat.pixels.shape[:2]
    across = wide / (repeat.width_metres * texels_per_metre)
    down = high / (repeat.height_metres * texels_per_metre)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine * across, sine * across], [-sine * down, cosine * down]])
    height, width = shape
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]]) @ turn.T
    low, high_end = corners.min(axis=0), corners.max(axis=0)
    # Move by whole repeats, so that the panel begins inside the first and there is a margin for
    # interpolation.
    sides = np.array([wide, high])
    moved = start * sides + sides * np.ceil((1 - low - start * sides) / sides)
    need = np.ceil(high_end + moved).astype(int) + 2
    covered = cv2.copyMakeBorder(
        repeat.pixels, 0, max(0, need[1] - high), 0, max(0, need[0] - wide), cv2.BORDER_WRAP
    )
    to_centre = turn @ np.array([0.5, 0.5]) + moved - 0.5
    return cv2.warpAffine(
        covered,
        np.column_stack([turn, to_centre]),
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )


def with_grain(cloth: Cloth, threads: Threads, strength: float) -> Panel:
    """Cloth whose threads are uneven by `strength`, relative to its brightness."""
    lift = _OF_LIGHT / _OF_COLOUR
    gain = threads * np.float32(strength * _OF_COLOUR) + np.float32(1)
    panel = cv2.multiply(
        cv2.add(cloth, (lift * 255,) * 4, dtype=cv2.CV_32F), cv2.merge([gain] * 3), scale=1 / 255
    )
    panel -= np.float32(lift)
    return _in_range(panel)


def _in_range(panel: Panel) -> Panel:
    return cv2.min(cv2.max(panel, 0.0), 1.0)


def one_colour(colour: Float32[np.ndarray, " 3"], threads: Threads, strength: float) -> Panel:
    """Cloth of one colour (0..255)."""
    colour = colour / 255
    matrix = np.stack([strength * (_OF_COLOUR * colour + _OF_LIGHT), colour], axis=1)
    return _in_range(cv2.transform(threads, matrix))


def two_yarns(colours: Colours, share: float, threads: Threads, strength: float) -> Panel:
    """Cloth spun or woven of two colours, so finely that only the mixture is seen.

    Args:
        share: of the second colour, 0..1.
        strength: deviation of the brightest channel where the mixture is uneven.
    """
    first, second = colours[0] / 255, colours[1] / 255
    apart = second - first
    mixture = first + apart * share
    slope = apart * (strength / max(float(np.abs(apart).max()), 1e-3))
    return _in_range(cv2.transform(threads, np.stack([slope, mixture], axis=1)))


def gradient(
    colours: Colours,
    length: float,
    angle: float,
    start: Float[np.ndarray, " 2"],
    shape: tuple[int, int],
    texels_per_metre: float,
) -> Cloth:
    """One colour running into the next within `length` metres, beginning near the first corner."""
    height, width = shape
    x = (np.arange(width, dtype=np.float32) + 0.5) / texels_per_metre
    y = (np.arange(height, dtype=np.float32) + 0.5) / texels_per_metre
    along_x, along_y = -np.sin(angle) * x, np.cos(angle) * y
    place = along_y[:, None] + along_x[None]
    place -= min(float(along_x.min()), 0.0) + min(float(along_y.min()), 0.0)
    share = place / length - 0.3 * start[0]
    return blended(colours, share.astype(np.float32))


def tie_dye(
    colours: Colours,
    scale: float,
    rng: np.random.Generator,
    shape: tuple[int, int],
    texels_per_metre: float,
) -> Cloth:
    """Rays and rings about a knot, `scale` apart, their edges run.

    It is soft, so it is painted with a texel of 6 mm and enlarged.
    """
    coarse = min(texels_per_metre, 170.0)
    height, width = (max(2, round(side * coarse / texels_per_metre)) for side in shape)
    centre_x, centre_y = width * rng.uniform(0.3, 0.7), height * rng.uniform(0.2, 0.6)
    x = np.arange(width, dtype=np.float32)[None] + 0.5 - np.float32(centre_x)
    y = np.arange(height, dtype=np.float32)[:, None] + 0.5 - np.float32(centre_y)
    x, y = np.broadcast_to(x, (height, width)).copy(), np.broadcast_to(y, (height, width)).copy()
    radius, turn = cv2.cartToPolar(x, y)
    rings = radius * np.float32(1 / (scale * coarse))
    arms = int(rng.integers(0, 4))
    run = smooth_noise(rng, scale * 0.6, (height, width), coarse)
    rough = smooth_noise(rng, scale * 0.15, (height, width), coarse)
    phase = rings + turn * np.float32(arms / (2 * np.pi)) + run * 0.3 + rough * 0.12
    share = 0.5 - 0.5 * np.cos(phase * np.float32(2 * np.pi / len(colours)))
    cloth = blended(colours, share)
    return cv2.resize(cloth, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
