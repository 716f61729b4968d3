"""What tests of clothes share: the skin's fields, and a body that strides."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest


@pytest.fixture(scope="session")
def surface(body_model):
    from motion_transfer.people.clothes.surface import BodySurface

    return BodySurface(body_model)


def turned(angle: float) -> np.ndarray:
    """About x; positive swings a leg backwards."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


@pytest.fixture
def in_stride(body_model) -> Callable:
    from motion_transfer.people.figure.mesh import PosedBody

    bones = {"upperleg01.L": turned(-0.6), "upperleg01.R": turned(0.4), "lowerleg01.R": turned(0.5)}

    def pose(body) -> PosedBody:
        transforms = body.transforms(bones)
        points = body_model.pose(body, transforms)
        return PosedBody(body, transforms, points, body.posed_joints(transforms))

    return pose
