"""Intervals and agreement, held to published values and to hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import bootstrap

from motion_transfer.evaluation.study.statistics import (
    Share,
    bootstrap_share,
    krippendorff_alpha,
    observed_agreement,
)


def test_wilson_of_seven_of_ten() -> None:
    """By hand: (0.7 + z²/20 ± z sqrt(0.021 + z²/400)) / (1 + z²/10), z = 1.959964."""
    share = Share.of(7, 10)
    assert share is not None
    assert (share.low, share.high) == pytest.approx((0.396778, 0.892208), abs=1e-5)


def test_shares_at_the_ends_and_of_nothing() -> None:
    all_of_them = Share.of(5, 5)
    assert all_of_them is not None
    assert (all_of_them.value, all_of_them.high) == (1, 1)
    assert all_of_them.low == pytest.approx(5 / (5 + 1.959964**2), abs=1e-6)  # n / (n + z²)
    assert Share.of(0, 0) is None


def test_readers_who_are_alike_leave_no_doubt_between_readers() -> None:
    assert bootstrap_share(np.full(6, 3), np.full(6, 4)) == (0.75, 0.75)
    assert bootstrap_share(np.array([3]), np.array([4])) is None


def test_whole_readers_are_drawn_again() -> None:
    """Two who disagree in everything: with 8 votes Wilson is far narrower than 0 to 1."""
    assert bootstrap_share(np.array([0, 4]), np.array([4, 4])) == (0, 1)


def test_the_bootstrap_is_scipys() -> None:
    random = np.random.default_rng(7)
    totals = random.integers(5, 40, 20)
    counts = random.binomial(totals, random.beta(6, 4, 20))
    theirs = bootstrap(
        (counts, totals),
        lambda c, t, axis=-1: c.sum(axis) / t.sum(axis),
        paired=True,
        vectorized=True,
        method="percentile",
        n_resamples=20_000,
    ).confidence_interval
    assert bootstrap_share(counts, totals) == pytest.approx(tuple(theirs), abs=0.006)


def test_krippendorffs_own_example() -> None:
    """Four observers, twelve units, missing values: nominal alpha is 0.743 (2011, section C)."""
    rows = ("123321412...", "1233224125.3", ".3332342251.", "12332441251.")
    units = [[vote for vote in column if vote != "."] for column in zip(*rows, strict=True)]
    assert krippendorff_alpha(units) == pytest.approx(0.743, abs=5e-4)


def test_alpha_at_its_ends() -> None:
    assert krippendorff_alpha([["a", "a"], ["b", "b"]]) == 1
    # by hand: all 4 pairable votes, D_o = 1, D_e = 2 * 2 * 2 / (4 * 3): 1 - 1 / (2 / 3)
    assert krippendorff_alpha([["a", "b"], ["a", "b"]]) == pytest.approx(-0.5)
    assert krippendorff_alpha([["a", "a"], ["a", "a"]]) is None
    assert krippendorff_alpha([["a"], ["b"], []]) is None


def test_observed_agreement_counts_pairs_of_votes() -> None:
    # aab: 1 of 3 pairs; ab: 0 of 1; a single vote has no pair
    assert observed_agreement([list("aab"), list("ab"), list("a")]) == pytest.approx(1 / 4)
    assert observed_agreement([["a"]]) is None
