"""Votes counted by hand."""

from __future__ import annotations

import pytest

from motion_transfer.evaluation.study.scoring import score_answers


def test_votes_shares_and_majorities(key, reader) -> None:
    """Three readers of four items; in realism two always take ours, one only on item 0."""
    loyal = [reader(lambda *_: "ours", number) for number in (1, 2)]
    picky = reader(lambda _question, item: "ours" if item == "item 0" else "theirs", 3)
    scores = score_answers([*loyal, picky], key)
    realism = scores.preferences[0]
    assert (realism.question, realism.method, realism.other) == ("realism", "ours", "theirs")
    assert (realism.votes.count, realism.votes.total) == (9, 12)
    assert (realism.items_won, realism.items_lost, realism.items_tied) == (4, 0, 0)
    assert realism.tally["item 0"] == {"ours": 3, "theirs": 0}
    assert realism.tally["item 1"] == {"ours": 2, "theirs": 1}
    # 1, 1 and 1/4 of each: the worst draw of three is three times the third
    assert realism.readers_interval == pytest.approx((0.25, 1))


def test_who_was_asked_twice_votes_once(key, reader) -> None:
    fickle = reader(lambda *_: "ours", again=lambda *_: "theirs")
    scores = score_answers([fickle], key)
    assert scores.preferences[0].votes.count == scores.preferences[0].votes.total == 4
    agreement = scores.agreements[0]
    assert agreement.repeated is not None
    assert (agreement.repeated.count, agreement.repeated.total) == (0, 1)
    assert scores.readers[0].repeated is not None
    assert scores.readers[0].repeated.total == 2  # of both questions
    assert scores.readers[0].seconds == 2


def test_agreement_is_on_views_and_not_on_methods(key, reader) -> None:
    """All prefer one method: no disagreement, and chance is still known."""
    scores = score_answers([reader(lambda *_: "ours", number) for number in (1, 2)], key)
    assert (scores.agreements[0].observed, scores.agreements[0].alpha) == (1, 1)
    opposed = [reader(lambda *_: "ours", 1), reader(lambda *_: "theirs", 2)]
    agreement = score_answers(opposed, key).agreements[0]
    # 8 pairable votes, half of them a: D_o = 1, D_e = 2 * 4 * 4 / (8 * 7)
    assert (agreement.observed, agreement.alpha) == (0, pytest.approx(1 - 7 / 4))


def test_a_reader_who_always_takes_the_left(key, reader) -> None:
    """`a` stands left, and is ours in every other item; the repeat has its sides swapped."""
    left = reader(lambda _question, item: "ours" if int(item[-1]) % 2 else "theirs", 1)
    scores = score_answers([left], key)
    assert scores.preferences[0].votes.count == 2
    assert (scores.agreements[0].left.count, scores.agreements[0].left.total) == (4, 5)


def test_both_questions_item_by_item(key, reader) -> None:
    """The paper's last two sentences: more realistic here, more alike there."""

    def choose(question: str, item: str) -> str:
        return "theirs" if question == "identity" and item == "item 2" else "ours"

    scores = score_answers([reader(choose, number) for number in (1, 2, 3)], key)
    assert scores.crossings[0].counts == {("ours", "ours"): 3, ("ours", "theirs"): 1}


def test_a_tie_is_nobodys(key, reader) -> None:
    scores = score_answers([reader(lambda *_: "ours", 1), reader(lambda *_: "theirs", 2)], key)
    realism = scores.preferences[0]
    assert (realism.items_won, realism.items_lost, realism.items_tied) == (0, 0, 4)
    assert scores.crossings[0].counts == {}
