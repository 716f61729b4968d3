"""Hidden sides of arms and legs: they are amended where a guess is far from what is seen around."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from motion_transfer.drawing.engines.guesses import amend_guesses
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.limbs import find_limbs, go_around_limbs
from motion_transfer.drawing.source import Source
from nhrr_core import PART_GROUPS, load_uv_tables

SIZE = 256
TABLES = load_uv_tables()
FRONTS = np.isin(TABLES.part, (15, 16, 19, 20, 9, 10, 13, 14))  # of sleeves, one face of each limb
ARMS = np.isin(TABLES.part, PART_GROUPS["upper-arms"] + PART_GROUPS["lower-arms"])
LEGS = np.isin(TABLES.part, PART_GROUPS["upper-legs"] + PART_GROUPS["lower-legs"])
SLEEVE, SKIN, SMEAR, TROUSERS = 0.8, 0.2, -0.6, -0.7
ELBOW = 0.42  # metres along x


def source(shown: np.ndarray) -> Source:
    """Somebody with short sleeves, of whom that much is seen, at four times the map's size."""
    sleeve = ARMS & (np.abs(TABLES.position[..., 0]) < ELBOW)
    worn = np.where(sleeve, SLEEVE, np.where(LEGS, TROUSERS, SKIN))
    texture = np.broadcast_to(worn * shown, (3, SIZE, SIZE)).astype(np.float32)
    finer = [np.kron(each, np.ones((1, 4, 4), np.float32)) for each in (texture, shown[None] * 1.0)]
    return cast(Source, SimpleNamespace(texture=finer[0], visibility=finer[1].astype(np.float32)))


def amended(level: float, shown: np.ndarray) -> np.ndarray:
    features = np.full((1, 16, SIZE, SIZE), level, np.float32)
    guess = FeatureMap(features, np.zeros((1, 3, 4 * SIZE, 4 * SIZE), np.float32))
    return amend_guesses(guess, source(shown), [go_around_limbs]).features[0]


def test_a_smeared_back_of_an_arm_becomes_sleeve_and_skin() -> None:
    after = amended(SMEAR, FRONTS)
    along = np.abs(TABLES.position[..., 0])
    for colour, place in ((SLEEVE, along < ELBOW - 0.04), (SKIN, along > ELBOW + 0.04)):
        hidden = ARMS & ~FRONTS & place
        assert np.abs(after[:3, hidden] - colour).max() < 0.05
    assert (after[:, FRONTS] == np.float32(SMEAR)).all(), "what is seen is never amended"
    assert (after[3:] == np.float32(SMEAR)).all(), "nor what are no colours"
    legs = LEGS & ~FRONTS  # trousers, whose guess is not far off
    assert (after[:, legs] == np.float32(SMEAR)).all()


@pytest.mark.parametrize(
    ("guess", "shown"),
    [(SLEEVE - 0.1, FRONTS & ARMS & (np.abs(TABLES.position[..., 0]) < ELBOW)), (SMEAR, ~ARMS)],
    ids=["a guess that is near", "arms out of sight"],
)
def test_the_guess_stays(guess: float, shown: np.ndarray) -> None:
    after = amended(guess, shown)
    along = np.abs(TABLES.position[..., 0])
    # shoulders have neighbours that are seen
    upper = (
        np.isin(TABLES.part, PART_GROUPS["upper-arms"]) & (along > 0.24) & (along < ELBOW - 0.08)
    )
    assert (after[:, upper] == np.float32(guess)).all()


def test_limbs_are_four_tubes_of_their_own() -> None:
    limbs = find_limbs(64)
    assert len(limbs) == 4
    texels = np.concatenate([limb.texels for limb in limbs])
    assert len(np.unique(texels)) == len(texels)
    for limb, metres in zip(limbs, (0.67, 0.67, 0.79, 0.79), strict=True):
        assert limb.steps.min() == 0
        assert limb.steps.max() / 100 == pytest.approx(metres, abs=0.04)
