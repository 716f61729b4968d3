"""Long hair covers the neck of whoever turns around, and is drawn beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from motion_transfer.drawing.engines.interface import Engine, FeatureMap
from motion_transfer.drawing.hair import (
    HIGHEST,
    JAW,
    LOWEST,
    colour_hair,
    find_hair,
    find_neck,
    lay_hair,
)
from motion_transfer.drawing.renderers.network import NeuralRenderer
from motion_transfer.drawing.source import Source
from motion_transfer.media.nearest import nearest_points
from motion_transfer.media.pictures.photo import Photo
from nhrr_core import load_uv_tables

SIZE = 256
TABLES = load_uv_tables()
POSITION = TABLES.position.reshape(-1, 3)
PIXEL = 0.004  # metres
SKIN, HAIR, COLLAR, BACKDROP = (200, 150, 120), (60, 40, 20), (40, 60, 200), (255, 255, 255)
NECK = find_neck()
NAPE = np.zeros((SIZE, SIZE), bool)
NAPE.reshape(-1)[NECK.texels[NECK.position[:, 2] < 0.0]] = True
HEIGHT = TABLES.position[..., 1]


def head_from_the_front() -> np.ndarray:
    """IUV of a head as wide as the layout's, at PIXEL, 26 px of backdrop around it."""
    part, v, u = np.meshgrid([23, 24], np.arange(256), np.arange(256), indexing="ij")
    x, y = (TABLES.charts[22:24] * SIZE).astype(int).clip(0, SIZE - 1).transpose(3, 0, 1, 2)
    entries = POSITION[(y * SIZE + x).reshape(-1)]
    facing = np.flatnonzero(entries[:, 2] > 0.0)
    rows, columns = np.arange(0.53, 0.27, -PIXEL), np.arange(-0.1, 0.1, PIXEL)
    wanted = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    flat = np.column_stack([wanted, np.zeros(len(wanted))]).astype(np.float32)
    front = entries[facing] * np.float32([1, 1, 0])
    away, nearest = nearest_points(front, flat, 1)
    chosen = facing[nearest[:, 0]]
    found = np.stack([each.reshape(-1)[chosen] for each in (part, u, v)], axis=1)
    found[away[:, 0] > PIXEL] = 0
    iuv = found.reshape(len(rows), len(columns), 3).astype(np.uint8)
    return np.pad(iuv, ((26, 26), (26, 26), (0, 0)))


IUV = head_from_the_front()
BODY = IUV[..., 0] > 0
HEIGHTS = 0.53 - (np.arange(len(IUV)) - 26) * PIXEL


def portrait(lowest: float, colour: tuple[int, int, int] = HAIR, width: int = 12) -> Source:
    """Somebody whose hair hangs beside the head down to a height, metres."""
    beside = np.zeros_like(BODY)
    for row in np.flatnonzero((lowest < HEIGHTS) & (HEIGHTS < 0.5) & BODY.any(1)):
        columns = np.flatnonzero(BODY[row])
        beside[row, columns[0] - width : columns[-1] + width + 1] = True
    rgb = np.full((*BODY.shape, 3), BACKDROP, np.uint8)
    rgb[beside] = colour
    rgb[BODY] = SKIN
    alpha = ((beside | BODY) * 255).astype(np.uint8)
    photo = Photo(Path("me.png"), rgb, alpha, turned=False)
    seen = np.zeros((1, SIZE, SIZE), np.float32)
    seen.reshape(-1)[NECK.texels[NECK.position[:, 2] > 0.02]] = 1
    skin = (np.array(SKIN) / 127.5 - 1)[:, None, None]
    return Source(photo, IUV, None, (skin * seen).astype(np.float32), seen)


@pytest.mark.parametrize("colour", [HAIR, (0, 0, 0)], ids=["brown", "black"])
def test_hair_down_to_the_shoulders_covers_the_neck_behind(colour: tuple[int, int, int]) -> None:
    source = portrait(0.26, colour)
    worn = lay_hair(source)
    behind = NAPE & (HEIGHT > LOWEST + 0.02) & (HEIGHT < HIGHEST - 0.01)
    assert worn.visibility[0, behind].mean() > 0.98
    hair = (np.array(colour) / 127.5 - 1)[:, None]
    assert np.abs(worn.texture[:, behind & (worn.visibility[0] > 0)] - hair).max() < 0.02
    face = np.zeros((SIZE, SIZE), bool)
    face.reshape(-1)[NECK.texels[(NECK.position[:, 2] > 0.02) & (NECK.position[:, 1] > JAW)]] = True
    assert (worn.texture[:, face] == source.texture[:, face]).all(), "the face stays"
    assert source.visibility[0, NAPE].sum() == 0, "the source that was given is as it was"


def test_it_reaches_as_far_down_as_the_photo_shows() -> None:
    worn = lay_hair(portrait(0.33))
    assert worn.visibility[0, NAPE & (HEIGHT > 0.35) & (HEIGHT < HIGHEST - 0.01)].mean() > 0.98
    assert not worn.visibility[0, NAPE & (HEIGHT < 0.31)].any()


def with_collar() -> Source:
    """Hair to the jaw alone, and a collar that stands off the neck."""
    source = portrait(0.38)
    low = (HEIGHTS < 0.36)[:, None] & ~BODY
    rgb, alpha = source.photo.rgb.copy(), np.where(low, 255, source.photo.alpha)
    rgb[low] = COLLAR
    return replace(source, photo=replace(source.photo, rgb=rgb, alpha=alpha.astype(np.uint8)))


def unknown() -> Source:
    source = portrait(0.26)
    return replace(source, photo=replace(source.photo, alpha=None))


@pytest.mark.parametrize(
    "source",
    [portrait(0.45), portrait(0.26, width=2), with_collar(), unknown()],
    ids=["short hair", "close to the skin", "a collar", "nobody knows where the person ends"],
)
def test_others_pass_as_they_are(source: Source) -> None:
    assert lay_hair(source) is source


def drawn(cover: np.ndarray) -> np.ndarray:
    """What a network draws of IUV: grey off the body, as nothing tells it of hair."""
    rgb = np.where(BODY[..., None], SKIN, (150, 140, 140))
    return np.dstack([rgb, cover]).astype(np.uint8)


def test_what_is_drawn_beside_a_neck_is_hair_as_far_down_as_it_hangs() -> None:
    source = portrait(0.33)
    hair = find_hair(source)
    assert hair is not None
    cover = source.photo.alpha
    assert cover is not None
    picture = drawn(cover)
    before = picture.copy()
    colour_hair(picture, IUV, hair)
    beside = (cover > 0) & ~BODY
    hangs = (HEIGHTS > 0.35) & (HEIGHTS < HIGHEST - 0.04)  # softly above and below
    assert np.abs(picture[beside & hangs[:, None], :3].astype(int) - HAIR).max() <= 6
    above = (HEIGHTS > HIGHEST + 0.03)[:, None]
    for stays in (BODY, ~beside, np.broadcast_to(above, BODY.shape)):
        np.testing.assert_array_equal(picture[stays], before[stays])
    np.testing.assert_array_equal(picture[..., 3], cover)


def test_a_picture_without_a_head_stays() -> None:
    hair = find_hair(portrait(0.26))
    assert hair is not None
    trunk = np.where(IUV[..., :1] > 0, np.uint8([2, 99, 99]), np.uint8(0))
    picture = drawn(np.full(BODY.shape, 255))
    before = picture.copy()
    colour_hair(picture, trunk, hair)
    np.testing.assert_array_equal(picture, before)


def test_a_network_that_is_told_of_hair_draws_it() -> None:
    """Also where it lends a picture that nobody may write to."""
    hair = find_hair(portrait(0.26))
    assert hair is not None
    lent = drawn(np.full(BODY.shape, 255))[None]
    lent.setflags(write=False)
    engine = SimpleNamespace(
        take=lambda known: known,
        draw=lambda _known, _iuv: lent,
        config=SimpleNamespace(feature_outputs=16),
        occupies="core",
    )
    features = np.zeros((1, 16, 4, 4), np.float32)
    bald, haired = (
        NeuralRenderer(cast(Engine, engine), FeatureMap(features, hair=told)).render(IUV[None])[0]
        for told in (None, hair)
    )
    np.testing.assert_array_equal(bald, lent[0])
    expected = lent[0].copy()
    colour_hair(expected, IUV, hair)
    np.testing.assert_array_equal(haired, expected)
    assert (haired != bald).any()
