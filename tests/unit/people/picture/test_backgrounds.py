"""Painted backgrounds: of every kind, the same each time, linear light in range."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from motion_transfer.people.picture.backgrounds import (
    FLOOR_SHARES,
    KIND_SHARES,
    Background,
    paint_background,
    sample_background,
)
from motion_transfer.people.picture.backgrounds.view import Painting, View, cells, hsv

KINDS = list(KIND_SHARES)
HORIZON, PPM = 50.0, 45.0


def sampled(kind: str | None, seed: int = 0) -> Background:
    return sample_background(np.random.default_rng(seed), kind)


def painted(background: Background, height: int = 96, width: int = 80, **view) -> np.ndarray:
    place = {"horizon_row": HORIZON, "pixels_per_metre": PPM} | view
    return paint_background(background, height, width, **place)


@pytest.mark.parametrize("kind", KINDS)
def test_light_is_linear_rgb_of_the_size_asked_for(kind: str) -> None:
    for seed in range(6):
        light = painted(sampled(kind, seed))
        assert light.shape == (96, 80, 3) and light.dtype == np.float32
        assert np.isfinite(light).all() and light.min() >= 0 and light.max() <= 1
        assert light.max() > 0.01


@pytest.mark.parametrize("kind", KINDS)
def test_a_background_is_painted_the_same_each_time(kind: str) -> None:
    background = sampled(kind)
    first = painted(background)
    np.testing.assert_array_equal(first, painted(background))
    assert sampled(kind) == background
    other = painted(sampled(kind, seed=1))
    assert np.abs(other - first).mean() > 0.005


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("horizon_row", [-400.0, -3.0, 95.5, 700.0])
@pytest.mark.parametrize("size", [(33, 57), (2, 3), (64, 16)])
def test_any_camera_and_size_will_do(kind: str, horizon_row: float, size: tuple[int, int]) -> None:
    for pixels_per_metre in (3.0, 300.0):
        light = painted(
            sampled(kind), *size, horizon_row=horizon_row, pixels_per_metre=pixels_per_metre
        )
        assert light.shape == (*size, 3) and np.isfinite(light).all()


def test_nearly_half_are_of_catalogues() -> None:
    rng = np.random.default_rng(0)
    kinds = [sample_background(rng).kind for _ in range(1000)]
    assert set(kinds) == set(KINDS)
    assert 0.4 < np.isin(kinds, ["plain", "gradient", "studio"]).mean() < 0.5
    assert sum(KIND_SHARES.values()) == pytest.approx(1)


def test_floors_are_where_they_are_seen() -> None:
    for kind in KINDS:
        share = np.mean([sampled(kind, seed).has_floor for seed in range(60)])
        assert share == pytest.approx(FLOOR_SHARES.get(kind, 0), abs=0.2)
    assert not any(sampled("clutter", seed).has_floor for seed in range(30))


@pytest.mark.parametrize("kind", ["studio", "indoor"])
def test_wall_and_floor_meet_below_the_horizon(kind: str) -> None:
    white_on_black = replace(
        sampled(kind), colours=((250, 250, 250), (8, 8, 8), (250, 250, 250), (250, 250, 250)),
        blur=0.0, vignette=0.0, wall_share=0.5, camera_metres=1.2,
    )  # fmt: skip
    rows = [
        painted(replace(white_on_black, seed=seed)).mean((1, 2)) for seed in range(25)
    ]  # things may stand before the wall: the median tells
    brightness = np.median(rows, axis=0)
    meet = HORIZON + 1.2 * 0.5 * PPM  # 77
    assert brightness[: int(meet) - 12].min() > 4 * brightness[int(meet) + 12 :].max()


def test_exposure_and_vignette_act_on_linear_light() -> None:
    plain = replace(sampled("plain"), exposure=0.8, vignette=0.0, has_floor=False)
    light = painted(plain)
    np.testing.assert_allclose(painted(replace(plain, exposure=0.4)), light / 2, atol=1e-5)
    dark_corners = painted(replace(plain, vignette=0.4))
    np.testing.assert_allclose(dark_corners[0, 0] / light[0, 0], 0.6, atol=1e-3)
    np.testing.assert_allclose(dark_corners[48, 40] / light[48, 40], 1, atol=1e-2)


def test_colours_are_decoded_from_srgb() -> None:
    grey = ((188, 188, 188),) * 4
    plain = replace(sampled("plain"), colours=grey, exposure=1.0, vignette=0.0, has_floor=False)
    assert painted(plain).max() == pytest.approx(0.503, abs=0.01)


@pytest.mark.parametrize("kind", ["street", "nature", "clutter", "indoor"])
def test_blur_takes_detail_away(kind: str) -> None:
    def detail(blur: float) -> float:
        backgrounds = (replace(sampled(kind, seed), blur=blur) for seed in range(6))
        return float(np.mean([np.abs(np.diff(painted(b), axis=1)).mean() for b in backgrounds]))

    assert detail(0.02) < 0.6 * detail(0.0)


def test_all_that_is_known_of_a_background_fits_json() -> None:
    for kind in KINDS:
        assert json.loads(json.dumps(asdict(sampled(kind))))["kind"] == kind


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'moon'; there are plain"):
        sampled("moon")


def test_hues_are_named_as_usual() -> None:
    assert hsv(0, 1, 1) == (255, 0, 0) and hsv(1 + 1 / 3, 1, 1) == (0, 255, 0)
    assert hsv(0.7, 0, 2) == (255, 255, 255)


def test_bricks_are_offset_by_half_and_have_joints() -> None:
    u, v = (
        np.arange(0, 4, 0.1).astype(np.float32)[None] + 0.05,
        np.array([[0.5], [1.5]], np.float32),
    )
    brightness = cells(u, v, (0.2, 0.0), np.random.default_rng(0), 0.1)
    joint = brightness[0, 0]
    np.testing.assert_array_equal(np.flatnonzero(brightness[0] == joint) % 10, [0, 1] * 4)
    np.testing.assert_array_equal(np.flatnonzero(brightness[1] == joint) % 10, [5, 6] * 4)
    assert len(np.unique(brightness)) > 6


def test_places_on_the_floor_follow_from_the_cameras_height() -> None:
    view = View(80, 96, HORIZON, PPM, wall_share=0.5, camera_metres=1.2)
    across, away = view.floor_metres()
    rows = view.floor_rows()
    assert rows.start == 77 and len(across) == len(away) == 96 - 77
    assert across[-1, 50] == pytest.approx(1.2 * 10.5 / (95.5 - HORIZON), rel=1e-5)
    assert (np.diff(away[:, 0]) < 0).all()  # further down is nearer


def test_boxes_are_clipped_to_the_picture() -> None:
    view = View(8, 6, 3, 2, 0.5, 1.2)
    dark = (1, 1, 1)
    painting = Painting.start(view, (dark, dark, dark, dark), np.random.default_rng(0))
    painting.box(-3, -2, 4, 2, (9, 9, 9))
    painting.box(-9, -9, -1, -1, (7, 7, 7))
    expected = np.ones((6, 8, 3), np.uint8)
    expected[:2, :4] = 9
    np.testing.assert_array_equal(painting.image, expected)
