"""Scoring: every candidate gets the same pairs, once, in order, whatever the number of threads."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from motion_transfer.errors import RenderError
from motion_transfer.evaluation.candidates import OpenedSource, TargetCandidate
from motion_transfer.evaluation.framing import Framing
from motion_transfer.evaluation.measures import (
    Column,
    FlickerMeasure,
    Measures,
    SetMeasure,
    l1_measure,
)
from motion_transfer.evaluation.report import Summary, summarise_methods
from motion_transfer.evaluation.scoring import Scorer
from motion_transfer.training.pairs import Pair, PairList
from motion_transfer.training.pictures import PersonPicture

FRAMING = Framing(64, 96)


class Painted:
    """A picture made in memory, as synthetic people are."""

    def __init__(self, studio, name: str, x: int = 0) -> None:
        self.name = name
        self.loads = 0
        self._iuv = studio.iuv(x)
        self._rgb = studio.dress(self._iuv)

    def load(self) -> PersonPicture:
        self.loads += 1
        return PersonPicture(self.name, self._rgb, self._iuv, None)


class Darker:
    """A method that gives the target, darker by a number of levels for each pair of a source."""

    label = "darker"

    def __init__(self, takes_turns: bool = False) -> None:
        self.takes_turns = takes_turns
        self.opened: list[str] = []

    def describe(self) -> dict[str, Any]:
        return {}

    def open_source(self, source: OpenedSource):
        self.opened.append(source.picture.name)
        darkness = iter(range(1, 100))

        def draw(pair: Pair, target: PersonPicture) -> np.ndarray:
            if pair.target.name == "bad":
                raise RuntimeError("out of memory")
            return target.rgb - np.uint8(next(darkness))

        return draw


@pytest.fixture
def pairs(studio) -> PairList:
    """Three sources with four targets each, all frames of clips."""
    made = []
    for clip in "abc":
        source = Painted(studio, f"{clip}/0")
        for frame in (1, 2, 5, 6):
            target = Painted(studio, f"{clip}/{frame}", x=frame)
            made.append(Pair(source, target, group=clip, frame=frame))
    return PairList("painted", made, "digest")


@pytest.mark.parametrize("workers", [1, 4])
@pytest.mark.parametrize("takes_turns", [False, True])
def test_scores_come_in_order_and_sources_are_opened_once(
    pairs: PairList, workers: int, takes_turns: bool
) -> None:
    candidate = Darker(takes_turns)
    done: list[int] = []
    measures = Measures((l1_measure(),))
    with Scorer([candidate, TargetCandidate()], measures, FRAMING, workers=workers) as scorer:
        scored = scorer.score(pairs, done.append)
    assert [entry.pair for entry in scored] == list(pairs)
    assert [entry.scores[0]["l1"] for entry in scored] == [1, 2, 3, 4] * 3
    assert {entry.scores[1]["l1"] for entry in scored} == {0}
    assert sorted(candidate.opened) == ["a/0", "b/0", "c/0"]
    assert {pair.source.loads for pair in pairs} == {1}
    assert sum(done) == 12


def test_flicker_is_measured_between_consecutive_frames_only(pairs: PairList) -> None:
    measures = Measures((FlickerMeasure(),))
    with Scorer([Darker()], measures, FRAMING, workers=2) as scorer:
        scored = scorer.score(pairs)
    found = [entry.scores[0]["flicker"] for entry in scored]
    assert found == pytest.approx([math.nan, 1, math.nan, 1] * 3, nan_ok=True)


class Brightness(SetMeasure):
    """Keeps how bright pictures are; the distance is that of the means."""

    columns = (Column("brightness", "lower", 1, "means"),)

    def features(self, images) -> list[np.ndarray]:
        return [np.array([image.mean()]) for image in images]

    def distance(self, results, targets) -> float:
        return float(abs(np.mean(results) - np.mean(targets)))


def test_a_measure_of_sets_sees_all_results_and_all_targets(pairs: PairList) -> None:
    measures = Measures((l1_measure(), Brightness()))
    candidates = [Darker(), TargetCandidate()]
    with Scorer(candidates, measures, FRAMING, workers=2) as scorer:
        scored = scorer.score(pairs)
    darker, real = summarise_methods(candidates, measures, scored)
    assert list(darker.scores) == ["l1", "l1-masked", "brightness"]
    assert darker.scores["brightness"] == Summary(pytest.approx(2.5), None, None, 12)
    assert real.scores["brightness"].mean == 0


def test_a_failure_names_candidate_and_pair(studio) -> None:
    source = Painted(studio, "a")
    made = [Pair(source, Painted(studio, name), group="a") for name in ("fine", "bad")]
    measures = Measures((l1_measure(),))
    with (
        Scorer([Darker()], measures, FRAMING, workers=1) as scorer,
        pytest.raises(RenderError, match="darker failed on a__bad: out of memory"),
    ):
        scorer.score(PairList("painted", made, ""))


def test_pictures_are_drawn_again_in_any_order(pairs: PairList) -> None:
    chosen = [pairs[8], pairs[1], pairs[11]]
    with Scorer([TargetCandidate()], Measures(()), FRAMING, workers=1) as scorer:
        drawn = scorer.pictures(chosen)
    for pair, pictures in zip(chosen, drawn, strict=True):
        np.testing.assert_array_equal(pictures.target.rgb, pair.target.load().rgb)
        np.testing.assert_array_equal(pictures.results[0], pair.target.load().rgb)
    assert chosen[0].source.loads == 1
