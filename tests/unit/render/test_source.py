"""The source of a run: legs that it does not show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from studio import UPPER

from motion_transfer.drawing.kept_source import save_source
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.textures import pick_nearest
from motion_transfer.render.options import AdaptOptions, Garment, SourceOptions
from motion_transfer.render.source import LEG_PARTS, read_source, read_sources
from nhrr_core import load_uv_tables
from nhrr_core.parts import ALL_PARTS

SIZE = 128
CLOTHED = (*LEG_PARTS, 5, 6)
RED = {ALL_PARTS: (200, 30, 30)}


def texels(*parts: int) -> np.ndarray:
    return pick_nearest(np.isin(load_uv_tables().part, parts), SIZE)


def colour_of(source: Source, *parts: int) -> np.ndarray:
    """The mean of what is seen there, RGB in [-1, 1]."""
    seen = texels(*parts) & (source.visibility[0] > 0)
    return source.texture[:, seen].mean(1)


@pytest.fixture
def half_length(studio):
    return studio.source("half", parts=UPPER, colours=RED)


def test_legs_that_no_photo_shows_wear_jeans_front_and_back(half_length) -> None:
    source = read_source(SourceOptions(source=(half_length,)), SIZE)
    for face in ((7, 8), (9, 10), (11, 12), (13, 14)):
        assert source.visibility[0][texels(*face)].mean() > 0.3
        red, green, blue = colour_of(source, *face)
        assert blue > green > red
    assert source.visibility[0][texels(5, 6)].mean() > 0.2  # shoes
    assert source.clearance is not None and source.clearance[1].any()


def test_the_rest_of_the_person_stays_as_it_is(half_length) -> None:
    source, bare = (
        read_source(SourceOptions(source=(half_length,), unseen_legs=legs), SIZE)
        for legs in ("jeans", "guess")
    )
    others = ~texels(*CLOTHED)
    changed = (source.texture != bare.texture).any(0) | (source.visibility != bare.visibility)[0]
    assert changed[others].mean() < 0.001  # a texel at a part's border may be of either
    assert bare.visibility[0][texels(*LEG_PARTS)].mean() < 0.01
    np.testing.assert_array_equal(source.iuv, bare.iuv)


def test_it_is_said_how_to_have_others(half_length) -> None:
    (note,) = read_source(SourceOptions(source=(half_length,)), SIZE).notes
    assert "half.png shows no legs" in note and "--garment" in note and "--unseen-legs" in note
    assert not read_source(SourceOptions(source=(half_length,), unseen_legs="guess"), SIZE).notes


def test_a_bit_of_the_thighs_is_enough_to_be_left_as_it_is(studio) -> None:
    photo = studio.source("short", parts=(*UPPER, 9), colours=RED)
    source = read_source(SourceOptions(source=(photo,)), SIZE)
    assert not source.notes
    assert source.visibility[0][texels(11, 12, 13, 14)].mean() < 0.02


def test_legs_of_a_garment_or_of_another_photo_are_worn(studio, half_length) -> None:
    trousers = studio.source("trousers", parts=(*UPPER, 9, 10, 13, 14), colours=RED)
    garment = Garment(photo=trousers, parts=LEG_PARTS)
    for options in (
        SourceOptions(source=(half_length,), garments=(garment,)),
        SourceOptions(source=(half_length, trousers)),
    ):
        source = read_source(options, SIZE)
        assert not source.notes
        red, _, blue = colour_of(source, 9, 10)
        assert red > blue


def test_all_sizes_of_a_texture_wear_the_same(half_length) -> None:
    sources = read_sources(SourceOptions(source=(half_length,)), [SIZE, 64])
    assert [source.texture.shape[-1] for source in sources] == [SIZE, 64]
    assert all(len(source.notes) == 1 for source in sources)


def test_a_person_that_was_kept_in_jeans_keeps_them(half_length, tmp_path) -> None:
    dressed = read_sources(SourceOptions(source=(half_length,)), [SIZE])
    kept = tmp_path / "me.mtsource"
    save_source(kept, dressed, {}, {})
    again = read_source(SourceOptions(source=(kept,)), SIZE)
    np.testing.assert_allclose(again.texture, dressed[0].texture, atol=1 / 255)
    assert again.notes == dressed[0].notes
    assert again.kept == kept  # its feature maps are of the person in jeans


def test_weights_learn_the_person_and_no_jeans() -> None:
    assert AdaptOptions(source=(Path("me.png"),)).unseen_legs == "guess"
