"""From linear light to a photo's bytes."""

from __future__ import annotations

import numpy as np
import warp as wp
from jaxtyping import Float32, UInt8

from motion_transfer.people.figure.rasterise import share_array
from motion_transfer.people.picture.shade import Shading
from motion_transfer.people.picture.shade_kernels import develop_pixels

TONE_RANGE = 2.0
KNEE = 0.8
"""Linear light above this is compressed: it comes close to white at TONE_RANGE."""


def develop(
    seen: Shading,
    behind: Float32[np.ndarray, "H W 3"],
    grain: float,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "H W 3"]:
    """The person in front of a background, as 8-bit sRGB.

    Args:
        behind: linear RGB.
        grain: sensor noise, standard deviation as a share of white.
    """
    height, width = behind.shape[:2]
    noise = np.zeros((1, 1), np.float32)
    if grain > 0:
        noise = rng.standard_normal((height, width), np.float32) * np.float32(255 * grain)
    rgb = np.empty((height, width, 3), np.uint8)
    inputs = [
        share_array(seen.rgba, wp.vec4),
        share_array(behind, wp.vec3),
        share_array(noise, wp.float32),
        share_array(_TONE, wp.float32),
        TONE_RANGE,
    ]
    outputs = [share_array(rgb, wp.uint8)]
    wp.launch(develop_pixels, (height, width), inputs=inputs, outputs=outputs, device="cpu")
    return rgb


def _tone_curve() -> Float32[np.ndarray, " N"]:
    """sRGB value (0..255) of linear light from 0 to TONE_RANGE."""
    light = np.linspace(0, TONE_RANGE, 8192)
    bent = np.where(light < KNEE, light, 1 - (1 - KNEE) * np.exp(-(light - KNEE) / (1 - KNEE)))
    encoded = np.where(bent <= 0.0031308, 12.92 * bent, 1.055 * bent ** (1 / 2.4) - 0.055)
    return (255 * encoded).astype(np.float32)


_TONE = _tone_curve()
