"""Colours that clothes are sold in, alone and in combinations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

Colour = tuple[float, float, float]
"""Red, green and blue, sRGB-encoded, each 0..1."""

# Family -> (how often a catalogue shows it, its shades). The shares were set by eye to resemble
# catalogues: half of all clothes are black, white, grey or navy.
_FAMILIES: dict[str, tuple[float, str]] = {
    "black": (0.17, "121214 17171a 1c1c1f 0e0e10 222226"),
    "white": (0.14, "f6f6f4 f1efe9 fafafa ebe6da f3ede1"),
    "grey": (0.11, "3a3b3f 54565b 77797d 9c9ea2 bfc1c4 d6d7d9"),
    "navy": (0.10, "151c33 1b2541 222d4a 101729 2b3552"),
    "denim": (0.08, "2b3f5e 3d567c 5a77a0 7f9cc0 a3b9d3 1f2c42"),
    "earth": (0.12, "d8c7a8 c8b08a b89a72 9b7a54 74583e 4d382a a6865f e2d6c0 8a4f2f"),
    "deep": (0.10, "5b1625 6e1f2e 24402f 2f4a37 4c5330 5f6238 3f2548 134548 7a3a20"),
    "pastel": (0.10, "eec9cd f3d9d4 c3d7ea cfe3d8 d9cde8 f4e8bd f6d5bb b7d3cf"),
    "saturated": (0.08, "c2182b e0382f 1f4fae 0f7a55 e0a526 c92b73 ee7a2c ef6f63 18a0a8 f2cf3a"),
}

# Combinations that sell: the first colour is the ground, the rest lie on it.
_COMBINATIONS = """
f6f6f4 1b2541
1b2541 f6f6f4
f3ede1 c2182b 1b2541
121214 f6f6f4
f6f6f4 121214
121214 9c9ea2 f6f6f4
3a3b3f bfc1c4 f1efe9
f1efe9 5a77a0 2b3f5e
c3d7ea fafafa 3d567c
eec9cd f6f6f4 6e1f2e
f6f6f4 eec9cd 24402f c92b73
f3ede1 b89a72 74583e 24402f
d8c7a8 121214 f6f6f4 c2182b
5b1625 f3ede1 b89a72
6e1f2e 151c33 f3ede1 e0a526
24402f 1b2541 c2182b f2cf3a
c2182b 121214 f6f6f4
c2182b 1b2541 24402f f1efe9
151c33 24402f 121214 e2d6c0
1b2541 c2182b f6f6f4
4c5330 d8c7a8 2a2a1c 8c8456
e2d6c0 8a4f2f 4c5330 e0a526
f6f6f4 ef6f63 f4e8bd 0f7a55
f6f6f4 1f4fae 18a0a8 c3d7ea
121214 c92b73 ee7a2c 0f7a55
121214 eec9cd c2182b 5f6238
1b2541 eec9cd c92b73 5f6238
1b2541 c3d7ea f6f6f4 5a77a0
134548 f6d5bb ee7a2c f1efe9
cfe3d8 fafafa 2f4a37 eec9cd
d9cde8 3f2548 fafafa 7f9cc0
e0a526 121214 f3ede1
e0a526 1b2541 f3ede1 8a4f2f
7a3a20 e2d6c0 151c33
9c9ea2 3a3b3f f6f6f4
77797d d6d7d9 1c1c1f eec9cd
f4e8bd 5a77a0 f6f6f4 ef6f63
2b3f5e a3b9d3 f1efe9
0f7a55 f6f6f4 1b2541
1f4fae f6f6f4 e0382f
"""


def from_hex(text: str) -> tuple[Colour, ...]:
    """Read colours written as rrggbb, with blanks between them."""
    codes = map(bytes.fromhex, text.split())
    return tuple((red / 255, green / 255, blue / 255) for red, green, blue in codes)


_SHADES = [from_hex(shades) for _, shades in _FAMILIES.values()]
_SHARES = np.array([share for share, _ in _FAMILIES.values()])
_SHARES /= _SHARES.sum()
_SETS = [from_hex(line) for line in _COMBINATIONS.strip().splitlines()]


def luminance(colour: Colour) -> float:
    """Tell how light a colour looks, 0..1: Rec. 709 weights on the encoded values."""
    return 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]


def mix(first: Colour, second: Colour, share: float) -> Colour:
    """Mix a share (0..1) of the second colour into the first."""
    red, green, blue = (a + (b - a) * share for a, b in zip(first, second, strict=True))
    return (red, green, blue)


def _as_dyed(rng: Generator, colour: Colour) -> Colour:
    """Dye a colour in another bath: a little lighter, darker or off in hue."""
    gain = rng.normal(1.0, 0.05)
    dyed = np.array(colour) * gain + rng.normal(0.0, 0.008, 3)
    red, green, blue = np.clip(dyed, 0.02, 0.99).tolist()  # no cloth is quite black or white
    return (red, green, blue)


def sample_colour(rng: Generator) -> Colour:
    """Sample a colour for a plain garment: mostly neutrals, navy and denim, some strong ones."""
    shades = _SHADES[rng.choice(len(_SHADES), p=_SHARES)]
    return _as_dyed(rng, shades[rng.integers(len(shades))])


def _tone_of(rng: Generator, colour: Colour) -> Colour:
    """Sample a clearly lighter or darker tone of a colour, away from the end it is near."""
    end = (0.02, 0.02, 0.03) if luminance(colour) > rng.uniform(0.35, 0.6) else (1.0, 0.99, 0.97)
    return mix(colour, end, rng.uniform(0.3, 0.6))


def sample_palette(
    rng: Generator, count: int, allowed: Sequence[Colour] | None = None
) -> tuple[Colour, ...]:
    """Sample colours that go together, ground first.

    Args:
        count: How many, at least 1.
        allowed: Take colours from these alone (and tones of them where they are too few).
    """
    if allowed is not None:
        order = rng.permutation(len(allowed))
        chosen = [allowed[index] for index in order[:count]]
    elif count == 1:
        chosen = [sample_colour(rng)]
    elif rng.random() < 0.65:
        curated = _SETS[rng.integers(len(_SETS))]
        chosen = [_as_dyed(rng, colour) for colour in curated[:count]]
    else:
        chosen = [sample_colour(rng)]
        if rng.random() < 0.5:  # a colour and the neutral that sets it off
            pale, dark = from_hex("f3efe6 1b1d26")
            neutral = pale if luminance(chosen[0]) < 0.5 else dark
            chosen.append(_as_dyed(rng, neutral))
    while len(chosen) < count:
        chosen.append(_tone_of(rng, chosen[int(rng.integers(len(chosen)))]))
    return tuple(chosen)
