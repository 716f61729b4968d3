from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nhrr_core import Discriminator, ShapeError
from nhrr_core.discriminator import PatchDiscriminator


def small(**changes: int) -> Discriminator:
    sizes = {"image_channels": 3, "condition_channels": 2, "width": 4}
    return Discriminator(**{**sizes, **changes})


def halved(image: Tensor) -> Tensor:
    """Each pixel the mean of the 3 x 3 around every second one, without what lies outside."""
    height, width = image.shape[2:]
    out = torch.zeros(*image.shape[:2], (height + 1) // 2, (width + 1) // 2)
    for y in range(out.shape[2]):
        for x in range(out.shape[3]):
            rows = slice(max(2 * y - 1, 0), 2 * y + 2)
            columns = slice(max(2 * x - 1, 0), 2 * x + 2)
            out[:, :, y, x] = image[:, :, rows, columns].mean((2, 3))
    return out


def test_parameter_count() -> None:
    """By hand, for image and 16 channels of condition: kernels, then biases, then three scales."""
    with torch.device("meta"):
        network = Discriminator(image_channels=3, condition_channels=16)
    kernels = 16 * (19 * 64 + 64 * 128 + 128 * 256 + 256 * 512 + 512 * 1)
    biases = 64 + 128 + 256 + 512 + 1
    assert 3 * (kernels + biases) == 8_343_363
    assert sum(p.numel() for p in network.parameters()) == 8_343_363


def test_layers_are_pix2pixhd_s() -> None:
    """Kernel, stride, padding and channels of the convolutions, norms and slopes between."""
    layers = []
    for layer in PatchDiscriminator(inputs=19, width=64).layers:
        if isinstance(layer, nn.Conv2d):
            sizes = (layer.kernel_size[0], layer.stride[0], layer.padding[0])
            layers.append((layer.in_channels, layer.out_channels, *sizes))
        elif isinstance(layer, nn.LeakyReLU):
            layers.append(layer.negative_slope)
        else:
            assert isinstance(layer, nn.InstanceNorm2d) and not layer.affine
            layers.append("norm")
    assert layers == [
        (19, 64, 4, 2, 2),
        0.2,
        (64, 128, 4, 2, 2),
        "norm",
        0.2,
        (128, 256, 4, 2, 2),
        "norm",
        0.2,
        (256, 512, 4, 1, 2),
        "norm",
        0.2,
        (512, 1, 4, 1, 2),
    ]


def test_initial_weights_are_pix2pixhd_s() -> None:
    weight = next(PatchDiscriminator(inputs=64, width=64).parameters())
    assert abs(weight.mean().item()) < 5e-4
    assert weight.std().item() == pytest.approx(0.02, rel=0.02)


def test_logits_a_scale_at_256_px() -> None:
    """Down: n -> n / 2 + 1, three times; then two convolutions that each add a pixel."""
    with torch.device("meta"):
        network = Discriminator(image_channels=4, condition_channels=16)
        verdicts = network(torch.empty(2, 4, 256, 192), torch.empty(2, 16, 256, 192))
    sizes = [(2, 1, 35, 27), (2, 1, 19, 15), (2, 1, 11, 9)]
    assert [tuple(verdict.logits.shape) for verdict in verdicts] == sizes


def test_features_are_the_four_layers_before_the_logits() -> None:
    scale = PatchDiscriminator(inputs=5, width=4)
    logits, features = scale(torch.rand(2, 5, 32, 32))
    assert [tuple(layer.shape) for layer in features] == [
        (2, 4, 17, 17),
        (2, 8, 9, 9),
        (2, 16, 5, 5),
        (2, 32, 6, 6),
    ]
    assert torch.equal(scale.layers[-1](features[-1]), logits)


def test_a_logit_sees_70_pixels() -> None:
    """Without the norms, which see everything."""
    layers = PatchDiscriminator(inputs=1, width=1).double().layers
    local = nn.Sequential(*(m for m in layers if not isinstance(m, nn.InstanceNorm2d)))
    image = torch.rand(1, 1, 160, 160, dtype=torch.float64, requires_grad=True)
    logits = local(image)
    logits[0, 0, 11, 11].backward()
    assert image.grad is not None
    seen = (image.grad[0, 0] != 0).any(0).nonzero().flatten()
    assert int(seen.max() - seen.min()) + 1 == 70


@pytest.mark.parametrize("size", [(32, 32), (33, 46)])
def test_each_scale_sees_half_of_the_one_before(size: tuple[int, int]) -> None:
    network = small()
    image, condition = torch.rand(2, 3, *size), torch.rand(2, 2, *size)
    pair = torch.cat([image, condition], 1)
    for scale, verdict in zip(network.scales, network(image, condition), strict=True):
        torch.testing.assert_close(verdict.logits, scale(pair).logits, rtol=1e-4, atol=1e-5)
        pair = halved(pair)


def test_number_of_scales() -> None:
    image, condition = torch.rand(1, 3, 32, 32), torch.rand(1, 2, 32, 32)
    assert len(small()(image, condition)) == 3
    assert len(small(scales=1)(image, condition)) == 1


def test_logits_are_not_squashed() -> None:
    network = small()
    for parameter in network.parameters():
        nn.init.constant_(parameter, 0)
    for name, parameter in network.named_parameters():
        if name.endswith("layers.11.bias"):  # of the last convolution
            nn.init.constant_(parameter, -7.5)
    for logits, _ in network(torch.rand(1, 3, 32, 32), torch.rand(1, 2, 32, 32)):
        assert (logits == -7.5).all()


def test_gradient_reaches_every_weight_image_and_condition() -> None:
    network = small()
    image = torch.rand(1, 3, 40, 40, requires_grad=True)
    condition = torch.rand(1, 2, 40, 40, requires_grad=True)
    total = sum((logits * torch.rand_like(logits)).sum() for logits, _ in network(image, condition))
    assert isinstance(total, Tensor)
    total.backward()
    for tensor in (image, condition):
        assert tensor.grad is not None and (tensor.grad != 0).all()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None and parameter.grad.isfinite().all(), name
        if name.endswith("weight"):
            assert parameter.grad.abs().sum() > 0, name


def test_it_learns_which_image_belongs_to_a_condition() -> None:
    """Real and fake have the same images; only their conditions tell them apart."""
    network = small(condition_channels=3)
    optimiser = torch.optim.Adam(network.parameters(), lr=2e-3, betas=(0.5, 0.999))
    image = F.interpolate(torch.rand(4, 3, 8, 8), size=32, mode="nearest")
    other = image.flip(0)
    for _ in range(60):
        right, wrong = network(image, image), network(image, other)
        loss = sum(
            F.softplus(-r.logits).mean() + F.softplus(w.logits).mean()
            for r, w in zip(right, wrong, strict=True)
        )
        optimiser.zero_grad()
        assert isinstance(loss, Tensor)
        loss.backward()
        optimiser.step()
    for r, w in zip(network(image, image), network(image, other), strict=True):
        assert r.logits.mean() > w.logits.mean() + 1


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("shape", [(2, 2, 32, 32), (1, 2, 16, 32), (1, 2, 32, 16)])
def test_image_and_condition_that_do_not_match_raise(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError) as raised:
        small()(torch.rand(1, 3, 32, 32), torch.rand(*shape))
    assert str(raised.value) == (
        f"image [1, 3, 32, 32] and feature image {list(shape)} do not match"
    )
