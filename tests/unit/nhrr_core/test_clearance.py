"""Clearance: measured in pixels of the photo, kept in lengths of the body, read in any image."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from nhrr_core import unfold_clearance
from nhrr_core.clearance import (
    CLEARANCE_SIZE,
    UNIT_TEXELS,
    detail_share,
    pixels_per_texel,
    spread_clearance,
)


@pytest.mark.parametrize("side", [40, 80, 160])
def test_pixels_per_texel_grow_with_the_body(plain_charts: Tensor, ramp, side: int) -> None:
    """U from 60 to 190 of 256 crosses 66 columns of the 128, and V as many rows."""
    iuv = ramp(2, side, border=5)
    hit = min(side, 66)
    assert pixels_per_texel(iuv, plain_charts).item() == pytest.approx(side / hit, rel=0.02)


def test_each_image_has_a_scale_of_its_own(plain_charts: Tensor, ramp) -> None:
    large, small = ramp(2, 160), ramp(2, 80, border=40)
    nobody = torch.zeros_like(large)
    scales = pixels_per_texel(torch.cat([large, small, nobody]), plain_charts)
    alone = [pixels_per_texel(iuv, plain_charts) for iuv in (large, small, nobody)]
    assert torch.equal(scales, torch.cat(alone))
    assert scales[2] == 1


def test_a_length_of_the_body_is_the_same_in_every_photo(plain_charts: Tensor, ramp) -> None:
    unfolded = []
    for scale in (1, 2):
        iuv = ramp(2, 100 * scale, border=10)
        clearance = torch.full((1, 1, *iuv.shape[2:]), 6.0 * scale)
        unfolded.append(unfold_clearance(clearance, iuv[:, :1] > 0, iuv, plain_charts))
    texels = 6 / pixels_per_texel(ramp(2, 100), plain_charts)
    for clearance, known in (one[0] for one in unfolded):
        assert clearance[known > 0].numpy() == pytest.approx(texels.item() / UNIT_TEXELS, rel=0.02)
        assert not clearance[known == 0].any()


def test_only_what_was_measured_counts(plain_charts: Tensor, ramp) -> None:
    iuv = ramp(2, 66)
    measured = torch.zeros(1, 1, 66, 66, dtype=torch.bool)
    measured[..., :5] = True
    known = unfold_clearance(torch.ones(1, 1, 66, 66), measured, iuv, plain_charts)[0, 1]
    assert known.shape == (CLEARANCE_SIZE, CLEARANCE_SIZE)
    columns = known.any(0).nonzero()
    assert columns.min() == 30
    assert columns.max() == 34
    nothing = unfold_clearance(torch.ones(1, 1, 66, 66), measured & False, iuv, plain_charts)
    assert not nothing.any()


def test_the_map_says_whether_anything_was_measured() -> None:
    filled, known = torch.rand(2, 1, 8, 8), torch.zeros(2, 1, 8, 8)
    known[0, 0, 3, 3] = 1
    spread = spread_clearance(filled, known, 32)
    assert torch.equal(spread[:, :1, ::4, ::4], filled)
    assert spread[0, 1].unique().tolist() == [1]
    assert spread[1, 1].unique().tolist() == [0]


def test_the_smaller_a_body_the_less_of_its_detail_is_drawn() -> None:
    """Texels of 1024 from pixel to pixel: 2, 3, 4.5, 6 and 8."""
    scales = 8 / torch.tensor([2, 3, 4.5, 6, 8])
    assert torch.allclose(detail_share(scales, 1024), torch.tensor([1, 1, 0.5, 0, 0]))
    assert torch.equal(detail_share(scales, 256), torch.ones(5)), "of a coarser one, all"
