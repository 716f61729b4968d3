"""Alpha: arithmetic that loses nothing it need not lose, and colours that run under alpha 0."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from motion_transfer.media.alpha import (
    Picture,
    add_alpha,
    clear_colours,
    extend_colours,
    lay_on_white,
    premultiply,
    split_alpha,
    unpremultiply,
)

LEVELS = np.arange(256, dtype=np.uint8)
EVERY = np.repeat(np.tile(LEVELS, (256, 1))[..., None], 3, 2)
OPACITY = np.repeat(LEVELS[:, None], 256, 1)


def test_every_product_is_rounded_to_nearest() -> None:
    wanted = np.rint(EVERY.astype(float) * OPACITY[..., None] / 255)
    np.testing.assert_array_equal(premultiply(EVERY, OPACITY), wanted)


def test_what_is_divided_multiplies_to_the_same() -> None:
    product = premultiply(EVERY, OPACITY)
    np.testing.assert_array_equal(premultiply(unpremultiply(product, OPACITY), OPACITY), product)
    assert not unpremultiply(EVERY, np.zeros_like(OPACITY)).any()


def test_white_shows_where_it_is_transparent() -> None:
    weight = OPACITY[..., None] / 255
    wanted = np.rint(EVERY * weight + 255 * (1 - weight))
    np.testing.assert_array_equal(lay_on_white(EVERY, OPACITY), wanted)
    np.testing.assert_array_equal(Picture(EVERY).on_white(), EVERY)


def test_channels_are_taken_apart_and_put_together() -> None:
    colours, alpha = split_alpha(add_alpha(EVERY, OPACITY))
    np.testing.assert_array_equal(colours, EVERY)
    np.testing.assert_array_equal(alpha, OPACITY)
    assert (add_alpha(EVERY)[..., 3] == 255).all()


def disc(size: tuple[int, int], radius: float, centre: tuple[float, float]) -> np.ndarray:
    y, x = np.mgrid[: size[0], : size[1]]
    distance = np.hypot(x - centre[0], y - centre[1])
    return np.rint(255 * np.clip((radius - distance) / 6, 0, 1)).astype(np.uint8)


def colours_of(size: tuple[int, int]) -> np.ndarray:
    y, x = np.mgrid[: size[0], : size[1]]
    return np.stack([200 + 0 * x, 40 + x // 4, 60 + y // 4], -1).astype(np.uint8)


@pytest.mark.parametrize(
    ("size", "radius", "centre"),
    [
        ((121, 195), 40, (90, 60)),
        ((200, 300), 30, (3, 2)),  # at the corner
        ((64, 64), 20, (63, 63)),
        ((1, 1), 20, (0, 0)),
        ((3, 400), 30, (200, 1)),
    ],
)
def test_colours_run_under_alpha_0(size, radius: float, centre) -> None:
    alpha, colours = disc(size, radius, centre), colours_of(size)
    noise = np.random.default_rng(0).integers(0, 256, colours.shape, np.uint8)
    hidden = np.where(alpha[..., None] > 0, colours, noise)
    extended = extend_colours(hidden, alpha)
    np.testing.assert_array_equal(extended[alpha > 0], colours[alpha > 0])
    beside = (alpha == 0) & (cv2.dilate(alpha, np.ones((9, 9), np.uint8)) > 0)
    off = np.abs(extended.astype(int) - colours)
    assert not beside.any() or off[beside].max() <= 12
    assert off.max() <= 80  # far away it is another of the disc's colours
    other = np.where(alpha[..., None] > 0, colours, 255 - noise)
    np.testing.assert_array_equal(extend_colours(other, alpha), extended)


def test_cells_of_four_pixels_have_their_covered_ones_colour() -> None:
    """What 4:2:0 averages, then, is nobody else's."""
    alpha = np.zeros((64, 64), np.uint8)
    alpha[31, 33] = 7
    colours = np.full((64, 64, 3), 255, np.uint8)
    colours[31, 33] = 10, 100, 50
    extended = extend_colours(colours, alpha)
    assert (extended[30:32, 32:34] == (10, 100, 50)).all()


def test_there_may_be_nothing_to_extend() -> None:
    colours = colours_of((50, 40))
    assert not extend_colours(colours, np.zeros((50, 40), np.uint8)).any()
    np.testing.assert_array_equal(extend_colours(colours, np.full((50, 40), 1, np.uint8)), colours)


def test_cleared_colours_are_black_under_alpha_0_only() -> None:
    alpha, colours = disc((50, 40), 15, (20, 20)), colours_of((50, 40))
    cleared = clear_colours(colours, alpha)
    assert not cleared[alpha == 0].any()
    np.testing.assert_array_equal(cleared[alpha > 0], colours[alpha > 0])
