"""Long hair hangs down however the head is held, and skirts keep out of the legs."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")

from motion_transfer.people.figure.body import BodyModel  # noqa: E402
from motion_transfer.people.figure.mesh import PosedBody  # noqa: E402
from motion_transfer.people.free.settling import hang_hair, hang_skirt  # noqa: E402
from motion_transfer.people.head.hair.grid import grid_faces  # noqa: E402
from motion_transfer.people.head.head_map import rigid  # noqa: E402
from motion_transfer.people.person import body_surface  # noqa: E402

ROWS, COLUMNS = 24, 8


def posed(model: BodyModel, **turns: float) -> PosedBody:
    """The template with bones turned about the axis to the left; positive bends forward."""
    body, rotations = model.template, {}
    for name, angle in turns.items():
        c, s = np.cos(angle), np.sin(angle)
        rotations[name.replace("_", ".")] = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    transforms = body.transforms(rotations)
    points = model.weights.pose(body.points, transforms)
    return PosedBody(body, transforms, points, body.posed_joints(transforms))


def curtain(length: float) -> np.ndarray:
    """Hair that hangs straight down behind the head, row by row from its top."""
    down, across = np.meshgrid(
        np.linspace(0, length, ROWS), np.linspace(-0.05, 0.05, COLUMNS), indexing="ij"
    )
    return np.stack([across, np.full_like(down, 0.10), 1.80 - down], -1).reshape(-1, 3).astype("f4")


def test_hair_to_the_ears_needs_no_hanging(body_model):
    faces, _ = grid_faces(3, COLUMNS, closed=False)
    assert hang_hair(curtain(0.05), faces, body_model.template, body_model) is None


def test_long_hair_hangs_down_from_a_bent_head_and_lies_on_no_skin(body_model):
    hair, (faces, _) = curtain(0.6), grid_faces(ROWS, COLUMNS, closed=False)
    settle = hang_hair(hair, faces, body_model.template, body_model)
    assert settle is not None
    for bend in (-0.5, 0.0, 0.6):
        body = posed(body_model, head=bend)
        stiff = rigid(body_model, len(hair)).pose(hair, body.transforms)
        hung = settle(stiff, body).reshape(ROWS, COLUMNS, 3)
        stiff = stiff.reshape(hung.shape)
        assert np.allclose(hung[0], stiff[0], atol=1e-5)  # the roots go with the head
        aside, swung = (np.ptp(each[12:, :, 1], axis=0).max() for each in (hung, stiff))
        assert aside < 0.16
        if bend:
            assert aside < swung  # a stiff curtain swings out of the vertical
        skin = body.points
        for point in hung[8:].reshape(-1, 3)[::7]:
            near = skin[np.linalg.norm(skin - point, axis=1).argmin()]
            assert np.linalg.norm(near - point) > 0.002


def test_a_skirt_hangs_as_it_was_made_and_is_lifted_by_a_thigh(body_model):
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    z = np.linspace(1.05, 0.35, 20)[:, None] + 0 * turn
    radius = 0.17 + 0.2 * (1.05 - z)
    points = np.stack([radius * np.sin(turn), -radius * np.cos(turn) - 0.02, z], -1)
    points = points.reshape(-1, 3).astype(np.float32)
    skirt = hang_skirt(points, body_model.template, body_surface(body_model))
    assert np.allclose(skirt.weights.matrix.sum(1), 1, atol=1e-5)
    still = posed(body_model)
    at_rest = skirt.settle(skirt.weights.pose(points, still.transforms), still)
    assert np.abs(at_rest - points).max() < 0.03
    stride = posed(body_model, upperleg01_L=-1.0)
    moved = skirt.weights.pose(points, stride.transforms)
    lifted = skirt.settle(moved, stride)
    pushed = np.linalg.norm(lifted - moved, axis=1)
    left = points[:, 0] > 0.05
    assert pushed[left].max() > 0.01 > pushed[points[:, 2] > 1.02].max()
