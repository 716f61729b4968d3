"""The one-euro filter, and where people are searched."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.estimate.blazepose.tracker import IMAGE_SMOOTHING, OneEuroFilter, tiles

SECONDS = 1 / 30


def run(
    values: np.ndarray, settings: tuple[float, float] = IMAGE_SMOOTHING, size: float = 1
) -> np.ndarray:
    smooth = OneEuroFilter(*settings)
    return np.stack([smooth(value, SECONDS, size) for value in values])


def test_what_stands_still_stays() -> None:
    values = np.full((20, 2), 3.5, np.float32)
    assert np.array_equal(run(values), values)


def test_trembling_is_calmed_and_running_is_followed() -> None:
    rng = np.random.default_rng(0)
    tremble = rng.normal(0, 0.0005, (200, 1))
    assert run(tremble)[50:].std() < 0.5 * tremble[50:].std()
    walk = np.linspace(0, 3, 90)[:, None]  # one size a second
    assert np.abs(run(walk) - walk)[30:].max() < 0.02


def test_size_makes_near_and_far_alike() -> None:
    values = np.random.default_rng(1).normal(0, 1, (30, 3)).cumsum(0)
    near, far = run(values * 100, size=100), run(values, size=1)
    assert near / 100 == pytest.approx(far)


def test_a_lower_cutoff_is_the_papers_low_pass() -> None:
    # without a gain for speed it is an exponential average with a share of 1 / (1 + 1 / (2 pi f t))
    found = run(np.array([[0.0], [1.0], [1.0]]), (1.0, 0.0))
    share = 1 / (1 + 1 / (2 * np.pi * SECONDS))
    assert found.ravel() == pytest.approx([0, share, share + (1 - share) * share])


def test_tiles_cover_the_frame_and_are_few() -> None:
    for height, width in ((600, 1116), (512, 512), (100, 9000), (1, 1)):
        squares = tiles(height, width)
        assert len(squares) <= 72
        if min(height, width) > 448:
            ends = [(tile.x + tile.side / 2, tile.y + tile.side / 2) for tile in squares]
            assert max(ends) == pytest.approx((width, height))
