"""The middle of the back, where the texture is cut: both halves meet in one colour."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from motion_transfer.drawing.engines.guesses import amend_guesses
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.seam import REACH_METRES, join_halves
from motion_transfer.drawing.source import Source
from nhrr_core import PART_GROUPS, load_uv_tables

SIZE = 256
TABLES = load_uv_tables()
ACROSS, FORWARD = TABLES.position[..., 0], TABLES.position[..., 2]
MIDDLE = np.isin(TABLES.part, PART_GROUPS["torso"] + PART_GROUPS["head"]) & (FORWARD < -0.03)
LEFT = np.arange(SIZE) >= 0.3 * SIZE * np.ones((SIZE, 1))  # in the layout, of torso and head
LIGHT, DARK = 0.6, -0.4


def amended(seen: np.ndarray) -> np.ndarray:
    """Guesses that are light on the left and dark on the right."""
    features = np.where(LEFT, LIGHT, DARK) * np.ones((1, 16, 1, 1))
    visibility = np.kron(seen[None], np.ones((1, 4, 4))).astype(np.float32)
    texture = np.zeros((3, 4 * SIZE, 4 * SIZE), np.float32)
    source = cast(Source, SimpleNamespace(texture=texture, visibility=visibility))
    guess = FeatureMap(features.astype(np.float32), texture[None])
    return amend_guesses(guess, source, [join_halves]).features[0]


def test_guesses_meet_half_way() -> None:
    after = amended(np.zeros((SIZE, SIZE), bool))
    seam = MIDDLE & (np.abs(ACROSS) < 0.004)
    assert seam.sum() > 50
    assert np.abs(after[:3, seam] - (LIGHT + DARK) / 2).max() < 0.06
    away = ~MIDDLE | (np.abs(ACROSS) > REACH_METRES)
    away &= (FORWARD > 0.02) | (np.abs(ACROSS) > REACH_METRES)
    assert (after[:, away] == np.where(LEFT, LIGHT, DARK)[away].astype(np.float32)).all()
    assert (after[3:] == np.where(LEFT, LIGHT, DARK).astype(np.float32)).all(), "no colours"


def test_a_guess_goes_all_the_way_to_what_is_seen() -> None:
    after = amended(LEFT)
    assert (after[:, LEFT] == np.float32(LIGHT)).all()
    seam = MIDDLE & ~LEFT & (np.abs(ACROSS) < 0.004)
    assert np.abs(after[:3, seam] - LIGHT).max() < 0.1
