"""The neck's base: a gap between what is seen of neck and trunk is closed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from motion_transfer.drawing.engines.guesses import amend_guesses
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.neck import close_neck
from motion_transfer.drawing.source import Source
from nhrr_core import PART_GROUPS, load_uv_tables

SIZE = 256
TABLES = load_uv_tables()
ACROSS, HEIGHT, FORWARD = TABLES.position.transpose(2, 0, 1)
FRONT = np.isin(TABLES.part, PART_GROUPS["torso"] + PART_GROUPS["head"]) & (FORWARD > 0.0)
SKIN, GREY = 0.5, -0.3


def amended(shown: np.ndarray) -> np.ndarray:
    """Grey guesses, and skin where it is seen."""
    finer = np.kron(shown[None], np.ones((1, 4, 4))).astype(np.float32)
    texture = np.repeat(finer * np.float32(SKIN), 3, axis=0)
    source = cast(Source, SimpleNamespace(texture=texture, visibility=finer))
    features = np.full((1, 16, SIZE, SIZE), GREY, np.float32)
    guess = FeatureMap(features, np.zeros_like(texture)[None])
    return amend_guesses(guess, source, [close_neck]).features[0]


def test_a_narrow_gap_is_closed_and_nothing_else() -> None:
    gap = FRONT & (np.abs(HEIGHT - 0.27) < 0.008)
    after = amended(FRONT & ~gap)
    middle = gap & (np.abs(ACROSS) < 0.03) & (FORWARD > 0.03)
    assert middle.sum() > 20
    assert np.abs(after[:3, middle] - SKIN).max() < 0.1
    assert (after[3:] == np.float32(GREY)).all(), "no colours"
    away = (HEIGHT < 0.22) | (HEIGHT > 0.32)
    assert (after[:, away] == np.float32(GREY)).all()
    behind = FORWARD < -0.04  # nothing is seen on its other side
    assert (after[:, behind] == np.float32(GREY)).all()


def test_what_is_wide_is_no_gap() -> None:
    after = amended(FRONT & (np.abs(HEIGHT - 0.28) > 0.035))
    middle = FRONT & (np.abs(HEIGHT - 0.28) < 0.004) & (np.abs(ACROSS) < 0.03)
    assert (after[:, middle] == np.float32(GREY)).all()


def test_without_anything_seen_there_guesses_stay() -> None:
    assert (amended(np.zeros_like(FRONT)) == np.float32(GREY)).all()
