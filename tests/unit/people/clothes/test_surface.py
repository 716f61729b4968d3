"""Fields over the body's skin."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.clothes.surface import Limb, along_polyline
from motion_transfer.people.figure.body import Shape


def test_along_polyline_counts_round_the_bend():
    joints = np.array([[0, 0, 0], [0, 0, -1.0], [1, 0, -1]])
    points = np.array([[-0.1, 0, -0.5], [0.5, 0, -1.2], [0, 0.2, 0.3]], np.float32)
    s, axis = along_polyline(points, joints)
    np.testing.assert_allclose(s, [0.5, 1.5, -0.3], atol=1e-6)
    np.testing.assert_allclose(axis, [[0, 0, -0.5], [0.5, 0, -1], [0, 0, 0.3]], atol=1e-6)


def test_limbs_are_where_they_should_be(surface):
    left = surface.is_limb(Limb.ARM_L, Limb.HAND_L, Limb.LEG_L, Limb.FOOT_L)
    right = surface.is_limb(Limb.ARM_R, Limb.HAND_R, Limb.LEG_R, Limb.FOOT_R)
    assert surface.x[left].min() > 0 > surface.x[right].max()
    assert left.sum() == right.sum()
    assert surface.z[surface.limb == Limb.HEAD].min() > surface.z[surface.limb == Limb.LEG_L].max()
    assert surface.z[surface.is_limb(Limb.FOOT_L)].max() < 0.15


def test_levels_lie_in_anatomical_order(surface):
    levels = surface.levels
    assert 0.8 < levels.crotch < levels.waist - 0.1 < levels.armpit - 0.3
    assert 0.45 < levels.arm < 0.65 < 0.8 < levels.leg < 1.0


def test_lengths_along_limbs_end_at_wrist_and_ankle(surface):
    arm = surface.arm_along[surface.limb == Limb.ARM_L]
    assert arm.max() == pytest.approx(surface.levels.arm, abs=0.04)
    hand = surface.arm_along[surface.limb == Limb.HAND_L]
    assert hand.min() > surface.levels.arm - 0.04
    foot = surface.leg_along[surface.limb == Limb.FOOT_R]
    assert foot.min() > surface.levels.leg - 0.06


def test_below_neck_is_negative_on_the_head_and_positive_on_the_trunk(surface):
    assert surface.below_neck[(surface.limb == Limb.HEAD) & (surface.z > 1.7)].max() < 0
    trunk = (surface.limb == Limb.TORSO) & (surface.z < surface.levels.armpit)
    assert surface.below_neck[trunk].min() > 0.05


def test_tubes_enclose_legs(surface, body_model):
    body = body_model.body(Shape(weight=0.9))
    for name, sign in (("leg.L", 1), ("leg.R", -1)):
        cells = surface.limb_tubes[name].gather(body.points)
        assert cells.shape == (16, 24, 3)
        assert (np.diff(cells[..., 2].mean(1)) < 0).all()
        outside = sign * (cells[:, 6, 0] - cells[:, 18, 0])  # angle 90 degrees against 270
        assert outside.min() > 0.05
