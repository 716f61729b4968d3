from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from nhrr_core import ModelConfig, RenderNet
from nhrr_core.config import RenderSizes
from nhrr_core.render_net import ResidualBlock, UpConvolution, bilinear_kernel, even_kernel


def small(**changes: Any) -> RenderNet:
    sizes = {"inputs": 5, "outputs": 3, "width": 4, "down_blocks": 2, "residual_blocks": 2}
    sizes |= {"shortcut": False, "even": False, "bilinear": False}
    return RenderNet(RenderSizes(**{**sizes, **changes})).eval()


def preset(name: str) -> RenderNet:
    """The preset's network, without storage."""
    config = ModelConfig.preset(name)
    with torch.device("meta"):
        return RenderNet(config.render_sizes)


@pytest.mark.parametrize(("name", "millions"), [("paper", 31.5), ("lite", 7.9)])
def test_parameter_count(name: str, millions: float) -> None:
    count = sum(p.numel() for p in preset(name).parameters())
    assert round(count / 1e6, 1) == millions


@pytest.mark.parametrize(("name", "giga"), [("paper", 80.3), ("lite", 23.9)])
def test_floating_point_operations(name: str, giga: float) -> None:
    """At 256 x 256; a multiplication with its addition counts as two."""
    with FlopCounterMode(display=False) as counter:
        inputs = ModelConfig.preset(name).render_inputs
        preset(name)(torch.empty(1, inputs, 256, 256, device="meta"))
    assert round(counter.get_total_flops() / 1e9, 1) == giga


@pytest.mark.parametrize(("height", "width"), [(16, 16), (16, 24), (40, 16)])
@pytest.mark.parametrize(("inputs", "outputs"), [(16, 3), (6, 4)])
def test_shape_and_range(height: int, width: int, inputs: int, outputs: int) -> None:
    network = small(inputs=inputs, outputs=outputs)
    frame = network(100 * torch.randn(2, inputs, height, width))
    assert frame.shape == (2, outputs, height, width)
    assert frame.min() >= -1 and frame.max() <= 1
    assert frame.std() > 0


@pytest.mark.parametrize("down_blocks", [1, 2, 3, 4])
def test_residual_blocks_work_at_the_lowest_resolution(down_blocks: int) -> None:
    network = small(width=2, down_blocks=down_blocks, residual_blocks=3)
    sizes: list[tuple[int, ...]] = []
    for module in network.modules():
        if isinstance(module, ResidualBlock):
            module.register_forward_hook(lambda _, __, out: sizes.append(tuple(out.shape[1:])))
    network(torch.rand(1, 5, 64, 64))
    side = 64 // 2**down_blocks
    assert sizes == [(2 * 2**down_blocks, side, side)] * 3


def test_layers_are_the_global_generator_s() -> None:
    """Pix2PixHD's order, without the padding between: kernel, stride and channels."""
    convolutions = [
        (type(m).__name__, m.in_channels, m.out_channels, m.kernel_size[0], m.stride[0])
        for m in small(down_blocks=2, residual_blocks=1).modules()
        if isinstance(m, nn.Conv2d | nn.ConvTranspose2d)
    ]
    assert convolutions == [
        ("Conv2d", 5, 4, 7, 1),
        ("Conv2d", 4, 8, 3, 2),
        ("Conv2d", 8, 16, 3, 2),
        ("Conv2d", 16, 16, 3, 1),
        ("Conv2d", 16, 16, 3, 1),
        ("UpConvolution", 16, 8, 3, 2),
        ("UpConvolution", 8, 4, 3, 2),
        ("Conv2d", 4, 3, 7, 1),
    ]


def test_the_shortcut_leads_to_the_last_convolution() -> None:
    plain, network = small(), small(shortcut=True)
    last = network.layers[-2]
    assert isinstance(last, nn.Conv2d) and last.in_channels == 4 + 5
    weights = plain.state_dict()
    name = list(weights)[-2]
    weights[name] = nn.functional.pad(weights[name], (0, 0, 0, 0, 0, 5))
    network.load_state_dict(weights)
    features = torch.rand(2, 5, 16, 24)
    with torch.no_grad():
        assert torch.equal(network(features), plain(features))
        last.weight.zero_()
        assert last.bias is not None
        last.bias.zero_()
        last.weight[1, 4 + 2, 3, 3] = 2.0  # the second output from the third input
        frame = network(features)
    assert torch.allclose(frame[:, 1], (2 * features[:, 2]).tanh())
    assert not frame[:, [0, 2]].any()


def test_residual_block_adds_to_what_it_gets() -> None:
    block = ResidualBlock(3)
    x = torch.rand(1, 3, 8, 8)
    kept = x.clone()
    difference = block(x) - x
    assert torch.equal(x, kept)
    assert difference.abs().sum() > 0
    # The branch ends in instance normalisation: mean 0 and variance 1 in each channel.
    torch.testing.assert_close(difference.mean((2, 3)), torch.zeros(1, 3), rtol=0, atol=1e-5)
    torch.testing.assert_close(
        difference.var((2, 3), unbiased=False), torch.ones(1, 3), rtol=0, atol=1e-2
    )


def test_border_is_reflected() -> None:
    """No rim: normalised constants stay constant up to the border, also before the first norm."""
    network = small()
    first = nn.Sequential(*list(network.layers)[:2])
    out = first(torch.ones(1, 5, 16, 16))
    torch.testing.assert_close(out, out[..., :1, :1].expand_as(out))


def test_images_of_a_batch_do_not_mix() -> None:
    network = small().train()  # instance normalisation has no running statistics
    features = torch.rand(3, 5, 16, 16)
    with torch.no_grad():
        together = network(features)
        alone = torch.cat([network(one[None]) for one in features])
    torch.testing.assert_close(together, alone, rtol=0, atol=1e-5)


def test_gradient_reaches_every_weight_and_the_features() -> None:
    network = small()
    features = torch.rand(1, 5, 16, 16, requires_grad=True)
    (network(features) * torch.rand(1, 3, 16, 16)).sum().backward()
    assert features.grad is not None and features.grad.abs().sum() > 0
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None and parameter.grad.isfinite().all(), name
        if name.endswith("weight"):
            assert parameter.grad.abs().sum() > 0, name


def test_up_convolution_is_the_papers_transposed_one() -> None:
    up = UpConvolution(4, 3, project=None)
    plain = nn.ConvTranspose2d(4, 3, 3, stride=2, padding=1, output_padding=1)
    plain.load_state_dict(up.state_dict())
    x = torch.rand(2, 4, 5, 6)
    assert torch.equal(up(x), plain(x))


def inner(image: torch.Tensor) -> torch.Tensor:
    """Without the border, where the kernel reaches outside."""
    return image[..., 2:-2, 2:-2]


def test_even_up_convolution_leaves_flat_what_is_flat() -> None:
    torch.manual_seed(3)
    flat = torch.rand(1, 4, 1, 1).expand(1, 4, 8, 8)
    with torch.no_grad():
        even, bilinear, free = (
            inner(UpConvolution(4, 3, project=each)(flat))
            for each in (even_kernel, bilinear_kernel, None)
        )
    assert (bilinear - bilinear.mean((2, 3), keepdim=True)).abs().max() < 1e-6
    assert (even - even.mean((2, 3), keepdim=True)).abs().max() < 1e-6
    assert (free - free.mean((2, 3), keepdim=True)).abs().max() > 0.01


def test_even_kernel_is_the_nearest_and_keeps_bilinear_up_sampling() -> None:
    torch.manual_seed(3)
    line = torch.tensor([0.5, 1, 0.5])
    bilinear = torch.outer(line, line).expand(2, 3, 3, 3)
    assert torch.allclose(even_kernel(bilinear), bilinear, atol=1e-6)
    weight = torch.randn(2, 3, 3, 3)
    even = even_kernel(weight)
    assert torch.allclose(even_kernel(even), even, atol=1e-6)
    # an orthogonal projection: what it takes away has no part within what is allowed
    other = even_kernel(torch.randn(2, 3, 3, 3))
    assert ((weight - even) * other).sum().abs() < 1e-4
    # bilinear ones are among the even ones, and theirs is an orthogonal projection as well
    torch.testing.assert_close(bilinear_kernel(even), bilinear_kernel(weight), rtol=0, atol=1e-6)
    assert torch.allclose(bilinear_kernel(bilinear), bilinear, atol=1e-6)


def test_bilinear_up_convolution_is_a_1x1_convolution_enlarged() -> None:
    torch.manual_seed(3)
    up = UpConvolution(4, 3, project=bilinear_kernel)
    nn.init.zeros_(up.bias)
    image = torch.rand(1, 4, 6, 6)
    with torch.no_grad():
        small = torch.einsum("iohw,biyx->boyx", up.kernel[..., 1:2, 1:2], image)
        enlarged = nn.functional.interpolate(
            small, size=(11, 11), mode="bilinear", align_corners=True
        )
        torch.testing.assert_close(up(image)[..., :11, :11], enlarged, rtol=0, atol=1e-5)


def test_only_the_last_up_block_is_bilinear() -> None:
    network = small(even=True, bilinear=True)
    ups = [layer for layer in network.layers if isinstance(layer, UpConvolution)]
    for up in ups[:-1]:
        assert torch.equal(up.kernel, even_kernel(up.weight))
    assert torch.equal(ups[-1].kernel, bilinear_kernel(ups[-1].weight))
