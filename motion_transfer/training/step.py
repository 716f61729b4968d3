"""One step of a run: what the networks draw, what each judge says of it, who learns from that.

Tensors in, numbers out: no files but the judges' own, no devices chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn
from torch.optim import Optimizer

from motion_transfer.errors import WeightsError
from motion_transfer.estimate.models import FACE_NETWORK, find_model
from motion_transfer.training.face_networks import dlib_identity, load_dlib_face
from motion_transfer.training.faces import (
    REMEDY,
    WHAT,
    FaceIdentity,
    crop_boxes,
    find_heads,
    load_sphereface,
)
from motion_transfer.training.feature_networks import (
    FeatureNetwork,
    load_efficientnet_lite0,
    load_vgg19,
)
from motion_transfer.training.settings import LossSettings
from nhrr_core import (
    LossWeights,
    NeuralReRenderer,
    Verdict,
    adversarial_loss,
    alpha_loss,
    discriminator_loss,
    generator_loss,
    matching_loss,
    perceptual_loss,
    r1_penalty,
    texture_loss,
)
from nhrr_core.config import COLOUR_CHANNELS

R1_EVERY = 16
"""Steps of which one has the R1 penalty, as many times as large; from StyleGAN2 (CVPR 2020)."""

HEAD_SIZE = 96
"""Px to which a head is enlarged before it is judged."""

Batch = Mapping[str, Tensor]
Terms = dict[str, Tensor]


class Generator(nn.Module):
    """f, r and g in one forward pass, as training over several devices needs it."""

    def __init__(self, model: NeuralReRenderer) -> None:
        super().__init__()
        self.model = model

    def forward(
        self,
        texture: Float[Tensor, "B 3 T T"],
        visibility: Float[Tensor, "B 1 T T"],
        target_iuv: UInt8[Tensor, "B 3 S S"] | None,
        clearance: Float[Tensor, "B 2 t t"] | None = None,
        pictures: UInt8[Tensor, "B P 6 S S"] | None = None,
    ) -> Drawn:
        """Draw a batch; only the feature map where there is no target."""
        # the grid of the sampler has more digits than bf16
        feature_map = self.model.encode_texture(texture, visibility, clearance, pictures).float()
        if target_iuv is None:
            return Drawn(feature_map, None, None)
        feature_image = self.model.feature_image(feature_map, target_iuv)
        drawn = self.model.render_net(feature_image).float()
        return Drawn(feature_map, feature_image, self.model.blend(drawn, feature_image))


class Drawn(NamedTuple):
    """What the generator made of a batch, in float32.

    Attributes:
        feature_map: B x D x T x T.
        feature_image: B x C x S x S, what RenderNet read; None while only the map is trained.
        image: B x K x S x S in [-1, 1], RGB and perhaps alpha; None while only the map is trained.
    """

    feature_map: Float[Tensor, "B D T T"]
    feature_image: Float[Tensor, "B C S S"] | None
    image: Float[Tensor, "B K S S"] | None


@dataclass(frozen=True)
class Judges:
    """The frozen networks; None where the loss is left out."""

    perceptual: FeatureNetwork | None = None
    identity: FaceIdentity | None = None

    def to(self, device: torch.device) -> Judges:
        """Move them to a device."""
        for network in (self.perceptual, self.identity):
            if network is not None:
                network.to(device)
        return self


def load_judges(settings: LossSettings) -> Judges:
    """Load the networks that the losses ask for.

    Raises: WeightsError or InputError naming the option that gives the network, and the one that
        leaves the loss out; a loss is never dropped in silence.
    """
    perceptual = identity = None
    if settings.perceptual == "vgg19":
        perceptual = load_vgg19(Path(settings.vgg19_file) if settings.vgg19_file else None)
    elif settings.perceptual == "efficientnet-lite0":
        perceptual = load_efficientnet_lite0()
    if settings.identity == "sphereface":
        if not settings.sphereface_file:
            raise WeightsError(f"{WHAT} are not given; {REMEDY}")
        identity = FaceIdentity(load_sphereface(Path(settings.sphereface_file)))
    elif settings.identity == "dlib":
        identity = dlib_identity(load_dlib_face(find_model(FACE_NETWORK)))
    return Judges(perceptual, identity)


def shown_image(batch: Batch, drawn: Drawn) -> Float[Tensor, "B K S S"]:
    """Lay a drawing with alpha over the background that the real image has, too: so it is judged.

    So the colours at an outline are the person's alone, and fit any other background as well.
    """
    assert drawn.image is not None
    if "target_background" not in batch:
        return drawn.image
    colours, alpha = drawn.image.tensor_split([COLOUR_CHANNELS], dim=1)
    background = batch["target_background"][:, :, None, None]
    return torch.cat([torch.lerp(background, colours, (alpha + 1) / 2), alpha], dim=1)


def generator_terms(
    batch: Batch,
    drawn: Drawn,
    judges: Judges,
    discriminator: nn.Module | None,
    *,
    heads: bool = False,
    matching: bool = False,
) -> Terms:
    """Compute the terms of L_G that this batch and these judges give, not yet weighted.

    Args:
        heads: Whether the perceptual term is also taken of the heads alone, enlarged: at the size
            of a whole person a face is 30 px wide, and most layers see nothing of it.
        matching: Whether the discriminator's features are to be those of the real images.
    Source: the paper, Sec. 3.5. Departs from it: `heads`, `matching`.
    """
    terms: Terms = {}
    if "target_texture" in batch:
        terms["texture"] = texture_loss(
            drawn.feature_map,
            (batch["source_texture"], batch["source_visibility"]),
            (batch["target_texture"], batch["target_visibility"]),
        )
    if drawn.image is None or drawn.feature_image is None:
        return terms
    image = shown_image(batch, drawn)
    colours, truth = image[:, :COLOUR_CHANNELS], batch["target_image"]
    if judges.perceptual is not None:
        terms["perceptual"] = _perceptual_term(colours, truth, judges.perceptual)
        if heads:
            terms["head"] = _head_term(colours, truth, batch["target_iuv"], judges.perceptual)
    if judges.identity is not None:
        terms["identity"] = judges.identity(colours, truth, batch["target_iuv"]).float()
    if "target_alpha" in batch:
        terms["alpha"] = alpha_loss(image[:, COLOUR_CHANNELS:], batch["target_alpha"])
    if discriminator is not None:
        # detached: the feature image must be no way to please the discriminator
        condition = drawn.feature_image.detach()
        verdicts = discriminator(image, condition)
        terms["adversarial"] = adversarial_loss(_logits(verdicts))
        if matching:
            with torch.no_grad():
                wanted = discriminator(_real_image(batch), condition)
            terms["matching"] = matching_loss(_features(verdicts), _features(wanted))
    return terms


def _perceptual_term(colours: Tensor, truth: Tensor, network: FeatureNetwork) -> Tensor:
    with torch.no_grad():
        wanted = network(truth)
    return perceptual_loss(
        [layer.float() for layer in network(colours)],
        [layer.float() for layer in wanted],
        network.layer_weights,
    )


def _head_term(colours: Tensor, truth: Tensor, iuv: Tensor, network: FeatureNetwork) -> Tensor:
    boxes, seen = find_heads(iuv)
    size = (HEAD_SIZE, HEAD_SIZE)
    wanted = crop_boxes(truth, boxes, size)
    # where there is none, truth is compared with itself: shapes stay, and nothing is added
    found = torch.where(seen[:, None, None, None], crop_boxes(colours.float(), boxes, size), wanted)
    return _perceptual_term(found, wanted, network)


def discriminator_term(batch: Batch, drawn: Drawn, discriminator: nn.Module) -> Tensor:
    """Compute L_D of a batch; nothing of it reaches the generator."""
    assert drawn.feature_image is not None
    condition = drawn.feature_image.detach()
    # one pass over both: its instance norm looks at each image alone
    pairs = torch.cat([_real_image(batch), shown_image(batch, drawn).detach()])
    halves = [
        scale.chunk(2) for scale in _logits(discriminator(pairs, condition.repeat(2, 1, 1, 1)))
    ]
    return discriminator_loss([real for real, _ in halves], [fake for _, fake in halves])


def r1_term(batch: Batch, drawn: Drawn, discriminator: nn.Module) -> Tensor:
    """Compute the R1 penalty of a batch; nothing of it reaches the generator."""
    assert drawn.feature_image is not None
    real = _real_image(batch).requires_grad_()
    return r1_penalty(_logits(discriminator(real, drawn.feature_image.detach())), real)


def _real_image(batch: Batch) -> Tensor:
    """The target as RenderNet would draw it, with alpha where it draws that."""
    real = [batch[name] for name in ("target_image", "target_alpha") if name in batch]
    return torch.cat(real, dim=1)


def _logits(verdicts: Sequence[Verdict]) -> list[Tensor]:
    return [verdict.logits.float() for verdict in verdicts]


def _features(verdicts: Sequence[Verdict]) -> list[list[Tensor]]:
    return [[layer.float() for layer in verdict.features] for verdict in verdicts]


@dataclass(frozen=True)
class Arithmetic:
    """How numbers are computed: where autocast holds, and what backward does.

    Attributes:
        without_hooks: Takes a module out of what several devices wrapped it in.
    """

    autocast: Callable[[], AbstractContextManager[None]]
    backward: Callable[[Tensor], object]
    without_hooks: Callable[[nn.Module], nn.Module]


@dataclass(frozen=True)
class Players:
    """The networks that learn; without a discriminator there is no adversarial loss."""

    generator: nn.Module
    generator_optimiser: Optimizer
    discriminator: nn.Module | None = None
    discriminator_optimiser: Optimizer | None = None


def set_stage(model: NeuralReRenderer, *, inpainting: bool) -> None:
    """Train or freeze FeatureNet, as the two stages of some variants ask; others have one.

    Source: the paper, Sec. 4.4, IP: the inpainting network is trained first, then fixed.
    """
    model.train()
    if model.config.inpaints_first and model.feature_net is not None:
        model.feature_net.requires_grad_(inpainting)
        model.feature_net.train(inpainting)  # its batch norms' averages are fixed as well


def update(
    batch: Batch,
    players: Players,
    judges: Judges,
    weights: LossWeights,
    arithmetic: Arithmetic,
    *,
    adversarial: bool,
    inpainting: bool = False,
    r1_weight: float = 0.0,
) -> Terms:
    """Make one step of the generator, then one of the discriminator against what was drawn.

    Args:
        adversarial: Whether the discriminator takes part yet.
        inpainting: Whether only the feature map is drawn and trained.
        r1_weight: Of the R1 penalty of this step; 0: none.
    Returns: The terms, not weighted, detached; `total`; `discriminator`; and `r1`, if there is one.
    """
    discriminator = players.discriminator if adversarial and not inpainting else None
    if discriminator is not None:
        # the generator's backward must leave no gradients in its opponent
        discriminator.requires_grad_(False)
    with arithmetic.autocast():
        drawn = players.generator(
            batch["source_texture"],
            batch["source_visibility"],
            None if inpainting else batch["target_iuv"],
            batch.get("source_clearance"),
            batch.get("source_pictures"),
        )
        judge = discriminator and arithmetic.without_hooks(discriminator)
        terms = generator_terms(
            batch, drawn, judges, judge, heads=weights.head > 0, matching=weights.matching > 0
        )
        total = generator_loss(terms, weights)
    _learn(total, players.generator_optimiser, arithmetic)
    terms["total"] = total
    if discriminator is not None and players.discriminator_optimiser is not None:
        discriminator.requires_grad_(True)
        with arithmetic.autocast():
            loss = terms["discriminator"] = discriminator_term(batch, drawn, discriminator)
            if r1_weight:
                terms["r1"] = r1_term(batch, drawn, discriminator)
                loss = loss + r1_weight * terms["r1"]
        _learn(loss, players.discriminator_optimiser, arithmetic)
    return {name: term.detach() for name, term in terms.items()}


def _learn(loss: Tensor, optimiser: Optimizer, arithmetic: Arithmetic) -> None:
    arithmetic.backward(loss)
    optimiser.step()
    optimiser.zero_grad()


class Average:
    """An exponential moving average of a model's weights; what is exported and sampled.

    Batch norms' running averages are copied.

    Args:
        model: What is averaged into: a copy of the one that is trained.
        decay: Of the average, once it has become long.
    """

    def __init__(self, model: NeuralReRenderer, decay: float) -> None:
        self.model = model
        self._decay = decay

    @torch.no_grad()
    def update(self, model: NeuralReRenderer, step: int) -> None:
        """Take in the weights after a step (1 first)."""
        # the average begins short, so that early weights are forgotten
        decay = min(self._decay, (1 + step) / (10 + step))
        ours: list[Tensor] = list(self.model.parameters())
        theirs: list[Tensor] = list(model.parameters())
        torch._foreach_lerp_(ours, theirs, 1 - decay)
        for own, other in zip(self.model.buffers(), model.buffers(), strict=True):
            own.copy_(other)
