"""Measures of parts of the picture: which pixels they look at, and where they look at none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from motion_transfer.evaluation import region_measures
from motion_transfer.evaluation.framing import PairPictures, TargetFrame
from motion_transfer.evaluation.region_measures import (
    CheckerboardMeasure,
    HeadMeasure,
    HiddenMeasure,
)
from motion_transfer.training.metrics import flat_windows, lattice_energy


class Colours(nn.Module):
    """A network whose only features are the colours of pixels."""

    def forward(self, image: torch.Tensor) -> list[torch.Tensor]:
        return [image + 2]


def pair_of(source_iuv: np.ndarray, iuv: np.ndarray, rgb: np.ndarray, *results: np.ndarray):
    return PairPictures(rgb, source_iuv, TargetFrame(rgb, iuv, iuv[..., 0] > 0), results)


def test_hidden_and_visible_look_at_their_pixels(studio) -> None:
    iuv = studio.iuv(scale=2, size=(200, 140))
    rgb = studio.dress(iuv)
    trunk, leg = iuv[..., 0] == 2, iuv[..., 0] == 9
    wrong_trunk, wrong_leg = rgb.copy(), rgb.copy()
    wrong_trunk[trunk], wrong_leg[leg] = (0, 250, 0), (0, 250, 0)
    source_iuv = studio.iuv(parts=(2, 23))
    shown = pair_of(source_iuv, iuv, rgb, rgb, wrong_trunk, wrong_leg)
    measure = HiddenMeasure(Colours())
    assert [column.name for column in measure.columns] == ["visible", "hidden"]
    same, trunk_off, leg_off = measure.measure(shown)
    assert same == (0, 0)
    assert trunk_off[0] > 0.1 and trunk_off[1] < 0.1 * trunk_off[0]
    assert leg_off[1] > 0.01 and leg_off[0] == 0


def test_what_is_all_shown_has_nothing_hidden(shown: PairPictures) -> None:
    for visible, hidden in HiddenMeasure(Colours()).measure(shown):
        assert visible >= 0 and math.isnan(hidden)


def test_the_head_is_looked_at_alone_and_enlarged(studio) -> None:
    iuv = studio.iuv(size=(128, 128))
    rgb = studio.dress(iuv)
    head, trunk = rgb.copy(), rgb.copy()
    head[np.isin(iuv[..., 0], (23, 24))] = (0, 0, 250)
    trunk[(iuv[..., 0] == 2) & (np.arange(128)[:, None] > 30)] = (0, 0, 250)
    seen = []

    class Looking(Colours):
        def forward(self, image: torch.Tensor) -> list[torch.Tensor]:
            seen.append(image)
            return super().forward(image)

    measure = HeadMeasure(Looking())
    same, head_off, trunk_off = measure.measure(pair_of(iuv, iuv, rgb, rgb, head, trunk))
    assert seen[0].shape == (4, 3, 128, 128)
    assert same[0] == trunk_off[0] == 0
    assert head_off[0] > 0.1
    assert all(math.isnan(hidden) for _, hidden in (same, head_off, trunk_off))


def test_no_head_and_a_small_one_have_no_number(studio) -> None:
    iuv = studio.iuv(parts=(2,))
    rgb = studio.dress(iuv)
    assert np.isnan(HeadMeasure(Colours()).measure(pair_of(iuv, iuv, rgb, rgb))).all()
    iuv[:10, :11, 0] = 23  # 110 px
    assert np.isnan(HeadMeasure(Colours()).measure(pair_of(iuv, iuv, rgb, rgb))).all()
    iuv[:11, :11, 0] = 23
    assert HeadMeasure(Colours()).measure(pair_of(iuv, iuv, rgb, rgb))[0][0] == 0


@pytest.mark.parametrize(("share", "is_hidden"), [(0.0, True), (0.1, True), (0.2, False)])
def test_heads_are_hidden_whose_face_the_source_does_not_show(
    studio, monkeypatch, share: float, is_hidden: bool
) -> None:
    iuv = studio.iuv(scale=2, size=(200, 140))
    rgb = studio.dress(iuv)
    face = np.zeros(iuv.shape[:2], bool)
    face[10:20, 50:60] = True
    known = np.zeros_like(face)
    known[10 : 10 + round(10 * share), 50:60] = True
    monkeypatch.setattr(region_measures, "mark_face", lambda _iuv, _table: face)
    monkeypatch.setattr(region_measures, "shown_pixels", lambda _source, _target: known)
    ((head, hidden),) = HeadMeasure(Colours()).measure(pair_of(iuv, iuv, rgb, 255 - rgb))
    assert head > 0
    assert hidden == head if is_hidden else math.isnan(hidden)


def test_the_checkerboard_is_looked_for_inside_the_person(studio) -> None:
    iuv = studio.iuv(scale=3, size=(320, 240))
    rgb = studio.dress(iuv)
    result = rgb.astype(int)
    result += 4 * (-1) ** np.arange(240)[:, None]
    result = result.clip(0, 255).astype(np.uint8)
    shown = pair_of(iuv, iuv, rgb, rgb, result)
    measure = CheckerboardMeasure()
    names = [column.name for column in measure.columns]
    assert names == ["checkerboard-2", "checkerboard-4", "checkerboard-8"]
    plain, striped = measure.measure(shown)
    assert plain == pytest.approx((0, 0, 0), abs=1e-6)
    assert striped == lattice_energy(result, flat_windows(rgb, iuv[..., 0] > 0))
    assert striped == pytest.approx((16, 0, 0), abs=0.01)
    small = replace(shown, target=TargetFrame(rgb, np.zeros_like(iuv), shown.target.mask))
    assert np.isnan(measure.measure(small)).all()
