"""What the IUV network's answers cost in training, and how they are scored."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from estimate_stubs import iuv_logits

from motion_transfer.estimate.iuv.network import PARTS
from motion_transfer.training.iuv.trainer import OTHER_SIDE, iuv_loss, score_iuv
from nhrr_core import PART_NAMES


def test_loss_is_lowest_where_the_answer_is_right() -> None:
    parts = np.random.default_rng(1).integers(0, PARTS, (128, 128))
    true = np.full((1, 128, 128, 3), 51, np.uint8)
    true[0, ..., 0] = parts
    iuv = torch.from_numpy(true)
    right = iuv_loss(iuv_logits(parts, 0.2), iuv)
    assert right["total"] < 1e-3
    assert iuv_loss(iuv_logits(np.roll(parts, 1, 0), 0.2), iuv)["parts"] > 1
    assert iuv_loss(iuv_logits(parts, 0.3), iuv)["uv"] == pytest.approx(0.1, abs=1e-4)


def test_scores() -> None:
    true = np.zeros((4, 10, 3), np.uint8)
    true[:, :8] = 2, 100, 100
    found = true.copy()
    found[:, 8] = 2, 100, 100
    found[:, 0] = 1, 100, 100
    found[:, 1:5, 1] += 51
    score = score_iuv(found, true)
    assert score.iou == pytest.approx(8 / 9)
    assert score.part_agreement == pytest.approx(7 / 8)
    assert score.turned == pytest.approx(1 / 8)
    assert score.uv_error == 0
    assert score_iuv(true, true).swapped == 0
    assert np.isnan(score_iuv(true * 0, true).part_agreement)


def test_the_other_side_is_the_part_of_that_name() -> None:
    assert np.array_equal(OTHER_SIDE[OTHER_SIDE], np.arange(PARTS))
    for part in range(1, PARTS):
        swapped = (
            PART_NAMES[part].replace("left", "?").replace("right", "left").replace("?", "right")
        )
        assert PART_NAMES[OTHER_SIDE[part]] == swapped
