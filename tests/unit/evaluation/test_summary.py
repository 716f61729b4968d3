"""Means and their errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from motion_transfer.evaluation.summary import Summary, summarise


def test_independent_pairs_have_the_usual_error() -> None:
    values = np.random.default_rng(0).normal(size=20)
    found = summarise(list(values), [str(n) for n in range(20)])
    assert found.mean == pytest.approx(values.mean())
    assert found.median == pytest.approx(np.median(values))
    assert found.standard_error == pytest.approx(values.std(ddof=1) / math.sqrt(20))
    assert found.count == 20


def test_repeating_a_pair_adds_no_certainty() -> None:
    values = np.random.default_rng(0).normal(size=10)
    groups = [str(n) for n in range(10)]
    once = summarise(list(values), groups)
    thrice = summarise(list(values) * 3, groups * 3)
    assert thrice.standard_error == pytest.approx(once.standard_error)


def test_pairs_without_the_number_are_left_out() -> None:
    found = summarise([1.0, math.nan, 3.0], ["a", "b", "c"])
    assert (found.mean, found.median, found.count) == (2, 2, 2)
    nothing = summarise([math.nan], ["a"])
    assert math.isnan(nothing.mean)
    assert (nothing.median, nothing.standard_error, nothing.count) == (None, None, 0)


def test_where_the_error_cannot_be_told() -> None:
    assert summarise([1.0, 2.0], ["a", "a"]) == Summary(1.5, 1.5, None, 2)
    found = summarise([1.0, math.inf], ["a", "b"])
    assert (found.mean, found.standard_error) == (math.inf, None)
