"""Lamps around a person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Lamp:
    """A distant light.

    Attributes:
        azimuth: radians; 0 shines from where a camera at azimuth 0 stands (-y), positive from
            the left hand (+x) of a person who faces that camera.
        elevation: above the horizon, radians.
        colour: linear RGB that a white surface facing it returns.
    """

    azimuth: float
    elevation: float
    colour: Colour

    @property
    def toward(self) -> Colour:
        """Unit vector toward the lamp."""
        level = np.cos(self.elevation)
        return (
            float(np.sin(self.azimuth) * level),
            float(-np.cos(self.azimuth) * level),
            float(np.sin(self.elevation)),
        )


@dataclass(frozen=True)
class Light:
    """All light that reaches a person.

    Attributes:
        lamps: 1 to 3; the first is the key, and the only one that casts a shadow.
        sky, ground: ambient light from above and from below.
        softness_metres: how far the edge of the key's shadow is smeared.
        occlusion: how dark folds and gaps become, 0..1.
    """

    lamps: tuple[Lamp, ...]
    sky: Colour
    ground: Colour
    softness_metres: float = 0.04
    occlusion: float = 0.8


def sample_light(rng: np.random.Generator) -> Light:
    """Studio light, window light, sun or an overcast sky, with a white balance near neutral."""
    kind = rng.choice(["studio", "window", "sun", "overcast"], p=[0.5, 0.2, 0.15, 0.15])
    warmth = rng.normal(0, 0.035)
    key_share = {"studio": 0.5, "window": 0.65, "sun": 0.85, "overcast": 0.3}[kind]
    key_share += rng.uniform(-0.1, 0.1)
    total = rng.uniform(0.98, 1.22)
    side = rng.choice([-1.0, 1.0])
    azimuth = side * rng.uniform(0.15, 0.9 if kind == "studio" else 1.25)
    lamps = [Lamp(azimuth, rng.uniform(0.45, 1.05), _tinted(total * key_share, warmth))]
    if kind in ("studio", "window"):
        fill = total * rng.uniform(0.08, 0.3)
        lamps.append(Lamp(-side * rng.uniform(0.5, 1.2), rng.uniform(0, 0.6), _tinted(fill, 0)))
    if kind == "studio" and rng.random() < 0.4:
        rim = total * rng.uniform(0.15, 0.5)
        lamps.append(Lamp(side * rng.uniform(2.2, 2.9), rng.uniform(0.3, 0.8), _tinted(rim, 0)))
    ambient = total * (1.02 - key_share)
    ground = rng.uniform(0.45, 0.85)
    softness = {"studio": 0.07, "window": 0.05, "sun": 0.015, "overcast": 0.15}[kind]
    return Light(
        lamps=tuple(lamps),
        sky=_tinted(ambient, -0.5 * warmth),
        ground=_tinted(ambient * ground, warmth),
        softness_metres=softness * rng.uniform(0.7, 1.4),
        occlusion=rng.uniform(0.6, 0.95),
    )


def _tinted(amount: float, warmth: float) -> Colour:
    """An intensity as a colour; warmth > 0 is towards red."""
    return (amount * (1 + warmth), amount, amount * (1 - warmth))
