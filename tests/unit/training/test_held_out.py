"""The built-in set of pairs for evaluation."""

from __future__ import annotations

import json

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.training.sources import StreamedPairs, held_out_pairs


def test_its_people_are_never_those_of_training(body_model):
    pair = next(iter(held_out_pairs(1)))
    train = StreamedPairs(seed=2020, size=(256, 256), noise=False)[0]
    assert not np.array_equal(pair.source.load().rgb, train.source.load().rgb)
    assert pair.source.load().alpha is not None


def test_it_is_the_same_set_each_time(body_model):
    first, again = held_out_pairs(3), held_out_pairs(3)
    assert first.digest == again.digest != held_out_pairs(4).digest
    assert [pair.name for pair in first] == [pair.name for pair in again]
    names = {pair.name for pair in held_out_pairs(20)}
    assert len(names) == 20
    assert next(iter(first)).target.load().digest() == next(iter(again)).target.load().digest()


def test_it_is_scored_by_name(body_model, mt, tmp_path):
    done = mt(
        *("eval", "--protocol", "people", "--limit", 1, "--renderer", "texture"),
        *("--metrics", "ssim", "--size", "64x64", "-o", tmp_path / "scores"),
    )
    assert (done.code, done.err) == (0, "")
    results = json.loads((tmp_path / "scores" / "results.json").read_text())
    assert results["protocol"]["pairs_name"] == "people (held-out)"
    assert results["protocol"]["pairs_count"] == 1


def test_one_set_of_pairs_at_a_time(mt, tmp_path):
    both = mt("eval", "--protocol", "people", "--pairs", "x.csv", "-o", tmp_path / "scores")
    assert both.code == 2 and "one of --pairs, --clips and --protocol" in both.err
