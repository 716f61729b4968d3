"""The best few moments of a clip, chosen as it goes by: those that together see most."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Float

MOST_MOMENTS = 24
"""More add little: a turn shows each place of the body for a quarter of its time."""

LEAST_GAIN = 0.01
"""Of what all moments show together: one that adds less is not kept."""

Moment = TypeVar("Moment")


Rating = Float[np.ndarray, " L"]


class Moments(Generic[Moment]):
    """Keeps the moments that add most, at constant memory, while each is looked at once.

    What is made as large as it can be is the sum over texels of the best rating that any kept
    moment gives it. A new moment is kept if it adds enough to that; of too many, the one goes whose
    place the others take best.
    Source: streaming maximisation of a monotone submodular function by exchanges, as Buchbinder,
    Feldman and Schwartz describe it (SODA 2015).
    """

    def __init__(self, limit: int = MOST_MOMENTS) -> None:
        self._limit = limit
        self._kept: list[tuple[Rating, Moment]] = []

    def offer(self, rating: Float[np.ndarray, "1 S S"], moment: Moment) -> None:
        """Look at the next moment; what is not kept is forgotten."""
        flat = rating.ravel()
        best = self._best(self._kept, like=flat)
        if np.maximum(flat - best, 0).sum() <= LEAST_GAIN * best.sum():
            return
        self._kept.append((flat, moment))
        if len(self._kept) > self._limit:
            del self._kept[self._least()[0]]

    def chosen(self) -> list[Moment]:
        """Give the moments that add enough, in their order."""
        while len(self._kept) > 1:  # later moments have made some superfluous
            least, loss = self._least()
            if loss > LEAST_GAIN * self._best(self._kept, like=self._kept[0][0]).sum():
                break
            del self._kept[least]
        return [moment for _, moment in self._kept]

    def _least(self) -> tuple[int, float]:
        """The kept moment that is missed least, and by how much."""
        ratings = np.stack([rating for rating, _ in self._kept])
        order = np.sort(ratings, axis=0)
        # only who is best somewhere is missed there, and the second best takes the place
        missed = np.where(ratings == order[-1], order[-1] - order[-2], 0).sum(1)
        return int(missed.argmin()), float(missed.min())

    @staticmethod
    def _best(kept: list[tuple[Rating, Moment]], like: Rating) -> Rating:
        return np.max([rating for rating, _ in kept], axis=0) if kept else np.zeros_like(like)
