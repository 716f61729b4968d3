"""The crotch takes the colours of what is seen around it, where it is hidden and guessed apart."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from motion_transfer.drawing.engines.crotch import FADE_METRES, TOP_METRES, clothe_crotch
from motion_transfer.drawing.engines.guesses import amend_guesses
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.source import Source
from nhrr_core import load_uv_tables

SIZE = 256
TABLES = load_uv_tables()
HEIGHT = TABLES.position[..., 1]
TRUNK = np.isin(TABLES.part, (1, 2))
CROTCH = TRUNK & (HEIGHT < TOP_METRES)
THIGHS = np.isin(TABLES.part, (7, 8, 9, 10)) & (HEIGHT > -0.35)
TROUSERS, SKIN, SHIRT = 0.9, 0.1, -0.7


def source(shown: np.ndarray) -> Source:
    """Somebody in a shirt and trousers, of whom that much is seen, at four times the map's size."""
    worn = np.where(TRUNK & ~CROTCH, SHIRT, TROUSERS)
    texture = np.broadcast_to(worn * shown, (3, SIZE, SIZE)).astype(np.float32)
    finer = [np.kron(each, np.ones((1, 4, 4), np.float32)) for each in (texture, shown[None] * 1.0)]
    return cast(Source, SimpleNamespace(texture=finer[0], visibility=finer[1].astype(np.float32)))


def guess(level: float) -> FeatureMap:
    features = np.full((1, 16, SIZE, SIZE), level, np.float32)
    return FeatureMap(features, np.zeros((1, 3, 4 * SIZE, 4 * SIZE), np.float32))


def test_skin_between_trousers_becomes_trousers_and_nothing_else_changes() -> None:
    before = guess(SKIN)
    after = amend_guesses(before, source(THIGHS), [clothe_crotch]).features[0]
    deep = CROTCH & (HEIGHT < TOP_METRES - FADE_METRES)
    assert np.abs(after[:3, deep] - TROUSERS).max() < 0.01
    assert (after[3:] == before.features[0, 3:]).all()
    assert (after[:, ~CROTCH] == SKIN).all()
    fading = CROTCH & ~deep
    assert ((after[0, fading] >= SKIN) & (after[0, fading] <= TROUSERS + 0.01)).all()


def test_what_is_seen_or_guessed_alike_stays() -> None:
    assert (
        amend_guesses(guess(SKIN), source(THIGHS | CROTCH), [clothe_crotch]).features
        == np.float32(SKIN)
    ).all()
    alike = amend_guesses(guess(TROUSERS - 0.05), source(THIGHS), [clothe_crotch]).features
    assert (alike == np.float32(TROUSERS - 0.05)).all()


@pytest.mark.parametrize(
    "shown",
    [np.zeros_like(CROTCH), np.isin(TABLES.part, (23, 24)), TRUNK & (HEIGHT > 0)],
    ids=["nothing", "head", "chest"],
)
def test_a_photo_of_nothing_near_changes_nothing(shown: np.ndarray) -> None:
    assert (
        amend_guesses(guess(SKIN), source(shown), [clothe_crotch]).features == np.float32(SKIN)
    ).all()


def test_features_that_begin_with_no_colours_stay() -> None:
    plain = FeatureMap(guess(SKIN).features, None)
    assert amend_guesses(plain, source(THIGHS), [clothe_crotch]) is plain
