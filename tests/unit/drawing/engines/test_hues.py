"""Hidden sides get the hue of what is seen around them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from motion_transfer.drawing.engines.guesses import amend_guesses
from motion_transfer.drawing.engines.hues import LIGHT, find_pieces, keep_hues, to_levels
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.textures import differ_in_any_light
from nhrr_core import PART_GROUPS, load_uv_tables

SIZE = 256
TABLES = load_uv_tables()
FRONTS = np.isin(TABLES.part, (15, 16, 19, 20, 9, 10, 13, 14))  # of sleeves, one face of each limb
ARMS = np.isin(TABLES.part, PART_GROUPS["upper-arms"] + PART_GROUPS["lower-arms"])
LEGS = np.isin(TABLES.part, PART_GROUPS["upper-legs"] + PART_GROUPS["lower-legs"])
ALONG = np.abs(TABLES.position[..., 0])
ELBOW = 0.42  # metres along x
RED, SKIN, BLUE, BROWN = (0.6, -0.7, -0.7), (0.6, 0.2, 0.0), (-0.7, -0.6, 0.1), (0.1, -0.3, -0.5)
Colour = tuple[float, float, float]


def paint(*layers: tuple[np.ndarray, Colour]) -> np.ndarray:
    """Colour a texture; later layers lie over earlier ones."""
    texture = np.zeros((3, SIZE, SIZE), np.float32)
    for where, colour in layers:
        texture[:, where] = np.array(colour, np.float32)[:, None]
    return texture


WORN = paint((ARMS, SKIN), (ARMS & (ALONG < ELBOW), RED), (LEGS, BLUE))
"""Red short sleeves and blue trousers."""


def source(worn: np.ndarray, shown: np.ndarray) -> Source:
    """Somebody of whom that much is seen, at four times the map's size."""
    finer = [np.kron(each, np.ones((1, 4, 4), np.float32)) for each in (worn * shown, shown[None])]
    texture, visibility = (each.astype(np.float32) for each in finer)
    return cast(Source, SimpleNamespace(texture=texture, visibility=visibility))


def amended(guessed: np.ndarray, worn: np.ndarray, shown: np.ndarray) -> np.ndarray:
    features = np.zeros((1, 16, SIZE, SIZE), np.float32)
    features[0, :3] = guessed
    guess = FeatureMap(features, np.zeros((1, 3, 4 * SIZE, 4 * SIZE), np.float32))
    after = amend_guesses(guess, source(worn, shown), [keep_hues]).features[0]
    assert not after[3:].any(), "what are no colours stays"
    assert (after[:3, shown] == guessed[:, shown]).all(), "and so does what is seen"
    return after[:3]


def test_a_smeared_back_of_an_arm_becomes_sleeve_and_skin() -> None:
    after = amended(paint((ARMS, BROWN), (LEGS, BLUE)), WORN, FRONTS)
    for colour, place in ((RED, ALONG < ELBOW - 0.03), (SKIN, ALONG > ELBOW + 0.03)):
        hidden = to_levels(after[:, ARMS & ~FRONTS & place])
        hue = to_levels(np.array(colour, np.float32)[:, None])
        light = hidden.sum(0) / hue.sum()
        assert np.abs(hidden - hue * light).max() < 0.02
        assert light.min() > LIGHT[0] - 0.02
        assert light.max() < LIGHT[1] + 0.02


def test_the_guess_keeps_its_light() -> None:
    shade = np.float32(0.8)
    shaded = (to_levels(WORN) * shade * 2 - 1) * ARMS
    tinted = shaded + np.array([0.0, 0.25, 0.25], np.float32)[:, None, None] * ARMS
    hidden = ARMS & ~FRONTS & (ALONG < ELBOW - 0.04)
    assert (amended(shaded, WORN, FRONTS)[:, hidden] == shaded[:, hidden]).all()
    after = to_levels(amended(tinted, WORN, FRONTS)[:, hidden]) / to_levels(WORN[:, hidden])
    assert np.abs(after - shade).max() < 0.12
    assert np.ptp(after, axis=0).max() < 0.02, "the tint is gone"


FLOWERS = np.kron(np.random.default_rng(0).random((SIZE // 2, SIZE // 2)) < 0.5, np.ones((2, 2)))
PRINT = paint((ARMS, RED), (ARMS & (FLOWERS > 0), BLUE))


@pytest.mark.parametrize(
    ("worn", "shown"),
    [(PRINT, FRONTS), (WORN, FRONTS & LEGS), (WORN, FRONTS & ARMS & (ALONG < ELBOW - 0.1))],
    ids=["of several colours", "out of sight", "another piece of it is seen"],
)
def test_the_guess_stays(worn: np.ndarray, shown: np.ndarray) -> None:
    guess = paint((ARMS, BROWN))
    after = amended(guess, worn, shown)
    lower = np.isin(TABLES.part, PART_GROUPS["lower-arms"])
    changed = (after[:, lower] != guess[:, lower]).any(0)
    assert changed.mean() < 0.002, "but for a texel whose surroundings are of one colour by chance"


def test_a_trunk_has_the_hue_of_what_is_seen_near_alone() -> None:
    """A hand lies before a shirt: there it is a shirt, and its back is what it was."""
    trunk = np.isin(TABLES.part, PART_GROUPS["torso"])
    x, y, z = np.moveaxis(TABLES.position, -1, 0)
    front = trunk & (z > 0.05)
    hand = front & (np.abs(x - 0.05) < 0.03) & (np.abs(y - np.median(y[front])) < 0.03)
    back = trunk & (z < -0.06)
    assert min(hand.sum(), back.sum()) > 100
    guess, worn = paint((trunk, BROWN)), paint((trunk, RED))
    after = amended(guess, worn, front & ~hand)
    assert (
        differ_in_any_light(to_levels(after[:, hand]), to_levels(worn[:, hand]), LIGHT).max() < 0.02
    )
    np.testing.assert_array_equal(after[:, back], guess[:, back])


def test_the_pieces_are_limbs_and_trunk_without_a_texel_in_two() -> None:
    pieces = find_pieces(64)
    assert len(pieces) == 5
    texels = np.concatenate([piece.texels for piece in pieces])
    assert len(np.unique(texels)) == len(texels)
    for piece, metres in zip(pieces, (0.5, 0.5, 0.79, 0.79, 0.65), strict=True):
        assert np.ptp(piece.places[:, piece.axis]) / 4 == pytest.approx(metres, abs=0.04)
