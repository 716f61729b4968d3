"""Hair styles, drawn by chance or given."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from motion_transfer.people.figure.body import Shape
from motion_transfer.people.head.faces import Colour, Face, Hairline, MakeUp, greyed, sample_face

# style: how common among women and men
STYLES: dict[str, tuple[float, float]] = {
    "bald": (0.0, 0.04),
    "buzz": (0.01, 0.16),
    "short": (0.02, 0.26),
    "side_part": (0.02, 0.20),
    "quiff": (0.0, 0.12),
    "curly_short": (0.04, 0.09),
    "pixie": (0.08, 0.01),
    "bob": (0.14, 0.01),
    "shoulder": (0.15, 0.04),
    "long": (0.24, 0.02),
    "ponytail": (0.13, 0.01),
    "bun": (0.09, 0.02),
    "braid": (0.06, 0.0),
    "afro": (0.02, 0.02),
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
        style: one of STYLES.
        colour, roots: sRGB.
        grey: share of grey strands.
        length: metres from the ears downward where hair hangs; of a tail from its tie.
        volume: metres that hair stands off the head.
        wave: metres that waves swing.
        curl: 0 straight .. 1 tufts.
        part: -1 on the right .. 0 in the middle .. 1 on the left.
        fringe: 0 none .. 1 down to the brows.
        front: share of hanging hair that falls in front of the shoulders.
        tuck: hair is behind the ears.
        tie: height of a pony tail or bun, 0 nape .. 1 crown.
        hairline: where it begins.
        hat: one of HATS.
        hat_colour: sRGB.
        seed: for strands and raggedness.
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


# metres: shortest and longest hanging length, least and most volume
_SIZES: dict[str, tuple[float, float, float, float]] = {
    "bald": (0.0, 0.0, 0.0, 0.0),
    "buzz": (0.0, 0.0, 0.003, 0.006),
    "short": (0.0, 0.0, 0.010, 0.024),
    "side_part": (0.0, 0.0, 0.014, 0.028),
    "quiff": (0.0, 0.0, 0.016, 0.034),
    "curly_short": (0.0, 0.0, 0.020, 0.040),
    "pixie": (0.0, 0.0, 0.014, 0.026),
    "bob": (0.075, 0.14, 0.014, 0.028),
    "shoulder": (0.16, 0.24, 0.012, 0.026),
    "long": (0.28, 0.55, 0.010, 0.026),
    "ponytail": (0.18, 0.42, 0.007, 0.014),
    "bun": (0.0, 0.0, 0.007, 0.014),
    "braid": (0.30, 0.50, 0.008, 0.014),
    "afro": (0.0, 0.0, 0.045, 0.095),
}


def sample_hair(rng: np.random.Generator, shape: Shape, face: Face | None = None) -> Hair:
    """Draw hair that goes with a body and, where given, with the colour and hairline of a face."""
    face = face or sample_face(rng, shape)
    female = bool(rng.random() < np.clip((shape.gender - 0.5) * 4 + 0.5, 0, 1))
    # what the face says comes before the body's build
    female = (female or face.make_up != MakeUp()) and face.beard == "none"
    african = shape.african / max(shape.african + shape.asian + shape.caucasian, 1e-6)
    style = _sample_style(rng, female, african, face)
    low, high, thin, thick = _SIZES[style]
    curly = float(np.clip(rng.beta(1.2, 4) + 0.8 * african * rng.random(), 0, 1))
    if style in ("curly_short", "afro"):
        curly = float(rng.uniform(0.7, 1))
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
        length=float(rng.uniform(low, high)),
        volume=float(rng.uniform(thin, thick)) + 0.010 * curly * (high > 0),
        wave=max(wave, 0.012 * curly),
        curl=curly,
        part=float(rng.choice([0.0, -1.0, 1.0]) * rng.uniform(0.5, 1)),
        fringe=float(rng.uniform(0.75, 1.0)) if female and rng.random() < 0.28 else 0.0,
        front=float(rng.choice([0.0, 0.5, 1.0], p=(0.35, 0.25, 0.4))),
        tuck=bool(rng.random() < 0.25),
        tie=float(rng.uniform(0.0, 1.0)),
        hairline=face.hairline,
        hat=_sample_hat(rng, style),
        hat_colour=_sample_hat_colour(rng),
        seed=int(rng.integers(2**31)),
    )


def _sample_style(rng: np.random.Generator, female: bool, african: float, face: Face) -> str:
    names = list(STYLES)
    shares = np.array([STYLES[name][0 if female else 1] for name in names])
    shares[names.index("afro")] += 0.14 * african
    shares[names.index("buzz")] += 0.20 * african
    if face.hairline.crown > 0.3:  # what is left of it is short
        shares *= [name in ("bald", "buzz", "short") for name in names]
        shares[names.index("bald")] += 0.2
    return names[rng.choice(len(names), p=shares / shares.sum())]


def _sample_hat(rng: np.random.Generator, style: str) -> str:
    if style in ("afro", "quiff", "curly_short", "bun") or rng.random() > 0.07:
        return "none"
    return HATS[1 + rng.choice(3, p=(0.45, 0.4, 0.15))]


def _sample_hat_colour(rng: np.random.Generator) -> Colour:
    if rng.random() < 0.5:
        level = float(rng.uniform(0.06, 0.8))
        return level, level, level
    r, g, b = rng.uniform(0.05, 0.75, 3)
    return float(r), float(g), float(b)
