"""Long hair covers the neck of whoever turns around."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.drawing.hair import HIGHEST, JAW, LOWEST, find_neck, lay_hair
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
