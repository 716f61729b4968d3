"""The light of a scene on a person who was not there: a shadow underfoot, brightness and tint."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

SHADOW_PX = 128  # the side at which a shadow is made: it is soft

# Of the light: from the front, from above and a little from the left, as in most photos.
SHADOW_LENGTH = 0.14  # of a height above the ground: how much of it lies on the ground
SHADOW_SLANT = 0.22  # likewise: how far it lies to the right
SHADOW_DARKNESS, CONTACT_DARKNESS = 0.35, 0.55  # where it is deepest: under the body, at the feet
SHADOW_SOFTNESS, CONTACT_SOFTNESS = 0.02, 0.008  # deviation of the blur, in shares of the window
CONTACT_HEIGHT = 0.1  # of the person: what is so near the ground touches it, or nearly
CONTACT_FLATNESS = 0.4
LIFT_FADES = 0.25  # of the person's height: feet so far above the ground leave a third of a shadow

MATCHED = 0.5  # of the way to the background's light; all of it would make night of every shade
CONTRAST_RANGE = (0.7, 1.4)

Rgba = UInt8[np.ndarray, "S S 4"]


def cast_shadow(
    coverage: UInt8[np.ndarray, "S S"], ground: float
) -> UInt8[np.ndarray, "s t"] | None:
    """Make the shadow that a person casts on the ground.

    Args:
        coverage: Of the person, in a square window.
        ground: The row on which the person stands, in shares of the window.
    Returns: Coverage of black; it is as high as the window, twice as wide, and half a window
        farther left; in pixels of its own size. None if nobody is there.
    """
    side = min(len(coverage), SHADOW_PX)
    person = cv2.resize(coverage, (side, side), interpolation=cv2.INTER_AREA)
    _, top, _, height = cv2.boundingRect(person)
    if not height:
        return None
    ground = min(ground * side, side - 1)
    cast = _lay_down(person, ground, SHADOW_LENGTH, SHADOW_SLANT)
    feet = person.copy()
    feet[: round(max(0, ground - height * CONTACT_HEIGHT))] = 0
    contact = _lay_down(feet, ground, CONTACT_FLATNESS, 0)
    cast = cv2.GaussianBlur(cast, (0, 0), side * SHADOW_SOFTNESS) * SHADOW_DARKNESS
    contact = cv2.GaussianBlur(contact, (0, 0), side * CONTACT_SOFTNESS) * CONTACT_DARKNESS
    lift = max(0.0, ground - (top + height)) / height
    return (np.maximum(cast, contact) * np.exp(-lift / LIFT_FADES)).round().astype(np.uint8)


def _lay_down(
    person: UInt8[np.ndarray, "S S"], ground: float, length: float, slant: float
) -> Float32[np.ndarray, "S T"]:
    side = len(person)
    onto = np.array(
        [[1, -slant, slant * ground + side / 2], [0, length, ground * (1 - length)]], np.float64
    )
    lain = cv2.warpAffine(person, onto, (2 * side, side), flags=cv2.INTER_AREA)
    return lain.astype(np.float32)


@dataclass(frozen=True)
class Light:
    """How light something is, and of what tint.

    Attributes:
        mean, deviation: Of L, a and b, as OpenCV counts them in 8 bits.
    """

    mean: tuple[float, float, float]
    deviation: tuple[float, float, float]


def measure_light(
    picture: UInt8[np.ndarray, "H W 3"], where: UInt8[np.ndarray, "H W"] | None = None
) -> Light:
    """Measure a picture's light, or that of the pixels where `where` is not 0."""
    mean, deviation = cv2.meanStdDev(cv2.cvtColor(picture, cv2.COLOR_RGB2Lab), mask=where)
    return Light(tuple(mean.ravel().tolist()), tuple(deviation.ravel().tolist()))  # type: ignore[arg-type]


def match_light(own: Light, around: Light) -> UInt8[np.ndarray, "1 256 3"]:
    """Make the table that brings somebody's light half-way to that of what is around.

    Mean and contrast of L, and the means of a and b: after Reinhard et al., "Color Transfer between
    Images" (2001), held back, as a person is no average of the scene.
    Returns: For each level of L, a and b the new one, for `cv2.LUT`.
    """
    wanted = around.deviation[0] / max(own.deviation[0], 1e-6)
    contrast = float(np.clip(wanted, *CONTRAST_RANGE)) ** MATCHED
    levels = np.arange(256, dtype=np.float64)[:, None]
    mean, target = np.array(own.mean), np.array(around.mean)
    gain = np.array([contrast, 1, 1])
    matched = (levels - mean) * gain + mean + (target - mean) * MATCHED
    return matched.round().clip(0, 255).astype(np.uint8)[None]


def relight(rgba: Rgba, table: UInt8[np.ndarray, "1 256 3"]) -> Rgba:
    """Change the colours of a person as `match_light` says; coverage stays."""
    x, y, width, height = cv2.boundingRect(cv2.extractChannel(rgba, 3))
    if not width:
        return rgba
    lit = rgba.copy()
    body = lit[y : y + height, x : x + width]
    lab = cv2.cvtColor(np.ascontiguousarray(body[..., :3]), cv2.COLOR_RGB2Lab)
    body[..., :3] = cv2.cvtColor(cv2.LUT(lab, table), cv2.COLOR_Lab2RGB)
    return lit
