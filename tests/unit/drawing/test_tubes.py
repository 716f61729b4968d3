"""Torso and thighs, unrolled."""

from __future__ import annotations

import numpy as np

from motion_transfer.drawing.tubes import go_around, unroll_body
from nhrr_core import load_uv_tables

SIZE = 256
POSITION = load_uv_tables().position.reshape(-1, 3)


def test_every_texel_lies_in_its_cell() -> None:
    for tube in unroll_body(SIZE):
        own, named = POSITION[tube.texels], POSITION[tube.cells[tube.rows, tube.columns]]
        assert np.linalg.norm(own - named, axis=1).max() < 0.06
        assert np.median(np.linalg.norm(own - named, axis=1)) < 0.004


def test_the_way_around_begins_in_front_and_goes_by_the_left_side() -> None:
    turns = np.arange(0, 1, 0.125)
    points = np.stack([np.sin(turns * 2 * np.pi), 0 * turns, np.cos(turns * 2 * np.pi)]) * 0.2
    high = points + np.array([[0.5], [0.012], [0.1]])  # another ring, elsewhere
    rows, around, radius = go_around(np.concatenate([points, high], axis=1).astype(np.float32))
    assert rows.tolist() == [0] * 8 + [2] * 8
    np.testing.assert_allclose(around, np.tile(turns, 2), atol=1e-5)
    assert np.isclose(radius, 0.2)
