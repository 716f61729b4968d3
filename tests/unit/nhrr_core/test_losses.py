from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from reference.losses_loops import (
    adversarial_loss_loops,
    discriminator_loss_loops,
    face_identity_loss_loops,
    perceptual_loss_loops,
    texture_loss_loops,
)
from torch import Tensor

from nhrr_core import (
    ConfigError,
    LossWeights,
    ShapeError,
    adversarial_loss,
    alpha_loss,
    discriminator_loss,
    face_identity_loss,
    generator_loss,
    matching_loss,
    perceptual_loss,
    r1_penalty,
    texture_loss,
)

Visible = tuple[Tensor, Tensor]


def noise(*shape: int) -> Tensor:
    return torch.randn(*shape, dtype=torch.float64, requires_grad=True)


def scales() -> list[Tensor]:
    """Logits of two images at three scales."""
    return [noise(2, 1, 5, 4), noise(2, 1, 3, 3), noise(2, 1, 2, 2)]


def layers() -> list[Tensor]:
    return [noise(2, 3, 6, 5), noise(2, 4, 3, 2), noise(2, 6, 1, 1)]


def partial(size: int = 6) -> Visible:
    """A texture of two images of which about half is visible, unequally many texels in each."""
    share = torch.tensor([0.3, 0.7]).view(2, 1, 1, 1)
    visibility = (torch.rand(2, 1, size, size) < share).double()
    return torch.rand(2, 3, size, size, dtype=torch.float64) * visibility, visibility


def assert_same(
    fast: Callable[[], Tensor], slow: Callable[[], Tensor], variables: list[Tensor]
) -> None:
    """Equal values, and equal gradients, of which none is all zero."""
    value, wanted = fast(), slow()
    assert value.shape == ()
    torch.testing.assert_close(value, wanted, rtol=1e-12, atol=1e-12)
    gradients = torch.autograd.grad(value, variables)
    for ours, theirs in zip(gradients, torch.autograd.grad(wanted, variables), strict=True):
        assert theirs.abs().sum() > 0
        torch.testing.assert_close(ours, theirs, rtol=1e-10, atol=1e-12)


def test_discriminator_loss_equals_loops() -> None:
    real, fake = scales(), scales()
    assert_same(
        lambda: discriminator_loss(real, fake),
        lambda: discriminator_loss_loops(real, fake),
        [*real, *fake],
    )


def test_adversarial_loss_equals_loops() -> None:
    fake = scales()
    assert_same(lambda: adversarial_loss(fake), lambda: adversarial_loss_loops(fake), fake)


def test_perceptual_loss_equals_loops() -> None:
    generated, truth, weights = layers(), layers(), [0.5, 2.0, 0.25]
    assert_same(
        lambda: perceptual_loss(generated, truth, weights),
        lambda: perceptual_loss_loops(generated, truth, weights),
        [*generated, *truth],
    )


def test_texture_loss_equals_loops() -> None:
    feature_map, source, target = noise(2, 5, 6, 6), partial(), partial()
    assert_same(
        lambda: texture_loss(feature_map, source, target),
        lambda: texture_loss_loops(feature_map, source, target),
        [feature_map],
    )


def test_face_identity_loss_equals_loops() -> None:
    generated, truth = noise(4, 7), noise(4, 7)
    seen = torch.tensor([True, False, True, True])
    assert_same(
        lambda: face_identity_loss(generated, truth, seen),
        lambda: face_identity_loss_loops(generated, truth, seen),
        [generated, truth],
    )


def test_gradcheck() -> None:
    check = torch.autograd.gradcheck
    seen = torch.tensor([True, False])
    assert check(lambda *x: discriminator_loss(x[:2], x[2:]), [*scales()[1:], *scales()[1:]])
    assert check(lambda *x: adversarial_loss(x), scales()[1:])
    assert check(
        lambda *x: perceptual_loss(x[:2], x[2:], [1.0, 2.0]), [*layers()[1:], *layers()[1:]]
    )
    source, target = partial(3), partial(3)
    assert check(lambda m: texture_loss(m, source, target), noise(2, 4, 3, 3))
    assert check(lambda a, b: face_identity_loss(a, b, seen), (noise(2, 4), noise(2, 4)))
    assert check(alpha_loss, (noise(1, 1, 3, 2), noise(1, 1, 3, 2)))


def test_adversarial_losses_of_an_undecided_discriminator() -> None:
    """log 2 a scale: for the generator, and for the mean of real and fake."""
    undecided = [torch.zeros(1, 1, 4, 4), torch.zeros(1, 1, 2, 2), torch.zeros(1, 1, 1, 1)]
    assert adversarial_loss(undecided).item() == pytest.approx(3 * math.log(2))
    assert discriminator_loss(undecided, undecided).item() == pytest.approx(3 * math.log(2))


@pytest.mark.parametrize("logit", [200.0, -200.0])
def test_adversarial_losses_stay_finite(logit: float) -> None:
    """The logistic function is exactly 0 or 1 there, its logarithm without a limit."""
    sure = torch.full((1, 1, 1, 1), logit, requires_grad=True)
    loss = adversarial_loss([sure])
    loss.backward()
    assert loss.item() == max(-logit, 0.0)
    assert sure.grad is not None and sure.grad.item() == (-1.0 if logit < 0 else 0.0)
    assert discriminator_loss([sure], [sure]).item() == pytest.approx(abs(logit) / 2)


def test_a_fooled_discriminator_pays_and_the_generator_does_not() -> None:
    high, low = [torch.full((1, 1, 2, 2), 5.0)], [torch.full((1, 1, 2, 2), -5.0)]
    assert discriminator_loss(high, low) < 0.01 < 4 < discriminator_loss(low, high)
    assert adversarial_loss(high) < 0.01 < 4 < adversarial_loss(low)


def test_scale_counts_the_same_whatever_its_size() -> None:
    coarse, fine = torch.full((1, 1, 1, 1), 2.0), torch.full((1, 1, 9, 9), 2.0)
    torch.testing.assert_close(adversarial_loss([coarse]), adversarial_loss([fine]))


def test_perceptual_loss_is_zero_between_equals_and_weighs_layers() -> None:
    truth = [torch.rand(1, 2, 4, 4), torch.rand(1, 3, 2, 2)]
    assert perceptual_loss(truth, truth, (1.0, 1.0)) == 0
    first = [truth[0] + 0.5, truth[1]]
    second = [truth[0], truth[1] - 0.25]
    assert perceptual_loss(first, truth, (2.0, 8.0)).item() == pytest.approx(1.0)
    assert perceptual_loss(second, truth, (2.0, 8.0)).item() == pytest.approx(2.0)


def test_texture_loss_sees_three_channels_of_visible_texels_only() -> None:
    feature_map = torch.zeros(1, 5, 4, 4, requires_grad=True)
    visibility = torch.zeros(1, 1, 4, 4)
    visibility[0, 0, 1, 2] = 1
    everywhere = torch.full((1, 3, 4, 4), 0.5)
    nothing = (everywhere, torch.zeros_like(visibility))
    loss = texture_loss(feature_map, (everywhere, visibility), nothing)
    loss.backward()
    assert loss.item() == 0.5
    assert feature_map.grad is not None
    wanted = torch.zeros(1, 5, 4, 4)
    wanted[0, :3, 1, 2] = -1 / 3
    torch.testing.assert_close(feature_map.grad, wanted)


def test_texture_loss_is_the_sum_of_source_and_target() -> None:
    feature_map = torch.zeros(1, 3, 2, 2)
    all_seen = torch.ones(1, 1, 2, 2)
    quarter, half = torch.full((1, 3, 2, 2), 0.25), torch.full((1, 3, 2, 2), -0.5)
    assert texture_loss(feature_map, (quarter, all_seen), (half, all_seen)).item() == 0.75


def test_texture_loss_of_nothing_visible_is_zero() -> None:
    feature_map = torch.rand(1, 3, 4, 4, requires_grad=True)
    nothing = (torch.rand(1, 3, 4, 4), torch.zeros(1, 1, 4, 4))
    loss = texture_loss(feature_map, nothing, nothing)
    loss.backward()
    assert loss.item() == 0
    assert feature_map.grad is not None and (feature_map.grad == 0).all()


def test_face_unseen_counts_for_nothing() -> None:
    generated = torch.rand(3, 4, requires_grad=True)
    truth = generated.detach() + torch.tensor([[0.5], [70.0], [1.5]])
    loss = face_identity_loss(generated, truth, torch.tensor([True, False, True]))
    loss.backward()
    assert loss.item() == pytest.approx(1.0)
    assert generated.grad is not None
    wanted = torch.tensor([-1 / 8, 0, -1 / 8])[:, None].expand(3, 4)
    torch.testing.assert_close(generated.grad, wanted)


def test_no_face_at_all_is_zero() -> None:
    generated = torch.rand(2, 4, requires_grad=True)
    loss = face_identity_loss(generated, torch.rand(2, 4), torch.tensor([False, False]))
    loss.backward()
    assert loss.item() == 0
    assert generated.grad is not None and (generated.grad == 0).all()


def test_alpha_loss() -> None:
    alpha = torch.tensor([-1.0, 1.0, 0.5, 0.0]).view(1, 1, 2, 2)
    coverage = torch.tensor([-1.0, -1.0, 1.0, 0.5]).view(1, 1, 2, 2)
    assert alpha_loss(alpha, coverage).item() == (0 + 2 + 0.5 + 0.5) / 4


def test_matching_loss_is_a_mean_over_scales_and_a_sum_over_layers() -> None:
    ones, zeros = torch.ones(2, 3, 4, 4), torch.zeros(2, 3, 4, 4)
    generated = [[ones, 3 * ones], [ones, ones]]
    truth = [[zeros, ones], [-ones, ones]]
    assert matching_loss(generated, truth).item() == ((1 + 2) + (2 + 0)) / 2


def test_r1_of_a_linear_discriminator_is_half_the_squared_length_of_its_weights() -> None:
    """Two scales that see everything: the gradient of the sum of logits is the sum of weights."""
    weights = [torch.randn(1, 3, 4, 4, dtype=torch.float64, requires_grad=True) for _ in range(2)]
    image = noise(5, 3, 4, 4)
    logits = [torch.nn.functional.conv2d(image, weight) for weight in weights]
    penalty = r1_penalty(logits, image)
    total = (weights[0] + weights[1]).detach()
    torch.testing.assert_close(penalty, total.square().sum() / 2, rtol=1e-6, atol=0)
    penalty.backward()
    for weight in weights:
        assert weight.grad is not None
        torch.testing.assert_close(weight.grad, total, rtol=1e-6, atol=0)


def test_r1_sums_over_patches_and_is_a_mean_over_images() -> None:
    """One weight w, seen by each of 9 pixels' own patch, on images that differ."""
    image = noise(2, 1, 3, 3)
    logits = image**2 / 2  # the gradient is the image
    wanted = image.square().sum((1, 2, 3)).mean() / 2
    torch.testing.assert_close(r1_penalty([logits], image), wanted, rtol=1e-6, atol=0)


def test_weights_are_the_paper_s() -> None:
    weights = LossWeights()
    assert weights.matching == weights.head == 0
    assert (weights.perceptual, weights.adversarial) == (10, 1)
    assert (weights.identity, weights.texture) == (5, 1)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf, "1", True, None])
@pytest.mark.parametrize("name", ["perceptual", "adversarial", "identity", "texture", "alpha"])
def test_impossible_weight_raises(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"loss weight {name} is"):
        LossWeights(**{name: value})  # type: ignore[arg-type]


def test_generator_loss_weighs_what_is_given() -> None:
    weights = LossWeights(perceptual=10.0, adversarial=2.0, identity=5.0, texture=3.0, alpha=7.0)
    names = ["perceptual", "adversarial", "identity", "texture", "alpha"]
    terms = {name: torch.tensor(10.0**i) for i, name in enumerate(names)}
    assert generator_loss(terms, weights).item() == 10 + 20 + 500 + 3000 + 70000
    assert generator_loss({"identity": torch.tensor(2.0)}, weights).item() == 10


def test_generator_loss_passes_gradients() -> None:
    term = torch.tensor(3.0, requires_grad=True)
    generator_loss({"perceptual": term, "texture": term * 2}, LossWeights()).backward()
    assert term.grad is not None and term.grad.item() == 12


@pytest.mark.parametrize(
    ("terms", "message"),
    [({"vgg": torch.tensor(1.0)}, "unknown loss term vgg"), ({}, "no loss term")],
)
def test_terms_without_weights_raise(terms: dict[str, Tensor], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        generator_loss(terms, LossWeights())


@pytest.mark.parametrize(
    "call",
    [
        lambda: discriminator_loss(scales(), scales()[:2]),
        lambda: discriminator_loss([], []),
        lambda: adversarial_loss([]),
        lambda: matching_loss([], []),
        lambda: matching_loss([layers()], [layers()[:2]]),
        lambda: r1_penalty([], noise(1, 1, 1, 1)),
        lambda: perceptual_loss(layers(), layers()[:2], [1.0, 1.0, 1.0]),
        lambda: perceptual_loss(layers(), layers(), [1.0, 1.0]),
        lambda: perceptual_loss([], [], []),
    ],
)
def test_unequal_numbers_raise(call: Callable[[], Tensor]) -> None:
    with pytest.raises(ShapeError, match="give equally many, at least one"):
        call()


@pytest.mark.usefixtures("unchecked")
def test_shapes_that_differ_raise() -> None:
    with pytest.raises(ShapeError, match=r"\[1, 2, 4, 4\] and \[1, 2, 4, 1\] differ"):
        perceptual_loss([torch.rand(1, 2, 4, 4)], [torch.rand(1, 2, 4, 1)], [1.0])
    with pytest.raises(ShapeError, match="no three colour channels"):
        texture_loss(noise(2, 2, 6, 6), partial(), partial())
