"""Colours of HDR, as phones film it, brought to SDR: BT.2020 in PQ or HLG to BT.709.

What SDR can show stays what it is: diffuse white is 203 cd/m2 in HDR (ITU-R BT.2408), and 1 in SDR;
what is brighter, up to the 1000 cd/m2 of HDR's reference displays, is pressed together below 1.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from av.video.reformatter import ColorTrc
from jaxtyping import Float32, Float64, UInt8, UInt16

HDR: dict[int, str] = {ColorTrc.SMPTE2084: "PQ", ColorTrc.ARIB_STD_B67: "HLG"}
"""Transfer functions of HDR, by H.273's numbers."""

WHITE = 203.0
"""Diffuse white, cd/m2 (BT.2408)."""
PEAK = 1000.0
"""The brightest that is told apart, cd/m2; more is as bright."""
KNEE = 0.7
"""From where on brightness is pressed together, of diffuse white."""
GAMMA = 2.4
"""Of SDR's displays (BT.1886)."""

BT2020_TO_BT709 = np.array(
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
)
"""Of linear colours (BT.2087)."""
LUMINANCE = np.array([[0.2627, 0.6780, 0.0593]])
"""Of linear colours of BT.2020."""

LEVELS = 2**16
STEPS = 2**12
"""Of the root of light, by which SDR's levels are looked up: fine where eyes are."""
STRIP = 32
"""Rows that are converted at a time, so that what is in between stays in the processor's cache."""


def to_sdr(signal: UInt16[np.ndarray, "H W 3"], transfer: int) -> UInt8[np.ndarray, "H W 3"]:
    """Bring R'G'B' of BT.2020 to that of BT.709; colours beyond it lie on its border.

    Args:
        signal: In the full range of 16 bits.
        transfer: A key of `HDR`.
    """
    sdr = np.empty(signal.shape, np.uint8)
    for top in range(0, len(signal), STRIP):
        rows = slice(top, top + STRIP)
        _convert(signal[rows], transfer, sdr[rows])
    return sdr


def _convert(
    signal: UInt16[np.ndarray, "H W 3"], transfer: int, sdr: UInt8[np.ndarray, "H W 3"]
) -> None:
    light = _light_of_levels(transfer).take(signal, mode="clip")
    linear = np.maximum(cv2.transform(light, BT2020_TO_BT709), 0)
    red, green, blue = cv2.split(linear)
    brightest = cv2.max(cv2.max(red, green), blue)
    if HDR[transfer] == "PQ":
        factor = _press(brightest)
    else:  # whose displays show a colour the brighter the brighter it is
        display = cv2.pow(cv2.transform(light, LUMINANCE), 0.2)
        factor = _press(brightest * display) * display
    # one factor for all three channels keeps the hue
    linear *= cv2.merge([factor * STEPS**2] * 3)
    roots = np.sqrt(linear, out=linear).astype(np.uint16)
    _levels_of_roots().take(roots, out=sdr, mode="clip")


def _press(brightness: Float32[np.ndarray, "H W"]) -> Float32[np.ndarray, "H W"]:
    """Find the factor that presses what is above the knee together, so that the peak becomes 1."""
    most = PEAK / WHITE - KNEE
    excess = np.clip(brightness - KNEE, 0, most)
    # a hyperbola of slope 1 at the knee
    pressed = excess / (1 + (1 / (1 - KNEE) - 1 / most) * excess)
    return (np.minimum(brightness, KNEE) + pressed) / np.maximum(brightness, 1e-6)


@lru_cache
def _light_of_levels(transfer: int) -> Float32[np.ndarray, " levels"]:
    """Give the light of each level: a display's, or HLG's scene; diffuse white is 1."""
    signal = np.linspace(0, 1, LEVELS)
    light = _pq_light(signal) if HDR[transfer] == "PQ" else _hlg_light(signal)
    return light.astype(np.float32)


def _pq_light(signal: Float64[np.ndarray, " levels"]) -> Float64[np.ndarray, " levels"]:
    """PQ as in SMPTE ST 2084."""
    m1, m2, c1, c2, c3 = 0.1593017578125, 78.84375, 0.8359375, 18.8515625, 18.6875
    power = signal ** (1 / m2)
    nits = 10000 * (np.maximum(power - c1, 0) / (c2 - c3 * power)) ** (1 / m1)
    return np.minimum(nits, PEAK) / WHITE


def _hlg_light(signal: Float64[np.ndarray, " levels"]) -> Float64[np.ndarray, " levels"]:
    """HLG as in ITU-R BT.2100, but for the luminance ** 0.2 of a display of 1000 cd/m2."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    scene = np.where(signal <= 0.5, signal**2 / 3, (np.exp((signal - c) / a) + b) / 12)
    return scene * (PEAK / WHITE) ** (1 / 1.2)  # to this, luminance ** 0.2 adds the rest


@lru_cache
def _levels_of_roots() -> UInt8[np.ndarray, " steps"]:
    """Give the level of SDR of each step of the root of light."""
    roots = (np.arange(STEPS + 1) + 0.5) / STEPS
    return np.minimum(255 * roots ** (2 / GAMMA) + 0.5, 255).astype(np.uint8)
