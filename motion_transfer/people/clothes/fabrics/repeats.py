"""Woven and geometric patterns, each as one repeat of the cloth.

Convention: a repeat's rows run along the panel's height and its columns along the width; both wrap
around. Its pixels are sRGB-encoded uint8. A repeat is painted at nearly the panel's own
resolution and already filtered for it, so that a pattern finer than a texel fades to its mean.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Int, UInt8
from numpy.random import Generator

Colours = Float32[np.ndarray, "N 3"]
"""The fabric's colours, sRGB 0..255, ground first."""

# Repeats of small patterns are laid side by side until they span this many texels, because the
# count of texels must be whole: rounding then changes the resolution by 2 % at most.
_LEAST_TEXELS = 24

_LEAST_SAMPLES = 20  # of a pattern along its period, before they are averaged over texels
_BAND_TEXELS = 64  # along bands, where every column is alike: any number would do


@dataclass(frozen=True)
class Repeat:
    """A piece of cloth that continues over its own edges.

    Attributes:
        pixels: h x w x 3 uint8, sRGB.
        height_metres, width_metres: The measures of the piece.
    """

    pixels: UInt8[np.ndarray, "h w 3"]
    height_metres: float
    width_metres: float


def span(period_metres: float, texels_per_metre: float) -> tuple[int, int]:
    """Tell how many periods a repeat holds, and in how many texels."""
    texels = period_metres * texels_per_metre
    periods = max(1, int(np.ceil(_LEAST_TEXELS / texels)))
    return periods, max(1, round(periods * texels))


def _banded(
    widths: Sequence[float], colours: Colours, scale: float, texels_per_metre: float, crossed: bool
) -> Repeat:
    """Make a repeat of bands of colour, averaged exactly over each texel.

    Args:
        widths: Of the bands, as shares of one period.
        scale: Of one period, metres.
        crossed: Warp and weft of the same bands, each showing half (a balanced weave); else the
            bands run along the width.
    """
    periods, texels = span(scale, texels_per_metre)
    shares = np.array(widths, np.float32)
    edges = np.concatenate([[0.0], np.cumsum(np.tile(shares / shares.sum(), periods))])
    areas = np.diff(edges)[:, None] * np.tile(colours, (periods, 1))
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(areas, axis=0)])
    at = np.linspace(0, periods, texels + 1)
    summed = np.stack([np.interp(at, edges, sums[:, c]) for c in range(3)], axis=1)
    bands = (np.diff(summed, axis=0) * (texels / periods)).astype(np.float32)
    metres = periods * scale
    if crossed:
        return Repeat(cv2.convertScaleAbs((bands[None] + bands[:, None]) * 0.5), metres, metres)
    pixels = cv2.convertScaleAbs(np.repeat(bands[:, None], _BAND_TEXELS, axis=1))
    return Repeat(pixels, metres, _BAND_TEXELS / texels_per_metre)


def _sampled(
    pick: Callable[..., np.ndarray],
    colours: Colours,
    period: tuple[float, float],
    texels_per_metre: float,
) -> Repeat:
    """Make a repeat of a pattern given as a function of place.

    Args:
        pick: (u, v) -> which colour, both in periods along the width and the height.
        period: Width and height in metres.
    """
    table = np.clip(np.rint(colours), 0, 255).astype(np.uint8)
    (count_u, wide), (count_v, high) = (span(length, texels_per_metre) for length in period)
    finer = int(np.clip(160 // max(wide, high), 2, 4))  # samples a texel: more where it is cheap
    columns, rows = (
        max(_LEAST_SAMPLES, round(texels * finer / count))
        for texels, count in ((wide, count_u), (high, count_v))
    )
    u, v = ((np.arange(n, dtype=np.float32) + 0.5) / np.float32(n) for n in (columns, rows))
    fine = table[np.broadcast_to(pick(u[None], v[:, None]), (rows, columns))]
    if min(period) * texels_per_metre < 1:  # no texel can show it; spare the averaging
        mean = np.rint(fine.mean(axis=(0, 1))).astype(np.uint8)
        pixels = np.full((high, wide, 3), mean)
    else:
        several = np.tile(fine, (count_v, count_u, 1))
        pixels = cv2.resize(several, (wide, high), interpolation=cv2.INTER_AREA)
    return Repeat(pixels, count_v * period[1], count_u * period[0])


def blended(colours: Colours, share: Float32[np.ndarray, "H W"]) -> UInt8[np.ndarray, "H W 3"]:
    """Go through the colours in turn as `share` goes from 0 to 1, blended in between."""
    at = np.linspace(0, len(colours) - 1, 256)
    ramp = np.stack([np.interp(at, np.arange(len(colours)), colours[:, c]) for c in range(3)], 1)
    index = cv2.convertScaleAbs(np.clip(share, 0, 1), alpha=255)
    return cv2.applyColorMap(index, np.rint(ramp).astype(np.uint8)[:, None])


def stripes(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Weave bands across the height: even, thin lines on a ground, or several colours."""
    count = len(colours)
    if count == 2:
        line = rng.choice([0.5, rng.uniform(0.2, 0.45), rng.uniform(0.06, 0.15)])
        widths, order = [1 - line, line], [0, 1]
    else:
        order = [part for colour in range(1, count) for part in (0, colour)]
        widths = rng.uniform(0.25, 1.0, len(order)).tolist()
    return _banded(widths, colours[order], scale, texels_per_metre, crossed=False)


def colour_block(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Sew wide fields of colour, one after another."""
    widths = rng.uniform(0.6, 1.0, len(colours)).tolist()
    return _banded(widths, colours, scale, texels_per_metre, crossed=False)


def checks(colours: Colours, scale: float, _rng: Generator, texels_per_metre: float) -> Repeat:
    """Weave gingham: two colours in even bands, crossed."""
    return _banded((0.5, 0.5), colours[:2], scale, texels_per_metre, crossed=True)


def plaid(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Weave tartan (a mirrored sequence of bands, crossed) or, now and then, a windowpane check."""
    if rng.random() < 0.25:
        line = rng.uniform(0.04, 0.1)
        widths, order = [0.5 - line / 2, line, 0.5 - line / 2], [0, 1, 0]
    else:
        half = int(rng.integers(3, 6))
        order = [0, *rng.integers(0, len(colours), half).tolist(), 1]
        widths = [1.2, *rng.choice([0.12, 0.2, 0.5, 0.9], half).tolist(), 0.9]
        order, widths = order + order[-2:0:-1], widths + widths[-2:0:-1]
    return _banded(widths, colours[order], scale, texels_per_metre, crossed=True)


def dots(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Print round dots in staggered rows; `scale` is the distance of two dots in a row."""
    radius = rng.uniform(0.16, 0.33)
    last = len(colours) - 1

    def pick(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        corner = (np.abs(u - 0.5) - 0.5) ** 2 + (np.abs(v - 0.5) - 0.5) ** 2 < radius**2
        centre = (u - 0.5) ** 2 + (v - 0.5) ** 2 < radius**2
        return corner * 1 + centre * last

    return _sampled(pick, colours, (scale, scale), texels_per_metre)


def herringbone(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Weave twill whose diagonal turns every half period."""
    lines = int(rng.integers(2, 5))

    def pick(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        slant = np.abs(u - 0.5)
        offset = np.where(u < 0.5, 0.5, 0.0)
        return (((v + slant) * 2 * lines + offset) % 1 < 0.5).astype(np.intp)

    return _sampled(pick, colours, (scale, scale), texels_per_metre)


def chevron(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Weave zigzag bands."""
    steep = rng.uniform(0.4, 1.0)
    count = len(colours)

    def pick(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return ((v + steep * np.abs(u - 0.5)) % 1 * count).astype(np.intp) % count

    return _sampled(pick, colours, (scale, scale), texels_per_metre)


def houndstooth(colours: Colours, scale: float, _rng: Generator, texels_per_metre: float) -> Repeat:
    """Weave four dark and four light threads each way as a 2/2 twill."""

    def pick(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        warp, weft = (u * 8).astype(np.intp), (v * 8).astype(np.intp)
        return np.where((warp + weft) % 4 < 2, warp < 4, weft < 4).astype(np.intp)

    return _sampled(pick, colours, (scale, scale), texels_per_metre)


def argyle(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Knit diamonds with a thin diagonal line over them."""
    last = len(colours) - 1
    line = rng.uniform(0.02, 0.04)

    def pick(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        index: Int[np.ndarray, "h w"] = np.where(np.abs(u - 0.5) + np.abs(v - 0.5) < 0.5, 1, 0)
        over = (np.abs(np.abs(u - 0.5) - np.abs(v - 0.5))) < line
        return np.where(over, last, index)

    return _sampled(pick, colours, (scale, scale * 1.5), texels_per_metre)


def knit(colours: Colours, scale: float, rng: Generator, texels_per_metre: float) -> Repeat:
    """Knit stitches in columns of V, `scale` wide each; some with ribs, some in two colours.

    A group of 8 x 8 stitches is one period, so `scale` is an eighth of it.
    """
    group = 8
    ribs = float(rng.choice([0.0, 0.0, 0.25, 0.5]))
    shades = np.linspace(0.66, 1.06, 16, dtype=np.float32)
    second = len(colours) > 1
    motif = rng.random((group, group // 2)) < 0.35
    motif = np.concatenate([motif, motif[:, ::-1]], axis=1) & second
    table = np.concatenate([colours[0] * shades[:, None], colours[-1] * shades[:, None]])

    def pick(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        column, row = u * group, v * group
        aside = np.abs(column % 1 - 0.5) * 2
        along = (row - 0.7 * aside) % 1
        light = np.sin(np.pi * along) * (0.35 + 0.65 * np.sin(np.pi * aside))
        valley = np.abs(u * 2 % 1 - 0.5) * 2
        light = np.clip(light * (1 - ribs * valley**2), 0, 0.999)
        which = np.floor(row - 0.7 * aside).astype(np.intp) % group, column.astype(np.intp) % group
        return (light * 16).astype(np.intp) + 16 * motif[which]

    return _sampled(pick, table, (scale * group, scale * 0.8 * group), texels_per_metre)
