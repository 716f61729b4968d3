"""Sampled outfits: plain numbers, reproducible, as varied as streets are."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict

import numpy as np
import pytest

from motion_transfer.people.clothes.outfits import sample_outfit
from motion_transfer.people.figure.body import Shape


@pytest.fixture(scope="module")
def many():
    rng = np.random.default_rng(0)
    return {
        gender: [sample_outfit(rng, Shape(gender=gender)) for _ in range(300)] for gender in (0, 1)
    }


def test_the_same_seed_gives_the_same_outfit():
    first, second = (sample_outfit(np.random.default_rng(5), Shape(gender=1)) for _ in range(2))
    other = sample_outfit(np.random.default_rng(6), Shape(gender=1))
    assert first == second != other


def test_an_outfit_is_json(many):
    for outfit in many[1][:50]:
        description = asdict(outfit)
        assert json.loads(json.dumps(description))["shoes"]["kind"] == outfit.shoes.kind


def test_everybody_is_decent(many):
    for outfit in many[0] + many[1]:
        assert outfit.top is not None
        assert outfit.trousers is not None or outfit.skirt is not None


def test_all_kinds_occur(many):
    tops = Counter(outfit.top.kind for outfits in many.values() for outfit in outfits)
    assert {
        "t_shirt", "tank", "long_sleeve", "shirt", "blouse", "hoodie", "sweater", "crop_top",
        "polo", "turtleneck", "bodice",
    } <= set(tops)  # fmt: skip
    overs = {o.over.kind for outfits in many.values() for o in outfits if o.over}
    assert overs == {"jacket", "blazer", "coat", "cardigan"}
    shoes = {o.shoes.kind for outfits in many.values() for o in outfits}
    assert {"sneakers", "boots", "sandals", "loafers", "bare", "flats"} <= shoes


def test_skirts_are_womens_and_trousers_everybodys(many):
    def share(gender: int, part: str) -> float:
        return float(np.mean([getattr(outfit, part) is not None for outfit in many[gender]]))

    assert share(0, "skirt") == 0
    assert 0.3 < share(1, "skirt") < 0.65
    assert share(1, "trousers") > 0.35
    assert share(0, "trousers") == 1


def test_sleeves_and_hems_come_in_all_lengths(many):
    sleeves = np.array([outfit.top.sleeve for outfit in many[1]])
    assert (sleeves == 0).any()
    assert ((sleeves > 0.2) & (sleeves < 0.5)).any()
    assert (sleeves > 0.9).any()
    hems = np.array([outfit.skirt.length for outfit in many[1] if outfit.skirt])
    assert hems.min() < 0.35
    assert hems.max() > 0.9
