"""Hair styles, drawn by chance or given. Shares and sizes were chosen by eye."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from motion_transfer.people.figure.body import Shape
from motion_transfer.people.head.faces import Colour, Face, Hairline, MakeUp, greyed, sample_face


class Style(NamedTuple):
    """How common a style is, and how large it can be.

    Attributes:
        women, men: Its share among them.
        length: Least and most that it hangs, metres.
        volume: Least and most that it stands off the head, metres.
    """

    women: float
    men: float
    length: tuple[float, float]
    volume: tuple[float, float]


STYLES = {
    "bald": Style(0.0, 0.04, (0.0, 0.0), (0.0, 0.0)),
    "buzz": Style(0.01, 0.16, (0.0, 0.0), (0.003, 0.006)),
    "short": Style(0.02, 0.26, (0.0, 0.0), (0.010, 0.024)),
    "side_part": Style(0.02, 0.20, (0.0, 0.0), (0.014, 0.028)),
    "quiff": Style(0.0, 0.12, (0.0, 0.0), (0.016, 0.034)),
    "curly_short": Style(0.04, 0.09, (0.0, 0.0), (0.020, 0.040)),
    "pixie": Style(0.08, 0.01, (0.0, 0.0), (0.014, 0.026)),
    "bob": Style(0.14, 0.01, (0.075, 0.14), (0.014, 0.028)),
    "shoulder": Style(0.15, 0.04, (0.16, 0.24), (0.012, 0.026)),
    "long": Style(0.24, 0.02, (0.28, 0.55), (0.010, 0.026)),
    "ponytail": Style(0.13, 0.01, (0.18, 0.42), (0.007, 0.014)),
    "bun": Style(0.09, 0.02, (0.0, 0.0), (0.007, 0.014)),
    "braid": Style(0.06, 0.0, (0.30, 0.50), (0.008, 0.014)),
    "afro": Style(0.02, 0.02, (0.0, 0.0), (0.045, 0.095)),
}
HATS = ("none", "beanie", "cap", "brim")
_DYES: tuple[Colour, ...] = (
    (0.72, 0.62, 0.50),
    (0.50, 0.10, 0.12),
    (0.62, 0.30, 0.42),
    (0.20, 0.28, 0.48),
    (0.78, 0.74, 0.70),
    (0.42, 0.22, 0.12),
)


@dataclass(frozen=True)
class Hair:
    """One head of hair, and what is worn on it. JSON-able through `dataclasses.asdict`.

    Attributes:
        style: One of STYLES.
        colour, roots: Both sRGB.
        grey: Share of grey strands.
        length: Metres from the ears downward where hair hangs, a tail's from its tie.
        volume: Metres that hair stands off the head.
        wave: Metres that waves swing.
        curl: 0 straight .. 1 tufts.
        part: -1 on the right .. 0 in the middle .. 1 on the left.
        fringe: 0 none .. 1 down to the brows.
        front: Share of hanging hair that falls in front of the shoulders.
        tuck: Whether hair is behind the ears.
        tie: Height of a pony tail or bun, 0 nape .. 1 crown.
        hairline: Where it begins.
        hat: One of HATS.
        hat_colour: What the hat is made of, sRGB.
        seed: Decides strands and raggedness.
    """

    style: str
    colour: Colour = (0.19, 0.135, 0.105)
    roots: Colour = (0.19, 0.135, 0.105)
    grey: float = 0.0
    length: float = 0.2
    volume: float = 0.02
    wave: float = 0.0
    curl: float = 0.0
    part: float = 0.0
    fringe: float = 0.0
    front: float = 0.0
    tuck: bool = False
    tie: float = 0.5
    hairline: Hairline = field(default_factory=Hairline)
    hat: str = "none"
    hat_colour: Colour = (0.2, 0.2, 0.25)
    seed: int = 0


def sample_hair(rng: np.random.Generator, shape: Shape, face: Face | None = None) -> Hair:
    """Draw hair that goes with a body and, where given, with the colour and hairline of a face."""
    face = face or sample_face(rng, shape)
    female = bool(rng.random() < np.clip((shape.gender - 0.5) * 4 + 0.5, 0, 1))
    # what the face says comes before the body's build
    female = (female or face.make_up != MakeUp()) and face.beard == "none"
    african = shape.african / max(shape.african + shape.asian + shape.caucasian, 1e-6)
    style = _sample_style(rng, female, african, face)
    hangs = STYLES[style].length
    curly = float(np.clip(rng.beta(1.2, 4) + 0.8 * african * rng.random(), 0, 1))
    if style in ("curly_short", "afro"):
        curly = rng.uniform(0.7, 1)
    elif style not in ("long", "shoulder", "bob"):
        curly *= 0.4
    natural = greyed(face.hair_colour, face.grey)
    dyed = rng.random() < (0.12 if female else 0.02)
    colour = _DYES[rng.integers(len(_DYES))] if dyed else natural
    wave = float(rng.choice([0.0, rng.uniform(0, 0.006), rng.uniform(0.005, 0.014)]))
    return Hair(
        style=style,
        colour=colour,
        roots=natural if rng.random() < 0.4 else colour,
        grey=0.0 if dyed else 0.5 * face.grey * (1 - face.grey),
        length=rng.uniform(*hangs),
        volume=rng.uniform(*STYLES[style].volume) + 0.010 * curly * (hangs[1] > 0),
        wave=max(wave, 0.012 * curly),
        curl=curly,
        part=float(rng.choice([0.0, -1.0, 1.0]) * rng.uniform(0.5, 1)),
        fringe=rng.uniform(0.75, 1.0) if female and rng.random() < 0.28 else 0.0,
        front=float(rng.choice([0.0, 0.5, 1.0], p=(0.35, 0.25, 0.4))),
        tuck=bool(rng.random() < 0.25),
        tie=rng.uniform(0.0, 1.0),
        hairline=face.hairline,
        hat=_sample_hat(rng, style),
        hat_colour=_sample_hat_colour(rng),
        seed=int(rng.integers(2**31)),
    )


def _sample_style(rng: np.random.Generator, female: bool, african: float, face: Face) -> str:
    names = list(STYLES)
    shares = np.array([each.women if female else each.men for each in STYLES.values()])
    shares[names.index("afro")] += 0.14 * african
    shares[names.index("buzz")] += 0.20 * african
    if face.hairline.crown > 0.3:  # what is left of it is short
        shares *= [name in ("bald", "buzz", "short") for name in names]
        shares[names.index("bald")] += 0.2
    return names[rng.choice(len(names), p=shares / shares.sum())]


def _sample_hat(rng: np.random.Generator, style: str) -> str:
    # what stands high on the head would go through a hat
    if style in ("afro", "quiff", "curly_short", "bun") or rng.random() > 0.07:
        return "none"
    return HATS[1 + rng.choice(3, p=(0.45, 0.4, 0.15))]


def _sample_hat_colour(rng: np.random.Generator) -> Colour:
    if rng.random() < 0.5:  # black, grey or white
        level = rng.uniform(0.06, 0.8)
        return level, level, level
    r, g, b = rng.uniform(0.05, 0.75, 3)
    return float(r), float(g), float(b)
