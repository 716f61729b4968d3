"""What readers preferred, how sure that is, and how far they agree."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from motion_transfer.evaluation.study.answers import Answer, Reader
from motion_transfer.evaluation.study.key import Key
from motion_transfer.evaluation.study.statistics import (
    Share,
    bootstrap_share,
    krippendorff_alpha,
    observed_agreement,
)

Label = str
Tally = dict[str, dict[Label, int]]
"""Votes for each of two methods, by item."""


@dataclass(frozen=True)
class Preference:
    """How often one method was preferred to another.

    Attributes:
        votes: For `method`, with Wilson's interval.
        readers_interval: The same over other readers; None for a single one.
        items_won, items_lost, items_tied: By the majority of votes on each item, which is what the
            paper reports.
        tally: Each item's votes.
    """

    question: str
    method: Label
    other: Label
    votes: Share
    readers_interval: tuple[float, float] | None
    items_won: int
    items_lost: int
    items_tied: int
    tally: Tally


@dataclass(frozen=True)
class Agreement:
    """How far readers agree on one question.

    Attributes:
        observed: The share of pairs of readers who chose alike; by chance half. None without pairs.
        alpha: Krippendorff's.
        repeated: How often a reader chose the same view again, its side swapped.
        left: How often the left view was chosen.
    """

    question: str
    observed: float | None
    alpha: float | None
    repeated: Share | None
    left: Share


@dataclass(frozen=True)
class Crossing:
    """Items on which the majority preferred one method in one question, another in the other.

    Attributes:
        counts: How many items, by the methods preferred in (`realism`, `identity`).
    """

    method: Label
    other: Label
    counts: dict[tuple[Label, Label], int]


@dataclass(frozen=True)
class ReaderFacts:
    """What one reader's answers look like.

    Attributes:
        seconds: The median a pair, over all its questions.
        repeated: How often the same view was chosen again, over all questions.
        left: How often the left one was chosen.
    """

    label: str
    signed: str
    screen: str
    seconds: float
    repeated: Share | None
    left: Share


@dataclass(frozen=True)
class Scores:
    """All that is found in readers' answers."""

    study: str
    preferences: list[Preference]
    agreements: list[Agreement]
    crossings: list[Crossing]
    readers: list[ReaderFacts]


def score_answers(readers: Sequence[Reader], key: Key) -> Scores:
    """Count answers that were checked, of one reader at least.

    Repeated pairs tell of a reader's steadiness only: they are no votes.
    """
    preferences = [
        preference
        for question in key.questions
        for method, other in key.pairs
        if (preference := _prefer(readers, key, question, method, other)) is not None
    ]
    return Scores(
        study=key.study,
        preferences=preferences,
        agreements=[_agree(readers, question) for question in key.questions],
        crossings=list(_cross(preferences)),
        readers=[_describe(reader) for reader in readers],
    )


def _prefer(
    readers: Sequence[Reader], key: Key, question: str, method: Label, other: Label
) -> Preference | None:
    """Count the votes between two methods; None where there are none."""
    tally: Tally = defaultdict(lambda: {method: 0, other: 0})
    by_reader = []
    for reader in readers:
        votes: Counter[Label] = Counter()
        for answer in _first(reader):
            comparison = key.comparisons[answer.comparison]
            if {comparison.a, comparison.b} == {method, other}:
                label = comparison.a if answer.chosen(question) == "a" else comparison.b
                votes[label] += 1
                tally[comparison.item][label] += 1
        if votes:
            by_reader.append((votes[method], votes.total()))
    if not by_reader:
        return None
    counts, totals = np.array(by_reader).T
    share = Share.of(int(counts.sum()), int(totals.sum()))
    assert share is not None
    signs = Counter(np.sign(votes[method] - votes[other]) for votes in tally.values())
    return Preference(
        question=question,
        method=method,
        other=other,
        votes=share,
        readers_interval=bootstrap_share(counts, totals),
        items_won=signs[1],
        items_lost=signs[-1],
        items_tied=signs[0],
        tally=dict(tally),
    )


def _agree(readers: Sequence[Reader], question: str) -> Agreement:
    """Measure agreement on views, not methods: all may prefer one, and chance is still a half."""
    units: dict[str, list[str]] = defaultdict(list)
    for reader in readers:
        for answer in _first(reader):
            units[answer.comparison].append(answer.chosen(question))
    answers = [answer for reader in readers for answer in reader.answers]
    lefts = sum(answer.choices[question] == "left" for answer in answers)
    left = Share.of(lefts, len(answers))
    assert left is not None
    return Agreement(
        question=question,
        observed=observed_agreement(list(units.values())),
        alpha=krippendorff_alpha(list(units.values())),
        repeated=_repeat(readers, [question]),
        left=left,
    )


def _cross(preferences: Sequence[Preference]) -> Iterable[Crossing]:
    """Compare the two questions' majorities, item by item, as the paper does."""
    by_question = {(each.question, each.method, each.other): each for each in preferences}
    for (question, method, other), realism in by_question.items():
        identity = by_question.get(("identity", method, other))
        if question != "realism" or identity is None:
            continue
        counts: Counter[tuple[Label, Label]] = Counter()
        for item, votes in realism.tally.items():
            winners = _winner(votes), _winner(identity.tally[item])
            if winners[0] and winners[1]:
                counts[winners[0], winners[1]] += 1
        yield Crossing(method, other, dict(counts))


def _winner(votes: dict[Label, int]) -> Label | None:
    """Whom most preferred; None for a tie."""
    return None if len(set(votes.values())) == 1 else max(votes, key=lambda label: votes[label])


def _describe(reader: Reader) -> ReaderFacts:
    questions = reader.questions
    choices = [answer.choices[name] for answer in reader.answers for name in questions]
    left = Share.of(choices.count("left"), len(choices))
    assert left is not None
    return ReaderFacts(
        label=reader.label,
        signed=reader.signed,
        screen=reader.screen,
        seconds=median(answer.ms for answer in reader.answers) / 1000,
        repeated=_repeat([reader], questions),
        left=left,
    )


def _repeat(readers: Iterable[Reader], questions: Sequence[str]) -> Share | None:
    """Tell how often readers chose the same view again; None where nothing was repeated."""
    same = total = 0
    for reader in readers:
        before = {answer.comparison: answer for answer in _first(reader)}
        for answer in reader.answers:
            if not answer.repeat:
                continue
            for question in questions:
                total += 1
                same += answer.chosen(question) == before[answer.comparison].chosen(question)
    return Share.of(same, total)


def _first(reader: Reader) -> list[Answer]:
    """The answers that are votes."""
    return [answer for answer in reader.answers if not answer.repeat]
