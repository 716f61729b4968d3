"""The sheet: which pairs it shows, and where."""

from __future__ import annotations

import math

import numpy as np
import pytest

from motion_transfer.evaluation.evaluate import (
    CELL_PX,
    GAP_PX,
    LINE_PX,
    choose_rows,
    draw_sheet,
)
from motion_transfer.evaluation.framing import PairPictures, TargetFrame
from motion_transfer.evaluation.measures import Column
from motion_transfer.evaluation.scoring import PairScores
from motion_transfer.training.pairs import Pair
from motion_transfer.training.pictures import PhotoFile


@pytest.mark.parametrize("better", ["lower", "higher"])
def test_worst_median_and_best_rows(better: str) -> None:
    values = [float(value) for value in np.random.default_rng(0).permutation(100)]
    values[7] = math.nan
    rows = choose_rows(values, better)
    shown = [values[index] for _, index in rows]
    assert [word for word, _ in rows] == ["worst"] * 3 + ["median"] * 3 + ["best"] * 3
    known = sorted(value for value in values if not math.isnan(value))
    expected = known[:3] + known[48:51] + known[-3:]
    assert shown == (expected[::-1] if better == "lower" else expected)


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_few_pairs_are_all_shown_once(count: int) -> None:
    rows = choose_rows([float(n) for n in range(count)], "higher")
    assert [index for _, index in rows] == list(range(count))
    assert rows[0][0] == "worst"
    assert count < 2 or rows[-1][0] == "best"


def test_pairs_without_any_number_are_shown_in_their_order() -> None:
    assert choose_rows([math.nan] * 2, "lower") == [("worst", 0), ("best", 1)]


def test_pictures_stand_in_their_columns(tmp_path) -> None:
    def flat(level: int) -> np.ndarray:
        return np.full((128, 64, 3), level, np.uint8)

    mask = np.ones((128, 64), bool)
    target = TargetFrame(flat(20), flat(0), mask)
    pictures = PairPictures(flat(10), flat(0), target, [flat(30), flat(40)])
    pair = Pair(PhotoFile("a.png", tmp_path), PhotoFile("b" * 80 + ".png", tmp_path), group="a")
    labels = ["first", "a label that is much too long for its column" * 3]
    entry = PairScores(pair, [{"ssim": 0.1}, {"ssim": 0.2}], [])
    column = Column("ssim", "higher", 1, "SSIM")
    sheet = draw_sheet(labels, column, [("worst", entry), ("best", entry)], [pictures] * 2)
    assert sheet.shape == (LINE_PX + 2 * (LINE_PX + CELL_PX), 4 * (CELL_PX + GAP_PX), 3)
    middle = 2 * LINE_PX + CELL_PX // 2
    centres = [column * (CELL_PX + GAP_PX) + CELL_PX // 2 for column in range(4)]
    assert [sheet[middle, x, 0] for x in centres] == [10, 20, 30, 40]
    assert (sheet[:, CELL_PX : CELL_PX + GAP_PX] == 255).all()  # no word runs into the next
    assert (sheet[:LINE_PX] < 128).any()
