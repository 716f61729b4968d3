from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from motion_transfer.drawing.engines import around
from motion_transfer.drawing.engines.around import continue_around, continue_patterns
from motion_transfer.drawing.engines.guesses import amend_guesses
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.textures import mirror_texture, pick_nearest
from nhrr_core import load_uv_tables

SIZE = 256
TABLES = load_uv_tables()
HEIGHT, FORWARD = TABLES.position[..., 1], TABLES.position[..., 2]
TRUNK = np.isin(TABLES.part, (1, 2, 7, 8, 9, 10))
FRONT = TRUNK & (FORWARD > 0.07)
STRIPES = np.sign(np.sin(HEIGHT * 2 * np.pi / 0.06)).astype(np.float32)


def source(texture: np.ndarray, shown: np.ndarray) -> Source:
    """What is read of one."""
    known = SimpleNamespace(texture=texture * shown, visibility=shown[None].astype(np.float32))
    return cast(Source, known)


def guess(level: float) -> FeatureMap:
    features = np.full((1, 16, SIZE, SIZE), level, np.float32)
    return FeatureMap(features, np.zeros((1, 3, 4 * SIZE, 4 * SIZE), np.float32))


def striped(contrast: float) -> np.ndarray:
    return np.broadcast_to(contrast * STRIPES, (3, SIZE, SIZE)).astype(np.float32)


def test_columns_are_mirrored_at_the_nearer_edge_to_and_fro() -> None:
    trusted = np.zeros((2, 10), bool)
    trusted[0, 2:6] = True
    found = around._mirror_at_edges(trusted)
    assert found.tolist() == [[3, 2, 2, 3, 4, 5, 5, 4, 3, 4], [-1] * 10]


def test_nothing_moves_up_or_down() -> None:
    """Each place is given the height of the one that it is copied from."""
    copied, gained = continue_around(HEIGHT[None], FRONT)
    assert gained.sum() > 0.5 * (TRUNK & ~FRONT & (HEIGHT < 0.1)).sum()
    away = np.abs(copied[0] - HEIGHT)[gained & (HEIGHT > -0.15) & (HEIGHT < 0.1)]
    assert away.mean() < 0.003
    assert away.max() < 0.03
    assert not (gained & (FRONT | ~TRUNK)).any()
    assert not copied[:, ~gained].any()


def test_narrow_gaps_are_bridged_from_above_and_below() -> None:
    narrow, wide = (np.abs(HEIGHT + 0.05) < half for half in (0.015, 0.08))
    copied, gained = continue_around(HEIGHT[None], TRUNK & ~narrow)
    assert (gained & narrow).sum() > 0.9 * (TRUNK & narrow).sum()
    away = np.abs(copied[0] - HEIGHT)[gained & narrow]
    assert 0.02 < away.max() < 0.08
    _, gained = continue_around(HEIGHT[None], TRUNK & ~wide)
    assert not gained[np.abs(HEIGHT + 0.05) < 0.03].any()


def test_a_texture_of_any_size_is_continued() -> None:
    height = pick_nearest(HEIGHT[None], 64)
    copied, gained = continue_around(height, pick_nearest(FRONT, 64))
    assert gained.any()
    assert np.abs(copied - height)[0, gained].mean() < 0.01


def test_stripes_go_on_around_the_body() -> None:
    before = guess(0)
    after = amend_guesses(before, source(striped(0.8), FRONT), [continue_patterns])
    change = after.features - before.features
    _, shown = mirror_texture(striped(1), FRONT[None].astype(np.float32))
    seen = shown[0] > 0
    assert not change[0, :, seen].any(), "what is seen, or its mirror image, stays"
    assert not change[0, 3:].any()
    assert not change[0, :, ~TRUNK].any()
    gained = change[0, 0] != 0
    assert gained.sum() > 2000
    assert np.mean(np.sign(change[0, 0][gained]) == STRIPES[gained]) > 0.85
    assert np.abs(change[0, 0][gained]).mean() == pytest.approx(0.8, abs=0.25)
    assert after.detail is before.detail


@pytest.mark.parametrize(
    ("contrast", "level"), [(0.1, 0), (0.5, 0.95)], ids=["plain", "of another colour"]
)
def test_clothes_that_are_plain_or_of_another_colour_get_no_pattern(
    contrast: float, level: float
) -> None:
    before = guess(level)
    after = amend_guesses(before, source(striped(contrast), FRONT), [continue_patterns])
    assert np.array_equal(after.features, before.features)


def test_who_shows_nothing_or_everything_stays() -> None:
    before = guess(0)
    for shown in (np.zeros((SIZE, SIZE), bool), np.ones((SIZE, SIZE), bool)):
        after = amend_guesses(before, source(striped(0.8), shown), [continue_patterns])
        assert np.array_equal(after.features, before.features)


def test_maps_that_do_not_begin_with_colours_stay() -> None:
    plain = FeatureMap(guess(0).features)
    assert amend_guesses(plain, source(striped(0.8), FRONT), [continue_patterns]) is plain
