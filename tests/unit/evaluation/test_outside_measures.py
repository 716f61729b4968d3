"""Measures of other people's packages, which small stand-ins replace."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest
import torch
from torch import nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.evaluation.framing import PairPictures
from motion_transfer.evaluation.measures import Measures, choose_measures
from motion_transfer.evaluation.outside_measures import INCEPTION_FILE, FidMeasure, LpipsMeasure


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
def test_lpips_takes_its_backbone_from_a_file(studio, shown: PairPictures) -> None:
    path = studio.folder / "alex.pth"
    torch.save(backbone(), path)
    measure = LpipsMeasure(path)
    (column,) = measure.columns
    assert column.name == "lpips"
    assert column.definition.startswith("LPIPS v0.1 (alex); weights sha256 ")
    found = measure.measure(shown)
    assert found[0] == pytest.approx((0,), abs=1e-6)  # instruction sets round in their own ways
    assert found == LpipsMeasure(path).measure(shown)
    assert min(found[1:]) > (0,)
    assert choose_measures(["lpips"], weights={"lpips": path}).packages[-1] == "lpips"


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
    path = studio.folder / INCEPTION_FILE
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
    (studio.folder / INCEPTION_FILE).write_bytes(b"weights")
    measure = FidMeasure(studio.folder / INCEPTION_FILE)
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (8, 8, 3), np.uint8) for _ in range(6)]
    assert (Measures((measure,)).pairs, Measures((measure,)).sets) == ((), (measure,))
    weights = {"fid": studio.folder / INCEPTION_FILE}
    assert choose_measures(["fid"], weights=weights).packages[-1] == "clean-fid"
    first = measure.features(images)
    np.testing.assert_allclose(first, [image.mean((0, 1)) for image in images], rtol=1e-5)
    assert measure.distance(first, first) == pytest.approx(0, abs=1e-9)
    shifted = [vector + 3 for vector in first]
    assert measure.distance(first, shifted) == pytest.approx(27)
    assert np.isnan(measure.distance(first[:1], first[:1]))
