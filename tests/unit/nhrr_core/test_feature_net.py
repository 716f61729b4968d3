from __future__ import annotations

from pathlib import Path

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nhrr_core import FeatureNet


def small(**changes: int) -> FeatureNet:
    return FeatureNet(**{"inputs": 4, "outputs": 16, "width": 2, **changes}).eval()


def convolution(inputs: int, outputs: int, side: int) -> int:
    return inputs * outputs * side**2


def block(inputs: int, outputs: int) -> int:
    """Parameters of two 3x3 convolutions without bias, each with batch normalisation."""
    return convolution(inputs, outputs, 3) + convolution(outputs, outputs, 3) + 4 * outputs


@pytest.mark.parametrize("side", [16, 32, 80])
@pytest.mark.parametrize(("inputs", "outputs"), [(3, 3), (4, 16)])
def test_shape(inputs: int, outputs: int, side: int) -> None:
    network = small(inputs=inputs, outputs=outputs)
    assert network(torch.rand(2, inputs, side, side)).shape == (2, outputs, side, side)


def test_a_256_texture_reaches_16_x_16_in_the_middle() -> None:
    with torch.device("meta"):
        network = FeatureNet(inputs=4, outputs=16, width=64)
        sizes: list[tuple[int, ...]] = []
        for module in [network.entry, *network.down, *network.up]:
            module.register_forward_hook(lambda _, __, out: sizes.append(tuple(out.shape[1:])))
        out = network(torch.rand(1, 4, 256, 256))
    assert sizes == [
        (64, 256, 256),
        (128, 128, 128),
        (256, 64, 64),
        (512, 32, 32),
        (512, 16, 16),
        (256, 32, 32),
        (128, 64, 64),
        (64, 128, 128),
        (64, 256, 256),
    ]
    assert out.shape == (1, 16, 256, 256)


@pytest.mark.parametrize("width", [64, 32])
def test_parameter_count(width: int) -> None:
    with torch.device("meta"):
        network = FeatureNet(inputs=4, outputs=16, width=width)
    w = width
    down = block(4, w) + block(w, 2 * w) + block(2 * w, 4 * w) + block(4 * w, 8 * w)
    down += block(8 * w, 8 * w)
    up = block(16 * w, 4 * w) + block(8 * w, 2 * w) + block(4 * w, w) + block(2 * w, w)
    exit_ = convolution(w, 16, 1) + 16
    assert sum(p.numel() for p in network.parameters()) == down + up + exit_


def test_up_blocks_read_the_bilinear_double_and_the_skip() -> None:
    network = small()
    outputs: dict[str, Tensor] = {}
    inputs: dict[str, Tensor] = {}

    def watch(name: str, module: nn.Module) -> None:
        def hook(_: nn.Module, args: tuple[Tensor], out: Tensor) -> None:
            inputs[name], outputs[name] = args[0].clone(), out.clone()

        module.register_forward_hook(hook)

    watch("entry", network.entry)
    for i in range(4):
        watch(f"down{i}", network.down[i])
        watch(f"up{i}", network.up[i])
    network(torch.rand(1, 4, 32, 32))
    below, skips = "down3", ["down2", "down1", "down0", "entry"]
    for i, skip in enumerate(skips):
        double = F.interpolate(outputs[below], scale_factor=2.0, mode="bilinear")
        torch.testing.assert_close(inputs[f"up{i}"], torch.cat([double, outputs[skip]], dim=1))
        below = f"up{i}"
    torch.testing.assert_close(inputs["down0"], F.max_pool2d(outputs["entry"], 2))
    torch.testing.assert_close(inputs["down3"], F.max_pool2d(outputs["down2"], 2))


def test_output_is_not_squashed() -> None:
    """Features are any real number: the last layer is a bare 1x1 convolution."""
    network = small()
    with torch.no_grad():
        assert isinstance(network.exit, nn.Conv2d) and network.exit.bias is not None
        network.exit.bias.fill_(-100.0)
        assert network(torch.rand(1, 4, 16, 16)).max() < -50


def test_gradient_reaches_every_parameter_and_the_texture() -> None:
    network = small().train()
    texture = torch.rand(2, 4, 32, 32, requires_grad=True)
    network(texture).square().mean().backward()
    assert texture.grad is not None and texture.grad.abs().sum() > 0
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None and parameter.grad.isfinite().all(), name
        assert parameter.grad.abs().sum() > 0, name


def test_one_end_of_the_texture_sees_the_other() -> None:
    """The middle sees all: completing an unseen back takes the front."""
    network = small(width=4).double()
    texture = torch.rand(1, 4, 64, 64, dtype=torch.float64, requires_grad=True)
    network(texture)[0, :, 0, 0].sum().backward()
    assert texture.grad is not None
    assert (texture.grad[0, :, :48, :48].abs().sum(0) > 0).float().mean() > 0.9


@pytest.mark.filterwarnings("ignore:.isinstance.treespec, LeafSpec:FutureWarning")
@pytest.mark.usefixtures("unchecked")
def test_onnx_export_equals_torch(tmp_path: Path) -> None:
    onnxruntime = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnxscript")
    network, texture = small(), torch.rand(1, 4, 32, 32)
    path = tmp_path / "feature_net.onnx"
    program = torch.onnx.export(
        network, (texture,), dynamo=True, verbose=False, input_names=["texture"]
    )
    assert program is not None
    program.save(path)
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    (out,) = session.run(None, {"texture": texture.numpy()})
    with torch.no_grad():
        torch.testing.assert_close(torch.from_numpy(out), network(texture), rtol=0, atol=1e-5)
