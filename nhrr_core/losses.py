"""The paper's losses (Sec. 3.5), as functions of tensors; each is a scalar.

A mean over nothing (no texel seen, no face seen) is 0 and passes no gradient.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from nhrr_core.config import COLOUR_CHANNELS
from nhrr_core.errors import ConfigError, ShapeError


@dataclass(frozen=True, kw_only=True)
class LossWeights:
    """The lambdas of the generator's loss.

    Raises: ConfigError if one is negative or not finite.
    Source: the paper, Sec. 3.5. Departs from it: `alpha`, of the optional coverage channel, and
        `head`, the perceptual distance of the enlarged head, are this project's; `matching` is
        Pix2PixHD's.
    """

    perceptual: float = 10.0
    adversarial: float = 1.0
    identity: float = 5.0
    texture: float = 1.0
    alpha: float = 10.0
    head: float = 0.0
    matching: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not math.isfinite(value) or value < 0:
                raise ConfigError(f"loss weight {field.name} is {value!r}; it must be 0 or more")


def generator_loss(
    terms: Mapping[str, Float[Tensor, ""]], weights: LossWeights
) -> Float[Tensor, ""]:
    """Compute L_G, the weighted sum of its terms; a variant leaves out those that it has not.

    Args:
        terms: By the names of the fields of `LossWeights`.
    Raises: ConfigError on a term without a weight, or on no term at all.
    Source: the paper, Sec. 3.5, Eq. 7.
    """
    known = {field.name for field in fields(weights)}
    unknown = sorted(set(terms) - known)
    if unknown or not terms:
        problem = f"unknown loss term {', '.join(unknown)}" if unknown else "no loss term"
        raise ConfigError(f"{problem}; supported are {', '.join(sorted(known))}")
    return torch.stack([getattr(weights, name) * term for name, term in terms.items()]).sum()


def discriminator_loss(
    real: Sequence[Float[Tensor, "B 1 _ _"]], fake: Sequence[Float[Tensor, "B 1 _ _"]]
) -> Float[Tensor, ""]:
    """Compute D's loss: binary cross-entropy of real images called real and generated ones fake.

    1/2 * sum over scales of mean(-log s(real)) + mean(-log(1 - s(fake))), s the logistic function.

    Args:
        real, fake: The logits of `Discriminator`, the generated image (and the condition) detached.
    Raises: ShapeError if they have different numbers of scales, or none.
    Source: the paper, Sec. 3.5; the sum over scales and the half from Pix2PixHD.
    """
    _check_same_number(real, fake, "scales")
    terms = [_cross_entropy(logits, 1.0) for logits in real]
    terms += [_cross_entropy(logits, 0.0) for logits in fake]
    return torch.stack(terms).sum() / 2


def adversarial_loss(fake: Sequence[Float[Tensor, "B 1 _ _"]]) -> Float[Tensor, ""]:
    """Compute L_adv of the generator: binary cross-entropy of generated images called real.

    Sum over scales of mean(-log s(fake)), the form that does not saturate.

    Raises: ShapeError if there is no scale.
    Source: the paper, Sec. 3.5; the sum over scales from Pix2PixHD.
    """
    _check_same_number(fake, fake, "scales")
    return torch.stack([_cross_entropy(logits, 1.0) for logits in fake]).sum()


def matching_loss(
    generated: Sequence[Sequence[Float[Tensor, "B _ _ _"]]],
    truth: Sequence[Sequence[Float[Tensor, "B _ _ _"]]],
) -> Float[Tensor, ""]:
    """Compute how far the discriminator's features of generated and real images are apart.

    Mean over scales of the sum over layers of mean|D_j(generated) - D_j(truth)|.

    Args:
        generated, truth: `Verdict.features` of each scale; take the truth's without gradients.
    Raises: ShapeError if the numbers of scales, or of a scale's layers, differ or are 0.
    Source: Pix2PixHD (Wang et al., CVPR 2018), feature matching; its weight is 10. The paper has
        no such loss.
    """
    _check_same_number(generated, truth, "scales")
    terms = []
    for ours, theirs in zip(generated, truth, strict=True):
        _check_same_number(ours, theirs, "layers")
        terms += [F.l1_loss(our, their) for our, their in zip(ours, theirs, strict=True)]
    return torch.stack(terms).sum() / len(generated)


def r1_penalty(
    real: Sequence[Float[Tensor, "B 1 _ _"]], image: Float[Tensor, "B K H W"]
) -> Float[Tensor, ""]:
    """Compute R1: half of the squared length of the discriminator's gradient at real images.

    The gradient is of the sum of an image's logits, over patches and scales, with respect to that
    image; the penalty is a mean over the batch, and differentiable itself.

    Args:
        real: The logits of `Discriminator`, of real images.
        image: Those images, which require gradients.
    Raises: ShapeError if there is no scale.
    Source: Mescheder et al., ICML 2018, Eq. 9; the sum over patches as LaMa's (Suvorov et al., WACV
        2022). The paper has no such loss.
    """
    _check_same_number(real, real, "scales")
    total = torch.stack([logits.float().sum() for logits in real]).sum()
    (gradient,) = torch.autograd.grad(total, image, create_graph=True)
    return gradient.square().sum((1, 2, 3)).mean() / 2


def perceptual_loss(
    generated: Sequence[Float[Tensor, "B _ _ _"]],
    truth: Sequence[Float[Tensor, "B _ _ _"]],
    weights: Sequence[float],
) -> Float[Tensor, ""]:
    """Compute L_p: how far the activations of a frozen network are apart, layer by layer.

    Sum over layers j of weights[j] * mean|p_j(generated) - p_j(truth)|.

    Args:
        generated, truth: Activations of the same layers; take the truth's without gradients.
        weights: One a layer. Pix2PixHD gives VGG-19's relu1_1 to relu5_1 the weights 1/32, 1/16,
            1/8, 1/4, 1; the paper's equation, read literally, has 1 for all.
    Raises: ShapeError if the numbers of layers and weights differ, or are 0, or if the two
        activations of a layer differ in shape.
    Source: the paper, Sec. 3.5, Eq. 5. Departs from it: the weights.
    """
    _check_same_number(generated, truth, "layers")
    _check_same_number(generated, weights, "layers and weights")
    terms = []
    for ours, theirs, weight in zip(generated, truth, weights, strict=True):
        if ours.shape != theirs.shape:  # l1_loss would broadcast, with a warning
            raise ShapeError(f"activations {list(ours.shape)} and {list(theirs.shape)} differ")
        terms.append(weight * F.l1_loss(ours, theirs))
    return torch.stack(terms).sum()


def texture_loss(
    feature_map: Float[Tensor, "B D T T"],
    source: tuple[Float[Tensor, "B 3 T T"], Float[Tensor, "B 1 T T"]],
    target: tuple[Float[Tensor, "B 3 T T"], Float[Tensor, "B 1 T T"]],
) -> Float[Tensor, ""]:
    """Compute L_tex, which makes the feature map's first three channels the person's colours.

    The sum of two l1 distances, to the partial texture of the source and to that of the target,
    each a mean over colours and over all visible texels of the batch.

    Args:
        feature_map: That of the source, D at least 3.
        source, target: Texture and visibility (0 or 1) as `extract_texture` returns them.
    Raises: ShapeError if the feature map has fewer than three channels.
    Source: the paper, Sec. 3.5, intermediate in-painting loss. Departs from it: no.
    """
    if feature_map.shape[1] < COLOUR_CHANNELS:
        raise ShapeError(f"feature map {list(feature_map.shape)} has no three colour channels")
    colours = feature_map[:, :COLOUR_CHANNELS]
    return _visible_l1(colours, *source) + _visible_l1(colours, *target)


def face_identity_loss(
    generated: Float[Tensor, "B E"], truth: Float[Tensor, "B E"], seen: Bool[Tensor, " B"]
) -> Float[Tensor, ""]:
    """Compute L_face: the mean absolute difference of embeddings, over the images with a face.

    Args:
        generated, truth: N_face of the face crops; take the truth's without gradients.
        seen: False where the crop shows no face; such an image counts for nothing.
    Source: the paper, Sec. 3.5, Eq. 6, |N_face(generated) - N_face(truth)|. It does not say whether
        |.| is a sum or a mean over the embedding; a sum over 512 values would outweigh the rest.
    """
    difference = (generated - truth).abs().mean(dim=1)
    return torch.where(seen, difference, 0).sum() / seen.sum().clamp_min(1)


def alpha_loss(
    alpha: Float[Tensor, "B 1 H W"], coverage: Float[Tensor, "B 1 H W"]
) -> Float[Tensor, ""]:
    """Compute the mean absolute error of RenderNet's fourth output, in [-1, 1] (1 is the person).

    Source: this project's; the paper renders no alpha.
    """
    return F.l1_loss(alpha, coverage)


def _cross_entropy(logits: Tensor, label: float) -> Tensor:
    return F.binary_cross_entropy_with_logits(logits, torch.full_like(logits, label))


def _visible_l1(colours: Tensor, texture: Tensor, visibility: Tensor) -> Tensor:
    texels = visibility.sum().clamp_min(1)
    return ((colours - texture).abs() * visibility).sum() / (COLOUR_CHANNELS * texels)


def _check_same_number(first: Sequence[object], second: Sequence[object], what: str) -> None:
    if len(first) != len(second) or not first:
        raise ShapeError(f"{len(first)} and {len(second)} {what}; give equally many, at least one")
