"""Prints on shirts: lettering, numbers and pictures with a transparent ground.

sample_print -> Print -> paint_print -> pixels and alpha
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32
from numpy.random import Generator

from motion_transfer.errors import InputError
from motion_transfer.people.clothes.fabrics.colours import Colour, luminance, mix, sample_colour
from motion_transfer.people.clothes.prints.canvas import PrintCanvas
from motion_transfer.people.clothes.prints.pictures import PICTURES
from motion_transfer.people.picture.paint import smooth_noise

__all__ = ["PRINT_KINDS", "Print", "paint_print", "sample_print"]

# Kind -> (how often, height / width). A picture may have a line of letters below it.
_KINDS: dict[str, tuple[float, float]] = {
    "word": (0.2, 0.32),
    "slogan": (0.18, 0.6),
    "arc": (0.1, 0.55),
    "number": (0.12, 1.0),
    "picture": (0.4, 1.0),
}
PRINT_KINDS = tuple(_KINDS)

_UPRIGHT = (
    cv2.FONT_HERSHEY_SIMPLEX,
    cv2.FONT_HERSHEY_DUPLEX,
    cv2.FONT_HERSHEY_COMPLEX,
    cv2.FONT_HERSHEY_TRIPLEX,
    cv2.FONT_HERSHEY_TRIPLEX | cv2.FONT_ITALIC,
)
_SCRIPTS = (cv2.FONT_HERSHEY_SCRIPT_SIMPLEX, cv2.FONT_HERSHEY_SCRIPT_COMPLEX)

# Invented words are one of these before one of those; none was chosen for what it means.
_BEGINNINGS = (
    "Nor", "Tam", "Bri", "Gar", "Mont", "Dal", "Lor", "Wil", "Har", "Sten", "Kel", "Fen", "Ros",
    "Mar", "Cal", "Thorn", "Ald", "Bel",
)  # fmt: skip
_ENDINGS = (
    "ven", "rin", "sol", "bay", "mora", "dun", "fell", "mere", "dale", "nia", "lund", "port",
    "tova", "grin", "ra",
)  # fmt: skip
_SECOND_LINES = (
    "CLUB", "TEAM", "COAST", "STUDIO", "SUMMER", "ORIGINAL", "VALLEY", "ISLAND", "ATHLETICS",
    "SUPPLY", "GARDEN", "HARBOUR",
)  # fmt: skip

# Least difference in luminance between the ground and the ink that carries the print.
_CONTRAST = 0.3


@dataclass(frozen=True)
class Print:
    """One print.

    Attributes:
        kind: One of PRINT_KINDS.
        picture: What a "picture" shows, one of `pictures.PICTURES`; "" otherwise.
        lines: Of letters, from the top; a picture may have none.
        font: One of cv2's Hershey fonts.
        weight: The strokes' thickness as a share of the letters' height.
        inks: sRGB 0..1; the first stands out from the cloth.
        outlined: Letters have a contour in the second ink.
        wear: 0..1, how much of the ink is washed out.
        aspect: Natural height / width.
        seed: Of all details.
    Raises: InputError for an unknown kind or picture, or fewer than three inks.
    """

    kind: str
    picture: str
    lines: tuple[str, ...]
    font: int
    weight: float
    inks: tuple[Colour, ...]
    outlined: bool
    wear: float
    aspect: float
    seed: int

    def __post_init__(self) -> None:
        if self.kind not in _KINDS:
            known = ", ".join(PRINT_KINDS)
            raise InputError(f"unknown print {self.kind!r}; supported kinds are {known}")
        if self.kind == "picture" and self.picture not in PICTURES:
            known = ", ".join(PICTURES)
            raise InputError(f"unknown picture {self.picture!r}; supported pictures are {known}")
        if len(self.inks) < 3:
            raise InputError(f"a print needs 3 inks, not {len(self.inks)}")


def _word(rng: Generator) -> str:
    return str(rng.choice(_BEGINNINGS)) + str(rng.choice(_ENDINGS))


def _sample_inks(rng: Generator, ground: Colour) -> tuple[Colour, ...]:
    """Sample four inks: the first far from the ground, each off the ground and the one before."""
    end: Colour = (0.07, 0.07, 0.09) if luminance(ground) > 0.5 else (0.96, 0.95, 0.92)
    first = sample_colour(rng)
    if rng.random() < 0.4 or abs(luminance(first) - luminance(ground)) < _CONTRAST:
        first = mix(end, first, rng.uniform(0, 0.15))
    inks = [first]
    for _ in range(3):
        ink = sample_colour(rng)
        for _ in range(6):  # tries; then any will do
            if all(np.abs(np.subtract(ink, other)).sum() > 0.45 for other in (ground, inks[-1])):
                break
            ink = sample_colour(rng)
        inks.append(ink)
    return tuple(inks)


def _sample_lines(rng: Generator, kind: str) -> tuple[str, ...]:
    if kind == "number":
        name = (_word(rng).upper(),) if rng.random() < 0.3 else ()
        return (*name, str(rng.integers(1, 100)))
    word = _word(rng)
    if rng.random() < 0.65:
        word = word.upper()
    if kind == "slogan":
        second = str(rng.choice(_SECOND_LINES))
        if rng.random() < 0.3:
            second = f"EST. {rng.integers(1950, 2020)}"
        return (word, second)
    if kind == "picture" and rng.random() < 0.55:
        return ()
    return (word,)


def sample_print(rng: Generator, ground_colour: Colour) -> Print:
    """Sample a print such as T-shirts and sweatshirts bear.

    Args:
        ground_colour: The cloth's, sRGB 0..1; the first ink stands out from it.
    """
    kind = str(rng.choice(PRINT_KINDS, p=[share for share, _ in _KINDS.values()]))
    lines = _sample_lines(rng, kind)
    aspect = _KINDS[kind][1]
    if len(lines) == 1 and kind == "picture":
        aspect = 1.22  # a line of letters below it
    script = kind in ("word", "slogan") and lines[0].istitle() and rng.random() < 0.6
    return Print(
        kind=kind,
        picture=str(rng.choice(tuple(PICTURES))) if kind == "picture" else "",
        lines=lines,
        font=int(rng.choice(_SCRIPTS if script else _UPRIGHT)),
        weight=float(rng.uniform(0.08, 0.13) if script else rng.uniform(0.1, 0.24)),
        inks=_sample_inks(rng, ground_colour),
        outlined=bool(rng.random() < (0.55 if kind in ("number", "arc") else 0.15)),
        wear=float(rng.uniform(0.2, 0.6) if rng.random() < 0.25 else 0.0),
        aspect=aspect,
        seed=int(rng.integers(2**31)),
    )


def paint_print(design: Print, width_px: int, height_px: int) -> Float32[np.ndarray, "H W 4"]:
    """Paint a print as large as fits width_px x height_px, centred, in its own proportions.

    Returns: H x W x 4 float32 in 0..1: sRGB-encoded colour, not multiplied by alpha, then alpha.
        Where alpha is 0 the colour is the first ink, so that enlarging leaves no fringe. The same
        bytes for the same arguments.
    Raises: InputError if a side is below 1.
    """
    if min(width_px, height_px) < 1:
        raise InputError(f"a print must measure 1 pixel or more, not {width_px} x {height_px}")
    rng = np.random.default_rng(design.seed)
    canvas = PrintCanvas(width_px, height_px, design.aspect)
    if design.kind == "picture":
        PICTURES[design.picture](canvas, design.inks, rng)
    _letter(canvas, design)
    if design.kind == "arc":
        canvas.bend(rng.uniform(0.12, 0.22))
    picture = canvas.finish(design.inks[0])
    if design.wear > 0:
        cracks = smooth_noise((height_px, width_px), max(1.5, width_px / 60), rng)
        cracks = 0.6 * cracks + smooth_noise((height_px, width_px), max(2.0, width_px / 8), rng)
        picture[..., 3] *= np.clip(1.3 - design.wear + 0.3 * cracks, 0.15, 1)
    return picture


def _letter(canvas: PrintCanvas, design: Print) -> None:
    """Set the lines: each kind has its own boxes."""
    bottom = canvas.aspect - 0.02
    if design.kind == "picture":
        boxes = ((0.06, 1.04, 0.94, bottom),)
    elif design.kind == "slogan":
        boxes = ((0.02, 0.02, 0.98, 0.36), (0.1, 0.42, 0.9, bottom))
    elif design.kind == "number" and len(design.lines) == 2:
        boxes = ((0.02, 0.02, 0.98, 0.2), (0.04, 0.27, 0.96, bottom))
    elif design.kind == "arc":
        boxes = ((0.05, 0.14, 0.95, bottom - 0.12),)  # leaves room to be bent
    else:
        boxes = ((0.02, 0.02, 0.98, bottom),)
    edge = design.inks[1] if design.outlined else None
    for line, box in zip(design.lines, boxes, strict=False):
        canvas.text(line, box, design.font, design.weight, design.inks[0], edge)
