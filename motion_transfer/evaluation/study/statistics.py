"""How sure a share of votes is, and how far readers agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int
from scipy.stats import binomtest

CONFIDENCE = 0.95
RESAMPLES = 10_000  # the ends of an interval vary by a tenth of a percent point or two then
SEED = 0  # the same answers give the same interval
LEAST_CLUSTERS = 2


@dataclass(frozen=True)
class Share:
    """A share of votes: how many of how many, and an interval of 95 %.

    Attributes:
        low, high: Wilson's, as if every vote were independent.
    """

    count: int
    total: int
    low: float
    high: float

    @property
    def value(self) -> float:
        return self.count / self.total

    @classmethod
    def of(cls, count: int, total: int) -> Share | None:
        """Compute Wilson's interval (1927); None where nobody voted."""
        if not total:
            return None
        interval = binomtest(count, total).proportion_ci(CONFIDENCE, method="wilson")
        return cls(count, total, float(interval.low), float(interval.high))


def bootstrap_share(
    counts: Int[np.ndarray, " R"], totals: Int[np.ndarray, " R"]
) -> tuple[float, float] | None:
    """Compute the 95 % interval of a share of votes over other readers, as these were drawn.

    A reader's votes are not independent, so that whole readers are drawn again, with replacement
    (percentiles of a cluster bootstrap; Davison and Hinkley 1997, Sec. 3.8).

    Args:
        counts, totals: Of each reader; none of the totals is 0.
    Returns: None for fewer than two readers.
    """
    if len(counts) < LEAST_CLUSTERS:
        return None
    drawn = np.random.default_rng(SEED).integers(len(counts), size=(RESAMPLES, len(counts)))
    shares = counts[drawn].sum(1) / totals[drawn].sum(1)
    low, high = np.quantile(shares, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)


def observed_agreement(units: Sequence[Sequence[object]]) -> float | None:
    """Compute the share of pairs of votes on one unit that are equal; None without such a pair."""
    pairs = sum(len(votes) * (len(votes) - 1) for votes in units)
    equal = sum(votes.count(vote) - 1 for votes in map(list, units) for vote in votes)
    return equal / pairs if pairs else None


def krippendorff_alpha(units: Sequence[Sequence[object]]) -> float | None:
    """Compute Krippendorff's alpha for nominal votes, of any number on each unit.

    Returns: 1 where all agree, 0 as by chance; None where no unit has two votes, or all votes are
        equal, so that chance is not known.
    Source: Krippendorff, Computing Krippendorff's alpha-reliability, 2011.
    """
    paired = [list(votes) for votes in units if len(votes) > 1]
    values = [vote for votes in paired for vote in votes]
    total = len(values)
    expected = sum(total - values.count(value) for value in values)
    if not expected:
        return None
    disagreement = sum(
        (len(votes) - votes.count(vote)) / (len(votes) - 1) for votes in paired for vote in votes
    )
    return 1 - (total - 1) * disagreement / expected
