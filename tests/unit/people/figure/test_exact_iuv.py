"""The exact IUV of a body: charts where they belong."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from reference.people_iuv import barycentric, reference_iuv

from motion_transfer.people.figure.charts import load_charts
from motion_transfer.people.figure.exact_iuv import render_iuv
from motion_transfer.people.figure.framing import frame_points

HAND_RIGHT, HAND_LEFT, FOOT_LEFT, FOOT_RIGHT, HEAD_RIGHT, HEAD_LEFT = 3, 4, 5, 6, 23, 24
TORSO_BACK, TORSO_FRONT = 1, 2


def view(model, azimuth: float) -> np.ndarray:
    body = model.template
    camera = frame_points(body.points, (192, 256), distance=4.0, azimuth=azimuth)
    return render_iuv(body.points, model.faces, load_charts(), camera)


def centre(iuv: np.ndarray, part: int) -> tuple[float, float]:
    rows, columns = np.nonzero(iuv[..., 0] == part)
    assert len(rows) > 20, f"part {part} is not seen"
    return float(columns.mean()), float(rows.mean())


@pytest.mark.parametrize(
    ("left", "right"), [(HAND_LEFT, HAND_RIGHT), (FOOT_LEFT, FOOT_RIGHT), (HEAD_LEFT, HEAD_RIGHT)]
)
def test_the_persons_left_is_on_the_right_in_front_and_on_the_left_behind(body_model, left, right):
    front, back = view(body_model, 0.0), view(body_model, np.pi)
    assert centre(front, left)[0] > centre(front, right)[0]
    assert centre(back, left)[0] < centre(back, right)[0]


def test_front_is_in_front(body_model):
    front, back = view(body_model, 0.0), view(body_model, np.pi)
    assert (front[..., 0] == TORSO_FRONT).sum() > 20 * (front[..., 0] == TORSO_BACK).sum()
    assert (back[..., 0] == TORSO_BACK).sum() > 20 * (back[..., 0] == TORSO_FRONT).sum()


def test_all_parts_are_seen_from_two_sides_and_the_background_is_empty(body_model):
    front, back = view(body_model, 0.0), view(body_model, np.pi)
    assert set(np.unique(front[..., 0])) | set(np.unique(back[..., 0])) == set(range(25))
    assert not front[front[..., 0] == 0].any()
    assert not front[:, 0].any() and not front[0].any()


def test_charts_change_smoothly_within_a_part(body_model):
    iuv = view(body_model, 0.0).astype(int)
    same = (iuv[:, 1:, 0] == iuv[:, :-1, 0]) & (iuv[:, 1:, 0] == TORSO_FRONT)
    steps = np.abs(np.diff(iuv, axis=1))[same][:, 1:]
    assert np.median(steps.max(1)) <= 6  # of 255, a pixel apart


def test_equals_the_reference(body_model):
    body = body_model.template
    camera = frame_points(body.points, (192, 256), distance=2.0, azimuth=0.7, elevation=0.4)
    arguments = (body.points, body_model.faces, load_charts(), camera)
    ours, reference = render_iuv(*arguments).astype(int), reference_iuv(*arguments)
    assert (ours[..., 0] == reference[..., 0]).all()
    assert np.abs(ours - reference).max() <= 1  # float32 in another order may round otherwise
    assert (ours != reference).mean() < 1e-3


def test_barycentric_weights_lead_back_to_the_pixel():
    rng = np.random.default_rng(0)
    corners = rng.uniform((0, 0, 2), (32, 32, 5), (50, 3, 3)).astype(np.float32)
    pixel = rng.integers(0, 32 * 32, 50)
    weights = barycentric(corners, pixel, 32)
    # in perspective, weights / depth are what is linear on the picture plane
    flat = weights * corners[..., 2]
    flat /= flat.sum(1, keepdims=True)
    place = np.einsum("pk,pkc->pc", flat, corners[..., :2])
    expected = np.stack([pixel % 32 + 0.5, pixel // 32 + 0.5], 1)
    assert place == pytest.approx(expected, abs=0.05)
    assert weights.sum(1) == pytest.approx(np.ones(50), abs=1e-5)
