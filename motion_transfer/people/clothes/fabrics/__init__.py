"""Cloth for synthetic clothes: what fabrics there are, and a painted panel of one.

    sample_fabric -> Fabric -> paint_fabric -> pixels

A Fabric says what the cloth is; painting it draws no further chance than its seed. Its grain makes
a plain area look like cloth: uneven threads, fibres, fading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32
from numpy.random import Generator

from motion_transfer.errors import InputError
from motion_transfer.people.clothes.fabrics import motifs, repeats
from motion_transfer.people.clothes.fabrics.colours import Colour, from_hex, sample_palette
from motion_transfer.people.clothes.fabrics.panel import (
    gradient,
    lay,
    one_colour,
    tie_dye,
    two_yarns,
    with_grain,
)
from motion_transfer.people.picture.paint import smooth_noise

__all__ = ["KINDS", "Colour", "Fabric", "paint_fabric", "sample_fabric"]

_Painter = Callable[[repeats.Colours, float, Generator, float], repeats.Repeat]


@dataclass(frozen=True)
class _Kind:
    """How fabrics of one kind are sampled, and what paints their repeat.

    Attributes:
        weight: How often, relative to the other kinds.
        colours: Fewest and most colours.
        scale: Smallest and largest scale in metres; sampled evenly in the logarithm.
        turns: Angles in quarter turns; repeated ones are likelier.
        weaves: The weaves it is seen on.
        paint: Its repeat's painter; None where no repeat is needed.
    """

    weight: float
    colours: tuple[int, int]
    scale: tuple[float, float]
    turns: tuple[float, ...] = (0.0,)
    weaves: tuple[str, ...] = ("woven", "jersey")
    paint: _Painter | None = None


# Weights are chosen by eye to resemble catalogues: four in ten clothes are plain.
_ANY_TURN = (0.0, 1.0, 2.0, 3.0)
_KINDS: dict[str, _Kind] = {
    "plain": _Kind(0.40, (1, 1), (0.001, 0.001), weaves=("woven", "jersey", "jersey", "satin")),
    "melange": _Kind(0.07, (2, 2), (0.002, 0.004), weaves=("melange",)),
    "denim": _Kind(0.06, (2, 2), (0.001, 0.002), weaves=("twill",)),
    "gradient": _Kind(0.015, (2, 3), (0.3, 1.2), (0, 0, 0, 2, 1), ("jersey", "satin")),
    "tie_dye": _Kind(0.012, (3, 4), (0.08, 0.25), weaves=("jersey",)),
    "stripes": _Kind(0.10, (2, 4), (0.004, 0.08), (0, 0, 0, 0, 1, 1, 0.5), paint=repeats.stripes),
    "colour_block": _Kind(0.02, (2, 3), (0.4, 1.2), (0, 0, 0, 1), paint=repeats.colour_block),
    "checks": _Kind(0.04, (2, 2), (0.006, 0.05), (0, 0, 0, 0.5), ("woven",), repeats.checks),
    "plaid": _Kind(0.05, (3, 4), (0.03, 0.15), (0, 0, 0, 0, 0.5), ("woven",), repeats.plaid),
    "houndstooth": _Kind(0.014, (2, 2), (0.01, 0.05), weaves=("woven",), paint=repeats.houndstooth),
    "herringbone": _Kind(0.015, (2, 2), (0.02, 0.06), weaves=("woven",), paint=repeats.herringbone),
    "chevron": _Kind(0.01, (2, 4), (0.03, 0.12), (0, 0, 1), paint=repeats.chevron),
    "argyle": _Kind(0.01, (3, 3), (0.04, 0.12), weaves=("jersey",), paint=repeats.argyle),
    "knit": _Kind(0.06, (1, 2), (0.003, 0.011), weaves=("melange", "jersey"), paint=repeats.knit),
    "dots": _Kind(0.035, (2, 3), (0.004, 0.05), (0, 0, 0.5), ("woven", "satin"), repeats.dots),
    "flowers": _Kind(0.055, (3, 4), (0.02, 0.15), _ANY_TURN, ("woven", "satin"), motifs.flowers),
    "leaves": _Kind(0.015, (2, 4), (0.06, 0.25), _ANY_TURN, ("woven", "satin"), motifs.leaves),
    "abstract": _Kind(0.015, (3, 4), (0.05, 0.2), _ANY_TURN, ("woven", "satin"), motifs.abstract),
    "leopard": _Kind(0.012, (2, 2), (0.015, 0.05), (0, 1), ("jersey", "satin"), motifs.leopard),
    "zebra": _Kind(0.006, (2, 2), (0.02, 0.06), (0, 0, 1), ("jersey", "satin"), motifs.zebra),
    "camouflage": _Kind(0.012, (3, 4), (0.04, 0.12), (0, 1), ("twill",), motifs.camouflage),
    "marble": _Kind(0.012, (2, 3), (0.04, 0.15), _ANY_TURN, ("satin", "jersey"), motifs.marble),
}

KINDS = tuple(_KINDS)

# Cloths that come in colours of their own, with how often each is seen.
_OWN_COLOURS: dict[str, tuple[tuple[float, str], ...]] = {
    "denim": (
        (0.25, "1a243b 4d5e7a"),
        (0.30, "334a6e 738cab"),
        (0.20, "6382a8 b8c9db"),
        (0.12, "17171a 404045"),
        (0.06, "85878c bdbfc2"),
        (0.07, "dbdbd6 f7f7f5"),
    ),
    "leopard": (
        (0.4, "c79e6b 211712"),
        (0.3, "d9c29e 2b1f17"),
        (0.15, "a8a6a3 17171a"),
        (0.15, "ede6d9 292626"),
    ),
    "zebra": ((0.6, "f3f1ec 17171a"), (0.25, "d9cdb8 1d1815"), (0.15, "77797d 121214")),
}

# Per weave: boxes (wide, high) in cells over which neighbouring cells look alike, each with its
# weight. Long thin boxes are single threads that run thick and thin.
_STREAKS: dict[str, tuple[tuple[int, int, float], ...]] = {
    "woven": ((13, 1, 0.7), (1, 13, 0.7)),
    "jersey": ((1, 5, 0.8), (3, 3, 0.6)),
    "twill": ((1, 31, 0.8), (2, 2, 0.6)),
    "melange": ((4, 1, 0.9), (9, 2, 0.5)),
    "satin": ((25, 1, 0.5), (5, 5, 0.8)),
}
WEAVES = tuple(_STREAKS)

# Yarns are 0.3-1 mm thick. Noise at twice a coarse yarn's pitch is what a camera that resolves
# 1-4 mm keeps of them.
_CELL_METRES = 0.002
_SWATCH_CELLS = 1024  # 2 m: larger than a panel of a garment


@dataclass(frozen=True)
class Fabric:
    """One cloth.

    Attributes:
        kind: One of KINDS.
        colours: Ground first, sRGB 0..1; one at least, two or more where the kind has a pattern.
        scale: In metres; the period of stripes, checks, plaids and other regular patterns, the
            distance of dots in a row, a flower's diameter, a stitch's width, the length of a
            gradient.
        angle: In radians; turns the pattern clockwise on a panel seen with y down. At 0 stripes
            run along the width.
        grain: Standard deviation of the thread's brightness relative to the cloth's; 0 is none.
        weave: What the grain looks like: woven, jersey, twill, melange or satin.
        seed: Of all details.
    Raises: InputError for an unknown kind or weave, a colour out of range, too few colours, or a
        scale that is not positive.
    """

    kind: str
    colours: tuple[Colour, ...]
    scale: float
    angle: float
    grain: float
    weave: str
    seed: int

    def __post_init__(self) -> None:
        _require_kind(self.kind)
        if self.weave not in WEAVES:
            known = ", ".join(WEAVES)
            raise InputError(f"unknown weave {self.weave!r}; supported weaves are {known}")
        least = _KINDS[self.kind].colours[0]
        if len(self.colours) < least:
            raise InputError(f"{self.kind} needs {least} colours or more, not {len(self.colours)}")
        if any(not 0 <= value <= 1 for colour in self.colours for value in colour):
            raise InputError(f"colours must lie in 0..1, not {self.colours}")
        if not self.scale > 0:  # refuses NaN too
            raise InputError(f"a fabric's scale must be above 0 metres, not {self.scale}")


def _require_kind(kind: str) -> None:
    if kind not in _KINDS:
        raise InputError(f"unknown fabric {kind!r}; supported kinds are {', '.join(KINDS)}")


def sample_fabric(
    rng: Generator, kinds: Sequence[str] | None = None, palette: Sequence[Colour] | None = None
) -> Fabric:
    """Sample a fabric such as a fashion catalogue shows.

    Args:
        kinds: Only these, as often relative to each other as ever; None allows all.
        palette: Take the colours from these and their tones; None chooses what goes together.
    Raises: InputError for an unknown kind, or where kinds or palette is given but empty.
    """
    names = KINDS if kinds is None else tuple(kinds)
    for name in names:
        _require_kind(name)
    if not names or (palette is not None and len(palette) == 0):
        raise InputError("no fabric can be sampled from an empty list of kinds or colours")
    weights = np.array([_KINDS[name].weight for name in names])
    name = names[rng.choice(len(names), p=weights / weights.sum())]
    kind = _KINDS[name]
    count = int(rng.integers(kind.colours[0], kind.colours[1] + 1))
    weave = str(rng.choice(kind.weaves))
    loud = 0.05 if name in ("melange", "denim") else 0.028  # two yarns are uneven by themselves
    if palette is None and name in _OWN_COLOURS:
        shares, colours = zip(*_OWN_COLOURS[name], strict=True)
        chosen = from_hex(colours[rng.choice(len(colours), p=shares)])
    else:
        chosen = sample_palette(rng, count, palette)
    return Fabric(
        kind=name,
        colours=chosen,
        scale=float(np.exp(rng.uniform(*np.log(kind.scale)))),
        angle=float(rng.choice(kind.turns)) * np.pi / 2,
        grain=float(loud * rng.uniform(0.5, 1.3)),
        weave=weave,
        seed=int(rng.integers(2**31)),
    )


def paint_fabric(
    fabric: Fabric, width_metres: float, height_metres: float, texels_per_metre: float
) -> Float32[np.ndarray, "H W 3"]:
    """Paint a flat panel of cloth; it need not continue over its own edges.

    Convention: [0, 0] is the top left corner, rows run down the height. H and W are the panel's
    sides times texels_per_metre, rounded, at least 1.

    Returns: H x W x 3 float32, sRGB-encoded, 0..1; the same bytes for the same arguments.
    Raises: InputError if a side or the resolution is not above 0.
    """
    if not min(width_metres, height_metres, texels_per_metre) > 0:
        raise InputError(
            "a panel's width, height and resolution must be above 0, not "
            f"{width_metres} m, {height_metres} m, {texels_per_metre} texels/m"
        )
    height, width = (round(metres * texels_per_metre) for metres in (height_metres, width_metres))
    shape = max(1, height), max(1, width)
    # The grain has its own stream: the pattern must not depend on the panel's size.
    rng, grain_rng = (np.random.default_rng((fabric.seed, stream)) for stream in (0, 1))
    colours = np.array(fabric.colours, np.float32) * 255
    threads = _grain(fabric.weave, grain_rng, shape, texels_per_metre)
    painter = _KINDS[fabric.kind].paint
    start = rng.random(2)
    if painter is not None:
        repeat = painter(colours, fabric.scale, rng, texels_per_metre)
        cloth = lay(repeat, fabric.angle, start, shape, texels_per_metre)
    elif fabric.kind == "gradient":
        cloth = gradient(colours, fabric.scale, fabric.angle, start, shape, texels_per_metre)
    elif fabric.kind == "tie_dye":
        cloth = tie_dye(colours, fabric.scale, rng, shape, texels_per_metre)
    elif fabric.kind == "plain":
        return one_colour(colours[0], threads, fabric.grain)
    else:  # melange and denim
        if fabric.kind == "denim":
            # Wear: about the knees and the seat the white weft shows more.
            threads += 0.35 * smooth_noise(shape, 0.25 * texels_per_metre, rng)
        return two_yarns(colours, 0.3, threads, fabric.grain)
    return with_grain(cloth, threads, fabric.grain)


@cache
def _swatch(weave: str) -> Float32[np.ndarray, "R C"]:
    """A large piece of a weave's grain, one value a cell, that every panel is cut from.

    It is the same in every run. Cutting takes a tenth of the time of making it.
    """
    rng = np.random.default_rng(WEAVES.index(weave))
    cells = rng.standard_normal((_SWATCH_CELLS, _SWATCH_CELLS), dtype=np.float32)
    swatch = 0.4 * smooth_noise(cells.shape, 0.07 / _CELL_METRES, rng)  # fading, in blots of 7 cm
    for wide, high, weight in _STREAKS[weave]:
        streaks = cv2.boxFilter(cells, cv2.CV_32F, (wide, high))
        swatch += weight * np.sqrt(wide * high) * streaks  # the mean of n has a sqrt(n)-th spread
    return swatch - swatch.mean()


def _grain(
    weave: str, rng: Generator, shape: tuple[int, int], texels_per_metre: float
) -> Float32[np.ndarray, "H W"]:
    """Cut out light and dark of the threads: mean about 0, deviation about 1 before minification.

    Args:
        shape: The panel's height and width in texels.
    """
    height, width = shape
    per_texel = 1.0 / (_CELL_METRES * texels_per_metre)
    rows, columns = (max(2, int(np.ceil(size * per_texel))) for size in shape)
    swatch = _swatch(weave)[:: int(rng.choice((-1, 1))), :: int(rng.choice((-1, 1)))]
    top, left = (int(rng.integers(max(1, _SWATCH_CELLS - side))) for side in (rows, columns))
    cut = np.ascontiguousarray(swatch[top : top + rows, left : left + columns])
    down, right = rows - cut.shape[0], columns - cut.shape[1]
    if down or right:  # a panel larger than any garment's
        cut = cv2.copyMakeBorder(cut, 0, down, 0, right, cv2.BORDER_WRAP)
    method = cv2.INTER_AREA if per_texel > 1.5 else cv2.INTER_LINEAR
    return cv2.resize(cut, (width, height), interpolation=method)
