"""Hair that hangs before arms is left out where the arms are bare, and nothing else is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from motion_transfer.drawing.strands import trim_strands
from motion_transfer.drawing.unfolding import texel_index, texture_coordinates
from nhrr_core import PART_GROUPS, load_uv_tables

SKIN, HAIR, CLOTH, TATTOO = (214, 170, 145), (120, 76, 40), (90, 100, 160), (60, 110, 90)


class Body(NamedTuple):
    """A picture of a person, and where their parts are in it."""

    rgb: np.ndarray
    iuv: np.ndarray
    arms: np.ndarray
    before: np.ndarray


@pytest.fixture
def body(studio) -> Body:
    """Somebody in a top without sleeves, with brown hair; half of one arm may lie behind it."""
    iuv = studio.iuv(scale=6, size=(576, 384))
    own = {name: np.isin(iuv[..., 0], parts) for name, parts in PART_GROUPS.items()}
    positions = load_uv_tables().position
    place = positions.reshape(-1, 3)[texel_index(texture_coordinates(iuv), len(positions))]
    rgb = np.full((*iuv.shape[:2], 3), 240, np.uint8)
    rgb[iuv[..., 0] > 0] = CLOTH
    for name in ("head", "upper-arms", "lower-arms", "hands"):
        rgb[own[name]] = SKIN
    rgb[own["head"] & (place[..., 1] > 0.49)] = HAIR
    before = own["upper-arms"] & (place[..., 0] < 0)
    before &= np.arange(iuv.shape[1]) > np.median(np.nonzero(before)[1])
    return Body(rgb, iuv, own["upper-arms"], before)


def left_out(body: Body) -> np.ndarray:
    return (trim_strands(body.rgb, body.iuv)[..., 0] == 0) & (body.iuv[..., 0] > 0)


@pytest.mark.parametrize("light", [0.6, 1.0, 1.6])
def test_hair_before_a_bare_arm_is_left_out(body: Body, light: float) -> None:
    """Also where it is darker or brighter than on the head."""
    body.rgb[body.before] = np.clip(np.multiply(HAIR, light), 0, 255)
    out = left_out(body)
    assert out[body.before].all()
    assert out.sum() < 1.2 * body.before.sum()
    assert not out[~body.arms].any()


def test_a_bare_arm_stays_whole(body: Body) -> None:
    assert not left_out(body).any()


def test_a_tattoo_stays(body: Body) -> None:
    body.rgb[body.before] = TATTOO
    assert not left_out(body).any()


def test_sleeves_in_the_colour_of_hair_stay(body: Body) -> None:
    """Short ones, below which arms are bare."""
    places = np.nonzero(body.arms)[0]
    rows = np.arange(len(body.iuv))[:, None]
    body.rgb[body.arms & (rows < np.percentile(places, 60))] = HAIR
    assert not left_out(body).any()


def test_hair_before_long_sleeves_stays(body: Body) -> None:
    body.rgb[body.arms | np.isin(body.iuv[..., 0], PART_GROUPS["lower-arms"])] = CLOTH
    body.rgb[body.before] = HAIR
    assert not left_out(body).any()


@pytest.mark.parametrize("name", ["head", "lower-arms", "upper-arms"])
def test_who_is_not_seen_whole_stays(body: Body, name: str) -> None:
    body.rgb[body.before] = HAIR
    body.iuv[np.isin(body.iuv[..., 0], PART_GROUPS[name])] = 0
    assert not left_out(body).any()
