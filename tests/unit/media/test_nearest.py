"""`media.nearest`: what is nearest, held to trying everything."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.media.nearest import nearest_points


@pytest.mark.parametrize(("points", "count", "given"), [(700, 12, 12), (700, 1, 1), (5, 12, 5)])
def test_nearest_points_are_exact(points: int, count: int, given: int) -> None:
    rng = np.random.default_rng(1)
    known = rng.uniform(-1, 1, (points, 3))
    known[-2:] = known[:2]  # the same place twice
    places = rng.uniform(-2, 2, (300, 3))
    distance, index = nearest_points(known, places, count)
    assert index.shape == (300, given)
    every = np.linalg.norm(places[:, None] - known, axis=-1)
    np.testing.assert_allclose(distance, np.sort(every, 1)[:, :given], rtol=1e-5)
    np.testing.assert_allclose(np.take_along_axis(every, index, 1), distance, rtol=1e-5)
    assert [len(each) for each in nearest_points(known, places[:0], count)] == [0, 0]
