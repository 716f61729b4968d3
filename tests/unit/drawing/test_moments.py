"""The best moments of a clip: few, seen once, and together they show the most."""

from __future__ import annotations

import weakref
from itertools import permutations

import numpy as np
import pytest
from jaxtyping import Float

from motion_transfer.drawing.moments import LEAST_GAIN, MOST_MOMENTS, Moments

SIDE = 8
Rating = Float[np.ndarray, "1 S S"]


class Frame:
    """Something that a moment holds; unlike a string, it can be seen to be released."""


def sees(*rows: int, well: float = 1.0) -> Rating:
    """A rating of some rows of the texture."""
    rating = np.zeros((1, SIDE, SIDE), np.float32)
    rating[0, list(rows)] = well
    return rating


def choose(offered: dict[str, Rating], limit: int = MOST_MOMENTS) -> list[str]:
    moments = Moments[str](limit)
    for name, rating in offered.items():
        moments.offer(rating, name)
    return moments.chosen()


def test_what_is_not_kept_is_released_at_once() -> None:
    """However long the clip is, no more frames are held than the limit."""
    random = np.random.default_rng(0)
    moments, frames = Moments[Frame](3), []
    for number in range(60):
        frame = Frame()
        frames.append(weakref.ref(frame))
        # ever better, so that each is kept for a while
        rating = random.random((1, SIDE, SIDE)) * (1 + number / 9)
        moments.offer(rating, frame)
        del frame
        held = sum(one() is not None for one in frames)
        assert held == min(number + 1, 3)
    assert len(moments.chosen()) <= 3


@pytest.mark.parametrize("order", [*permutations(["head", "trunk", "legs"])])
def test_the_moments_that_show_most_together_are_found(order: tuple[str, ...]) -> None:
    """Among many that see everything badly, three see a third each as well as can be."""
    best = {"head": sees(0, 1), "trunk": sees(2, 3, 4), "legs": sees(5, 6, 7)}
    random = np.random.default_rng(1)
    offered: dict[str, Rating] = {}
    for name in order:
        for number in range(5):
            blurred = 0.1 + 0.1 * random.random((1, SIDE, SIDE))
            offered[f"before the {name} {number}"] = blurred
        offered[name] = best[name]
    assert choose(offered, limit=3) == list(order)


def test_a_better_one_takes_the_place_of_what_it_shows() -> None:
    offered = {
        "far": sees(0, 1, 2, well=0.4),
        "legs": sees(5, 6),
        "near": sees(0, 1, 2, well=0.9),
    }
    assert choose(offered) == ["legs", "near"]
    assert choose(offered, limit=2) == ["legs", "near"]


def test_several_become_superfluous_together_but_not_all() -> None:
    """Each of two that are alike could go; one has to stay."""
    offered = {"upper": sees(0, 1), "lower": sees(2, 3), "all": sees(0, 1, 2, 3, well=1.02)}
    assert choose(offered) == ["all"]
    assert choose({"one": sees(0), "again": sees(0), "once more": sees(0)}) == ["one"]


def test_little_more_is_not_worth_a_moment() -> None:
    everything = sees(*range(SIDE))
    for share, kept in ((LEAST_GAIN * 0.5, 1), (LEAST_GAIN * 3, 2)):
        more = everything.copy()
        more[0, 0] += share * SIDE
        assert len(choose({"all": everything, "a little more": more - sees(*range(1, SIDE))})) == (
            kept
        )


def test_moments_that_show_nothing_are_not_kept() -> None:
    assert choose({}) == []
    assert choose({"empty": sees()}) == []
    assert choose({"empty": sees(), "feet": sees(7), "empty again": sees()}) == ["feet"]
