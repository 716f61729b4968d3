"""From the numbers of many pairs to one line of a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Summary:
    """One number over all pairs.

    Attributes:
        mean, median: over the pairs that have it; NaN where none has.
        standard_error: of the mean; None where it cannot be told (one group only, infinite values,
            a number of the whole set).
        count: how many pairs have it.
    """

    mean: float
    median: float | None
    standard_error: float | None
    count: int


def summarise(values: Sequence[float], groups: Sequence[str]) -> Summary:
    """Mean, median and standard error; NaN means that a pair does not have the number.

    Pairs of one group (of one source, of one clip) are not independent, so the error is that of a
    mean of G clusters: sqrt(G / (G - 1) * sum over groups of (sum of deviations)^2) / n. Where
    each pair is a group of its own this is the usual standard deviation / sqrt(n).
    Source: Liang and Zeger, Biometrika 1986, for a mean.
    """
    array = np.asarray(values, np.float64)
    known = ~np.isnan(array)
    array = array[known]
    if not len(array):
        return Summary(float("nan"), None, None, 0)
    mean, median = float(array.mean()), float(np.median(array))
    _, member = np.unique(np.asarray(groups)[known], return_inverse=True)
    count = int(member.max()) + 1
    if count < 2 or not np.isfinite(array).all():
        return Summary(mean, median, None, len(array))
    sums = np.bincount(member, weights=array - mean)
    error = float(np.sqrt(count / (count - 1) * (sums**2).sum()) / len(array))
    return Summary(mean, median, error, len(array))
