"""The crop window: cut, and paste back where it was."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.drawing.canvas import paste
from motion_transfer.drawing.person import Box, find_people
from motion_transfer.drawing.window import SIDE_STEP, Window, drawn_side, plan_window
from nhrr_core import ModelConfig

INSIDE = Window(10, 20, 30)
BEYOND = [Window(-10, -5, 40), Window(40, 70, 50), Window(-30, -20, 140)]


@pytest.mark.parametrize("window", [INSIDE, *BEYOND])
def test_cut_then_paste_puts_every_pixel_back(studio, window: Window) -> None:
    iuv = studio.iuv()
    crop = window.cut(iuv, window.side)
    frame = np.full_like(iuv, 99)
    coverage = np.full((window.side, window.side, 1), 255, np.uint8)
    paste(frame, np.concatenate([crop, coverage], 2), window)
    inside = np.zeros(iuv.shape[:2], bool)
    inside[max(window.y, 0) : window.y + window.side, max(window.x, 0) : window.x + window.side] = 1
    np.testing.assert_array_equal(frame[inside], iuv[inside])
    assert (frame[~inside] == 99).all()


@pytest.mark.parametrize("window", BEYOND)
def test_beyond_the_frame_is_background(studio, window: Window) -> None:
    crop = window.cut(np.full((96, 64, 3), 7, np.uint8), window.side)
    rows = (np.arange(window.side) + window.y >= 0) & (np.arange(window.side) + window.y < 96)
    columns = (np.arange(window.side) + window.x >= 0) & (np.arange(window.side) + window.x < 64)
    np.testing.assert_array_equal(crop[..., 0] > 0, rows[:, None] & columns)


@pytest.mark.parametrize("size", [17, 64, 200])
@pytest.mark.parametrize("window", [INSIDE, *BEYOND])
def test_no_pixel_appears_that_was_not_there(studio, window: Window, size: int) -> None:
    iuv = studio.iuv()
    crop = window.cut(iuv, size)
    assert crop.shape == (size, size, 3)
    before = {tuple(pixel) for pixel in iuv.reshape(-1, 3).tolist()} | {(0, 0, 0)}
    assert {tuple(pixel) for pixel in crop.reshape(-1, 3).tolist()} <= before


def test_partial_coverage_blends() -> None:
    frame = np.full((16, 16, 3), 100, np.uint8)
    rgba = np.full((16, 16, 4), 200, np.uint8)
    rgba[:, :8, 3], rgba[:, 8:, 3] = 0, 51
    paste(frame, rgba, Window(0, 0, 16))
    assert (frame[:, :8] == 100).all()
    assert (frame[:, 8:] == 120).all()


@pytest.mark.parametrize("size", [8, 32])
def test_a_crop_of_another_size_is_scaled(size: int) -> None:
    frame = np.zeros((20, 20, 3), np.uint8)
    paste(frame, np.full((size, size, 4), 255, np.uint8), Window(2, 4, 16))
    expected = np.zeros_like(frame)
    expected[4:20, 2:18] = 255
    np.testing.assert_array_equal(frame, expected)


def test_the_window_holds_the_whole_path(studio) -> None:
    path = [find_people(frame).persons[0] for frame in studio.walk(15)]
    window = plan_window([*(p.box for p in path), None])
    assert window.side % SIDE_STEP == 0
    longest = max(max(p.box.width, p.box.height) for p in path)
    assert longest * 1.16 <= window.side
    for person in path:
        assert window.x < person.box.left
        assert person.box.right < window.x + window.side
        assert window.y < person.box.top
        assert person.box.bottom < window.y + window.side


def test_a_speck_gets_a_window_that_codecs_take() -> None:
    window = plan_window([Box(50, 50, 52, 53)])
    assert window.side == 32
    assert window.x <= 50 < 53 <= window.x + 32


@pytest.mark.parametrize(
    ("side", "image_size", "down_blocks", "drawn"),
    [
        (256, 256, 3, 256),
        (192, 256, 3, 192),
        (320, 256, 3, 320),
        (160, 256, 3, 256),
        (640, 256, 3, 640),
        (672, 256, 3, 512),
        (960, 256, 3, 512),
        (960, 512, 3, 960),
        (270, 256, 3, 256),  # given by hand: RenderNet halves sides
        (330, 256, 3, 512),
        (264, 256, 3, 264),
        (288, 256, 6, 256),
        (320, 256, 6, 320),
    ],
)
def test_a_network_draws_all_but_small_and_large_windows_unscaled(
    side: int, image_size: int, down_blocks: int, drawn: int
) -> None:
    assert drawn_side(side, ModelConfig(image_size=image_size, down_blocks=down_blocks)) == drawn
