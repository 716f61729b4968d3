"""Tubes: what is gathered is read back, and cloth hangs on them."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.clothes.flattening import bridged, hanging
from motion_transfer.people.clothes.surface import Limb


def test_tables_read_back_what_was_gathered(surface, body_model):
    tube = surface.limb_tubes["leg.L"]
    table = tube.gather(body_model.template.points[:, 2])
    inside = np.nonzero((surface.limb == Limb.LEG_L) & (surface.leg_along > 0.2))[0]
    read = tube.reader(inside) @ table.ravel()
    assert np.abs(read - body_model.template.points[inside, 2]).max() < 0.04


def test_bridging_only_lifts_and_fills_hollows():
    radii = np.full((2, 24), 0.2, np.float32)
    radii[0, 5] = 0.1
    out = bridged(radii, 1)
    assert out[0, 5] == pytest.approx(0.2)
    assert (out >= radii).all()


def test_hanging_falls_straight_from_the_widest_level():
    radii = np.array([[0.2], [0.1], [0.15]], np.float32)
    np.testing.assert_allclose(hanging(radii, np.zeros(2, np.float32)), 0.2)
    np.testing.assert_allclose(
        hanging(radii, np.full(2, 0.03, np.float32))[:, 0], [0.2, 0.17, 0.15], atol=1e-6
    )
