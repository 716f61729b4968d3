"""The fast form of RenderNet against the plain one, which is the specification."""

from fractions import Fraction

import pytest
import torch
import torch.nn.functional as F

from nhrr_core import FastRenderNet, RenderNet
from nhrr_core.winograd import TILE, cook_toom, transform_weight, winograd_convolution


def small_net(
    *,
    outputs: int = 3,
    down_blocks: int = 3,
    residual_blocks: int = 2,
    shortcut: bool = False,
    even: bool = False,
) -> RenderNet:
    torch.manual_seed(0)
    return RenderNet(
        inputs=5,
        outputs=outputs,
        width=4,
        down_blocks=down_blocks,
        residual_blocks=residual_blocks,
        shortcut=shortcut,
        even=even,
    ).eval()


def test_cook_toom_is_exact_in_rationals() -> None:
    output, weight, signal = cook_toom()
    taps = [Fraction(3), Fraction(-1), Fraction(7)]
    values = [Fraction(n * n - 5, n + 1) for n in range(TILE + 2)]
    g = [sum(c * t for c, t in zip(row, taps, strict=True)) for row in weight]
    b = [sum(c * v for c, v in zip(row, values, strict=True)) for row in signal]
    products = [x * y for x, y in zip(g, b, strict=True)]
    got = [sum(c * p for c, p in zip(row, products, strict=True)) for row in output]
    assert got == [sum(taps[k] * values[i + k] for k in range(3)) for i in range(TILE)]


@pytest.mark.parametrize(("height", "width"), [(4, 4), (8, 12)])
def test_winograd_convolution_equals_conv2d(height: int, width: int) -> None:
    torch.manual_seed(0)
    signal, weight = torch.randn(2, 6, height + 2, width + 2), torch.randn(7, 6, 3, 3)
    fast = winograd_convolution(signal.permute(0, 2, 3, 1), transform_weight(weight, torch.float32))
    torch.testing.assert_close(
        fast.permute(0, 3, 1, 2), F.conv2d(signal, weight), atol=1e-4, rtol=1e-4
    )


@pytest.mark.parametrize("winograd", [True, False])
@pytest.mark.parametrize("shortcut", [True, False])
@pytest.mark.parametrize(("outputs", "down_blocks"), [(3, 3), (4, 2)])
def test_same_function_in_float32(
    winograd: bool, shortcut: bool, outputs: int, down_blocks: int
) -> None:
    # even where the shortcut is, as in `lite`
    net = small_net(outputs=outputs, down_blocks=down_blocks, shortcut=shortcut, even=shortcut)
    fast = FastRenderNet(net, dtype=torch.float32, winograd=winograd, compiled=False)
    features = torch.randn(2, 5, 64, 96)
    with torch.inference_mode():
        torch.testing.assert_close(fast(features), net(features), atol=1e-4, rtol=0)


@pytest.mark.parametrize("winograd", [True, False])
def test_bfloat16_stays_within_the_stated_tolerance(winograd: bool) -> None:
    net = small_net()
    for parameter in net.parameters():
        if parameter.ndim == 4:
            torch.nn.init.normal_(parameter, 0, 0.02)
    fast = FastRenderNet(net, dtype=torch.bfloat16, winograd=winograd, compiled=False)
    features = torch.randn(1, 5, 64, 64)
    with torch.inference_mode():
        error = (fast(features) - net(features)).abs()
    assert 0 < error.mean() < 0.025


@pytest.mark.usefixtures("unchecked")
def test_compiled_equals_uncompiled() -> None:
    net = small_net(down_blocks=1, residual_blocks=1, shortcut=True)
    forms = [
        FastRenderNet(net, dtype=torch.float32, winograd=True, compiled=compiled)
        for compiled in (True, False)
    ]
    features = torch.randn(2, 5, 32, 32)
    with torch.inference_mode():
        torch.testing.assert_close(forms[0](features), forms[1](features), atol=1e-4, rtol=0)


def test_samples_do_not_depend_on_their_batch() -> None:
    fast = FastRenderNet(small_net(), dtype=torch.float32, winograd=True, compiled=False)
    features = torch.randn(3, 5, 32, 32)
    with torch.inference_mode():
        together = fast(features)
        alone = torch.cat([fast(sample) for sample in features.split(1)])
    torch.testing.assert_close(together, alone, atol=1e-5, rtol=0)


def test_weights_are_copies() -> None:
    net = small_net()
    fast = FastRenderNet(net, dtype=torch.float32, winograd=True, compiled=False)
    features = torch.randn(1, 5, 32, 32)
    with torch.inference_mode():
        before = fast(features)
        for parameter in net.parameters():
            parameter.zero_()
        assert torch.equal(fast(features), before)


@pytest.mark.parametrize(("winograd", "multiple"), [(True, 32), (False, 8)])
def test_states_what_sizes_it_takes(winograd: bool, multiple: int) -> None:
    fast = FastRenderNet(small_net(), dtype=torch.float32, winograd=winograd, compiled=False)
    assert fast.multiple == multiple
