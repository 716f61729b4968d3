"""Skirts: cloth is pushed out of the legs, and no further."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.clothes.fabrics import Fabric
from motion_transfer.people.clothes.fit import Fitting
from motion_transfer.people.clothes.skirts import (
    COLUMNS,
    Cones,
    exit_distance,
    leg_cones,
    settler,
    shape_skirt,
)
from motion_transfer.people.clothes.wardrobe import Skirt
from motion_transfer.people.figure.body import Shape

CLOTH = Fabric("plain", ((0.4, 0.5, 0.6),), 0.001, 0.0, 0.02, "jersey", 1)


@pytest.mark.parametrize("length", [0.3, 0.6, 0.95])
def test_a_skirt_keeps_outside_the_legs_in_a_stride(length, body_model, surface, in_stride):
    body = body_model.body(Shape(gender=1))
    skirt = Skirt("a_line", CLOTH, length=length, flare=0.1)
    shape = shape_skirt(skirt, Fitting(surface, body))
    pose = in_stride(body)
    loose = shape.weights.pose(shape.points, pose.transforms)
    settled = settler(shape, surface)(loose, pose)
    cones = leg_cones(surface, pose.points)
    below = slice(10 * COLUMNS, None)
    before = depth_inside(loose[below], cones)
    after = depth_inside(settled[below], cones)
    assert before.max() > 0.01  # the test's pose needs settling
    assert after.max() < 0.004
    assert np.linalg.norm(np.diff(settled.reshape(-1, COLUMNS, 3), axis=0), axis=2).max() < 0.15


def depth_inside(points, cones) -> np.ndarray:
    """Greatest depth of points inside cones, metres, by the distance to their axes."""
    depth = np.full(len(points), -np.inf)
    for start, end, radii in zip(cones.start, cones.end, cones.radius, strict=True):
        axis = end - start
        t = ((points - start) @ axis) / (axis @ axis)
        on = np.clip(t, 0, 1)
        distance = np.linalg.norm(points - start - on[:, None] * axis, axis=1)
        inside = radii[0] + (radii[1] - radii[0]) * on - distance
        depth = np.maximum(depth, np.where((t > 0) & (t < 1), inside, -np.inf))
    return depth


def test_exit_distance_of_a_cylinder():
    cones = Cones(
        np.array([[0, 0, 1.0]], np.float32),
        np.array([[0, 0, 0.0]], np.float32),
        np.array([[0.1, 0.1]], np.float32),
    )
    points = np.array([[0.05, 0, 0.5], [-0.3, 0, 0.5], [0.2, 0, 0.5], [0, 0.5, 0.5]], np.float32)
    outward = np.broadcast_to(np.array([1, 0, 0], np.float32), (4, 3))
    np.testing.assert_allclose(
        exit_distance(points, outward, cones), [0.05, 0.4, -0.1, -1], atol=1e-4
    )
