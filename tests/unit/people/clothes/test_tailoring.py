"""Panels while they are decorated."""

from __future__ import annotations

import numpy as np

from motion_transfer.people.clothes.tailoring import Panel


def test_a_decal_is_laid_where_its_coordinates_run_from_0_to_1():
    panel = Panel(np.zeros((40, 60, 3), np.float32))
    image = np.zeros((8, 8, 4), np.float32)
    image[..., 0] = image[..., 3] = 1
    y, x = np.mgrid[:40, :60].astype(np.float32)
    panel.decal(image, (x - 20) / 20, (y - 10) / 20)
    np.testing.assert_allclose(panel.colours[20, 30], [1, 0, 0])
    assert panel.colours[:, :19].max() == panel.colours[:9].max() == 0
    assert panel.colours[:, 42:].max() == 0
