"""From a repeat, or from none, to a whole panel of cloth with its grain.

Convention: cloth without grain is sRGB-encoded uint8, H x W x 3; threads are H x W float32 of mean
0 and deviation about 1; a finished panel is H x W x 3 float32 in 0..1.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8
from numpy.random import Generator

from motion_transfer.people.clothes.fabrics.repeats import Colours, Repeat, blended
from motion_transfer.people.picture.paint import smooth_noise

Panel = Float32[np.ndarray, "H W 3"]
Cloth = UInt8[np.ndarray, "H W 3"]
Threads = Float32[np.ndarray, "H W"]
Size = tuple[int, int]  # height and width in texels
Place = Float[np.ndarray, " 2"]  # x and y

# Shadows between threads take a share of the colour's own brightness, and fibres that stand out
# catch light on the darkest cloth too. Both shares are chosen by eye.
_OF_COLOUR = 0.85
_OF_LIGHT = 0.06


def lay(repeat: Repeat, angle: float, start: Place, shape: Size, texels_per_metre: float) -> Cloth:
    """Cover a panel with a repeat.

    Args:
        angle: In radians; the pattern is turned clockwise about the panel's first corner.
        start: The point of the endless cloth (x, y in metres) that lies at that corner. At a turn
            other than a quarter it is met exactly, else to a texel.
    """
    quarters = round(angle / (np.pi / 2))  # cost nothing; what is left is less than 45 degrees
    angle -= quarters * np.pi / 2
    pixels, size = repeat.pixels, (repeat.width_metres, repeat.height_metres)
    if quarters % 4:
        pixels = np.ascontiguousarray(np.rot90(pixels, -quarters))
        size = size if quarters % 2 == 0 else size[::-1]
    across = pixels.shape[1] / (size[0] * texels_per_metre)
    down = pixels.shape[0] / (size[1] * texels_per_metre)
    start = start / size % 1
    if abs(angle) < 1e-6:  # cut out along the threads: many times faster than turning
        left, top = int(start[0] * pixels.shape[1]), int(start[1] * pixels.shape[0])
        wide, high = max(1, round(shape[1] * across)), max(1, round(shape[0] * down))
        cut = _covered(pixels, left + wide, top + high)[top : top + high, left : left + wide]
        return cv2.resize(cut, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return _lay_turned(pixels, across, down, angle, start, shape)


def _covered(pixels: Cloth, wide: int, high: int) -> Cloth:
    """Continue a repeat to at least wide x high texels."""
    more_rows, more_columns = max(0, high - pixels.shape[0]), max(0, wide - pixels.shape[1])
    return cv2.copyMakeBorder(pixels, 0, more_rows, 0, more_columns, cv2.BORDER_WRAP)


def _lay_turned(
    pixels: Cloth, across: float, down: float, angle: float, start: Place, shape: Size
) -> Cloth:
    """Turn the panel's texels into the repeat's, by an angle of at most 45 degrees."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine * across, sine * across], [-sine * down, cosine * down]])
    height, width = shape
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]]) @ turn.T
    # Move by whole repeats, so that every corner lies inside with a margin for interpolation.
    sides = np.array([pixels.shape[1], pixels.shape[0]])
    moved = start * sides + sides * np.ceil((1 - corners.min(axis=0)) / sides - start)
    need = np.ceil(corners.max(axis=0) + moved).astype(int) + 2
    to_centre = turn @ np.array([0.5, 0.5]) + moved - 0.5
    return cv2.warpAffine(
        _covered(pixels, need[0], need[1]),
        np.column_stack([turn, to_centre]),
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
    )


def with_grain(cloth: Cloth, threads: Threads, strength: float) -> Panel:
    """Make the threads of cloth uneven by `strength`, relative to its brightness."""
    lift = np.float32(_OF_LIGHT / _OF_COLOUR)
    gain = threads * np.float32(strength * _OF_COLOUR / 255)
    gain += np.float32(1 / 255)
    panel = cloth.astype(np.float32)
    panel += lift * 255
    panel *= cv2.merge([gain, gain, gain])
    panel -= lift
    return np.clip(panel, 0, 1, out=panel)


def _coloured(
    threads: Threads, slope: Float32[np.ndarray, " 3"], middle: Float32[np.ndarray, " 3"]
) -> Panel:
    """Compute middle + slope x threads per channel. (cv2.transform takes three times as long.)"""
    panel = cv2.merge([threads * a + b for a, b in zip(slope, middle, strict=True)])
    return np.clip(panel, 0, 1, out=panel)


def one_colour(colour: Float32[np.ndarray, " 3"], threads: Threads, strength: float) -> Panel:
    """Weave cloth of one colour (0..255)."""
    colour = colour / 255
    slope = np.float32(strength) * (_OF_COLOUR * colour + _OF_LIGHT).astype(np.float32)
    return _coloured(threads, slope, colour)


def two_yarns(colours: Colours, share: float, threads: Threads, strength: float) -> Panel:
    """Spin or weave cloth of two colours, so finely that only the mixture is seen.

    Args:
        share: Of the second colour, 0..1.
        strength: Deviation of the brightest channel where the mixture is uneven.
    """
    first, second = colours[0] / 255, colours[1] / 255
    apart = second - first
    mixture = first + apart * np.float32(share)
    slope = apart * np.float32(strength / max(float(np.abs(apart).max()), 1e-3))
    return _coloured(threads, slope, mixture)


def gradient(
    colours: Colours,
    length: float,
    angle: float,
    start: Place,
    shape: Size,
    texels_per_metre: float,
) -> Cloth:
    """Let colours run into each other within `length` metres, from near the first corner on."""
    y, x = ((np.arange(side, dtype=np.float32) + 0.5) / texels_per_metre for side in shape)
    along_x = x * np.float32(-np.sin(angle) / length)
    along_y = y * np.float32(np.cos(angle) / length)
    along_y -= along_x.min() + along_y.min() + np.float32(0.3 * start[0])
    return blended(colours, along_y[:, None] + along_x[None])


def tie_dye(
    colours: Colours, scale: float, rng: Generator, shape: Size, texels_per_metre: float
) -> Cloth:
    """Dye rays and rings about a knot, `scale` apart, their edges run."""
    coarse = min(texels_per_metre, 170.0)  # it is soft: texels of 6 mm are enlarged
    height, width = (max(2, round(side * coarse / texels_per_metre)) for side in shape)
    centre_x, centre_y = width * rng.uniform(0.3, 0.7), height * rng.uniform(0.2, 0.6)
    x = np.arange(width, dtype=np.float32)[None] + 0.5 - np.float32(centre_x)
    y = np.arange(height, dtype=np.float32)[:, None] + 0.5 - np.float32(centre_y)
    x, y = (np.ascontiguousarray(axis) for axis in np.broadcast_arrays(x, y))
    radius, turn = cv2.cartToPolar(x, y)
    rings = radius * np.float32(1 / (scale * coarse))
    arms = int(rng.integers(0, 4))
    run = smooth_noise((height, width), scale * 0.6 * coarse, rng)
    rough = smooth_noise((height, width), max(1.0, scale * 0.12 * coarse), rng)
    phase = rings * np.float32(np.pi) + turn * np.float32(arms) + run * 0.8 + rough * 0.35
    cloth = blended(colours, 0.5 - 0.5 * np.cos(phase))
    return cv2.resize(cloth, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
