"""Faces: what a person's skin, features and facial hair look like, drawn by chance or given.

    sample_face -> Face -> skin_pieces (skin.py) -> pieces

A Face is a description (JSON-able through `dataclasses.asdict`); painting it draws no further
chance than its seed, so that a person looks the same in every pose. Colours are sRGB in [0, 1],
lengths millimetres on the template's face. Colours and shares were chosen by eye.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from motion_transfer.people.figure.body import Shape

Colour = tuple[float, float, float]

BEARDS = ("none", "stubble", "moustache", "goatee", "full")
GLASSES = ("none", "round", "square", "wide", "sun")

# a lit lock's colour, and how common it is among (african, asian, caucasian) body types
HAIR_COLOURS: dict[str, tuple[Colour, tuple[float, float, float]]] = {
    "black": ((0.145, 0.125, 0.118), (0.70, 0.62, 0.10)),
    "dark_brown": ((0.190, 0.135, 0.105), (0.24, 0.28, 0.26)),
    "brown": ((0.305, 0.210, 0.145), (0.04, 0.07, 0.24)),
    "light_brown": ((0.440, 0.320, 0.220), (0.01, 0.02, 0.15)),
    "dark_blonde": ((0.560, 0.440, 0.300), (0.0, 0.005, 0.11)),
    "blonde": ((0.735, 0.610, 0.425), (0.005, 0.005, 0.09)),
    "auburn": ((0.380, 0.175, 0.100), (0.005, 0.0, 0.03)),
    "red": ((0.600, 0.290, 0.130), (0.0, 0.0, 0.02)),
}
GREY: Colour = (0.70, 0.69, 0.67)
_IRISES: tuple[tuple[Colour, float], ...] = (  # and how common with light hair, brown ones first
    ((0.20, 0.12, 0.07), 0.25),
    ((0.33, 0.21, 0.11), 0.20),
    ((0.42, 0.36, 0.20), 0.15),
    ((0.38, 0.44, 0.36), 0.12),
    ((0.42, 0.53, 0.62), 0.20),
    ((0.48, 0.53, 0.56), 0.08),
)
_FRAMES = ((0.06, 0.05, 0.05), (0.22, 0.14, 0.09), (0.55, 0.50, 0.42), (0.35, 0.36, 0.38))
# from very light to very dark, as in an evenly lit photo (Fitzpatrick I .. VI and beyond)
_TONES = np.array(
    [
        (0.945, 0.815, 0.745),
        (0.900, 0.735, 0.640),
        (0.835, 0.655, 0.535),
        (0.745, 0.555, 0.420),
        (0.610, 0.425, 0.305),
        (0.450, 0.300, 0.215),
        (0.320, 0.215, 0.160),
        (0.235, 0.160, 0.125),
    ]
)


@dataclass(frozen=True)
class Complexion:
    """Skin.

    Attributes:
        tone: 0 very light .. 1 very dark.
        warmth: -1 pink .. 1 olive.
        flush: How much redder cheeks, nose and ears are, 0 .. 1.
        freckles, lines: Strength, 0 .. 1; lines come with age.
    """

    tone: float
    warmth: float = 0.0
    flush: float = 0.4
    freckles: float = 0.0
    lines: float = 0.0

    @property
    def colour(self) -> Colour:
        """Mix the skin's middle colour, sRGB."""
        at = np.clip(self.tone, 0, 1) * (len(_TONES) - 1)
        rgb = np.array([np.interp(at, np.arange(len(_TONES)), channel) for channel in _TONES.T])
        rgb = np.clip(rgb * (1 + 0.03 * self.warmth * np.array([-0.2, 0.6, -1.6])), 0, 1)
        return float(rgb[0]), float(rgb[1]), float(rgb[2])


@dataclass(frozen=True)
class Brows:
    """Eyebrows; `height` is measured from the eye's middle, `strength` is 0 .. 1."""

    thickness: float = 3.4
    arch: float = 2.5
    height: float = 20.0
    length: float = 40.0
    strength: float = 0.8


@dataclass(frozen=True)
class MakeUp:
    """Make-up; strengths in 0 .. 1, 0 is none.

    Attributes:
        lipstick, eye_shadow: What colour each has.
    """

    lips: float = 0.0
    lipstick: Colour = (0.65, 0.12, 0.16)
    liner: float = 0.0
    shadow: float = 0.0
    eye_shadow: Colour = (0.45, 0.32, 0.28)
    blush: float = 0.0


@dataclass(frozen=True)
class Hairline:
    """Where the scalp's hair begins.

    Attributes:
        raised: How much higher than usual the whole front is.
        temples: How far the temples recede.
        peak: How far a widow's peak comes down.
        crown: How bald the crown is, 0 .. 1.
    """

    raised: float = 0.0
    temples: float = 3.0
    peak: float = 0.0
    crown: float = 0.0


@dataclass(frozen=True)
class Face:
    """One person's face.

    Attributes:
        complexion: Skin.
        iris: Colour of the eyes.
        hair_colour: What hair, brows and beard have as they grow, before dye.
        grey: Share of grey hair, 0 .. 1.
        brows: Eyebrows.
        lip_fullness: 0 thin .. 1 full; it is painted, the skin's shape stays.
        lip_redness: 0 as the skin .. 1.
        make_up: None by default.
        beard: One of BEARDS.
        beard_length: Millimetres; stubble is below 2.
        glasses: One of GLASSES.
        frame: Colour of their frame.
        hairline: Where the hair begins.
        scalp: How dark the scalp under the hair is, 0 bald .. 1 dense.
        seed: Decides mottling, freckles and single hairs.
    """

    complexion: Complexion
    iris: Colour = (0.20, 0.12, 0.07)
    hair_colour: Colour = HAIR_COLOURS["dark_brown"][0]
    grey: float = 0.0
    brows: Brows = field(default_factory=Brows)
    lip_fullness: float = 0.5
    lip_redness: float = 0.5
    make_up: MakeUp = field(default_factory=MakeUp)
    beard: str = "none"
    beard_length: float = 0.0
    glasses: str = "none"
    frame: Colour = (0.06, 0.05, 0.05)
    hairline: Hairline = field(default_factory=Hairline)
    scalp: float = 0.8
    seed: int = 0


def greyed(colour: Colour, share: float) -> Colour:
    """Mix hair of a colour with a share of grey hairs."""
    mixed = [(1 - share) * own + share * grey for own, grey in zip(colour, GREY, strict=True)]
    return mixed[0], mixed[1], mixed[2]


def sample_face(rng: np.random.Generator, shape: Shape) -> Face:
    """Draw a face that goes with a body: tone by its type, lines by its age, beards by gender."""
    kinds = np.array([shape.african, shape.asian, shape.caucasian]) + 1e-6
    kinds = kinds / kinds.sum()
    tone = float(np.clip(kinds @ [0.76, 0.34, 0.24] + rng.normal(0, 0.11), 0.02, 1.0))
    names = list(HAIR_COLOURS)
    shares = np.array([HAIR_COLOURS[name][1] for name in names]) @ kinds
    if tone > 0.5:  # fair hair on dark skin would be dyed
        shares[3:] *= 0.03
    colour = HAIR_COLOURS[names[rng.choice(len(names), p=shares / shares.sum())]][0]
    colour = _varied(rng, colour, 0.12)
    old = float(np.clip((shape.age - 0.72) / 0.28, 0, 1))  # 0 for young adults
    grey = float(np.clip(rng.normal(1.1, 0.3) * old**1.3, 0, 1)) if rng.random() < 0.85 else 0.0
    # the middle of the range may look like either, its ends do not
    female = bool(rng.random() < np.clip((shape.gender - 0.5) * 4 + 0.5, 0, 1))
    beard, length = _sample_beard(rng, female)
    return Face(
        complexion=_sample_complexion(rng, tone, old),
        iris=_sample_iris(rng, colour, tone),
        hair_colour=colour,
        grey=grey,
        brows=_sample_brows(rng, female),
        lip_fullness=float(np.clip(rng.normal(0.45 + 0.15 * female, 0.2), 0, 1)),
        lip_redness=rng.uniform(0.25, 0.8),
        make_up=_sample_make_up(rng) if female else MakeUp(),
        beard=beard,
        beard_length=length,
        glasses=_sample_glasses(rng, old),
        frame=_varied(rng, _FRAMES[rng.choice(4, p=(0.45, 0.2, 0.15, 0.2))], 0.15),
        hairline=_sample_hairline(rng, female, old),
        scalp=rng.uniform(0.6, 0.95),
        seed=int(rng.integers(2**31)),
    )


def _varied(rng: np.random.Generator, colour: Colour, amount: float) -> Colour:
    """Vary a colour's lightness by a share, and its hue by a fifth of that."""
    light = np.exp(rng.normal(0, amount))
    rgb = np.clip(np.array(colour) * light * np.exp(rng.normal(0, amount / 5, 3)), 0.03, 0.95)
    return float(rgb[0]), float(rgb[1]), float(rgb[2])


def _sample_complexion(rng: np.random.Generator, tone: float, old: float) -> Complexion:
    freckled = rng.random() < (0.25 if tone < 0.25 else 0.06)
    return Complexion(
        tone=tone,
        warmth=float(np.clip(rng.normal(0, 0.5), -1, 1)),
        flush=rng.uniform(0.2, 0.8),
        freckles=rng.uniform(0.3, 1) if freckled else 0.0,
        lines=float(np.clip(old * rng.uniform(0.6, 1.2) + 0.1 * rng.random(), 0, 1)),
    )


def _sample_iris(rng: np.random.Generator, hair: Colour, tone: float) -> Colour:
    light_hair = float(np.clip((sum(hair) / 3 - 0.12) / 0.25, 0, 1)) * float(tone < 0.45)
    shares = np.array([share for _, share in _IRISES]) * np.array([1, 1] + 4 * [light_hair])
    return _varied(rng, _IRISES[rng.choice(len(_IRISES), p=shares / shares.sum())][0], 0.12)


def _sample_brows(rng: np.random.Generator, female: bool) -> Brows:
    return Brows(
        thickness=rng.uniform(2.2, 4.2) if female else rng.uniform(3.2, 6.0),
        arch=rng.uniform(1.5, 4.5) if female else rng.uniform(0.3, 2.8),
        height=rng.uniform(18.5, 22.5) if female else rng.uniform(16.5, 20.0),
        length=rng.uniform(34, 44),
        strength=rng.uniform(0.6, 0.95),
    )


def _sample_make_up(rng: np.random.Generator) -> MakeUp:
    if rng.random() < 0.4:  # none, or next to none
        return MakeUp(liner=rng.uniform(0, 0.3))
    sticks = ((0.62, 0.10, 0.14), (0.72, 0.32, 0.34), (0.58, 0.22, 0.24), (0.45, 0.10, 0.16))
    shades = ((0.45, 0.32, 0.28), (0.30, 0.27, 0.28), (0.55, 0.40, 0.42), (0.35, 0.33, 0.42))
    return MakeUp(
        lips=rng.uniform(0.2, 0.9),
        lipstick=_varied(rng, sticks[rng.integers(len(sticks))], 0.12),
        liner=rng.uniform(0.2, 1),
        shadow=rng.uniform(0, 0.6),
        eye_shadow=_varied(rng, shades[rng.integers(len(shades))], 0.1),
        blush=rng.uniform(0, 0.5),
    )


def _sample_beard(rng: np.random.Generator, female: bool) -> tuple[str, float]:
    if female:
        return "none", 0.0
    beard = BEARDS[rng.choice(len(BEARDS), p=(0.44, 0.24, 0.06, 0.08, 0.18))]
    lengths = {"none": (0, 0), "stubble": (0.3, 1.8), "moustache": (4, 7), "goatee": (4, 10)}
    low, high = lengths.get(beard, (4, 22))
    return beard, rng.uniform(low, high)


def _sample_glasses(rng: np.random.Generator, old: float) -> str:
    if rng.random() > 0.10 + 0.15 * old:
        return "none"
    return GLASSES[1 + rng.choice(4, p=(0.28, 0.36, 0.21, 0.15))]


def _sample_hairline(rng: np.random.Generator, female: bool, old: float) -> Hairline:
    if female:
        return Hairline(rng.normal(0, 3), rng.uniform(0, 4), rng.uniform(0, 2))
    balding = float(rng.random() < 0.12 + 0.5 * old) * rng.uniform(0.3, 1)
    return Hairline(
        raised=rng.normal(2, 3) + 14 * balding,
        temples=rng.uniform(2, 10) + 22 * balding,
        peak=rng.uniform(0, 5),
        crown=float(np.clip(rng.normal(balding, 0.2), 0, 1)) if balding > 0.4 else 0.0,
    )
