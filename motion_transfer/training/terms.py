"""The losses of a batch, by name: what the networks drew, and what each judge says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn

from motion_transfer.errors import WeightsError
from motion_transfer.training.config import LossSettings
from motion_transfer.training.faces import FaceIdentity
from motion_transfer.training.feature_networks import (
    FeatureNetwork,
    load_efficientnet_lite0,
    load_vgg19,
)
from motion_transfer.training.sphereface import REMEDY, WHAT, load_sphereface
from nhrr_core import (
    NeuralReRenderer,
    adversarial_loss,
    alpha_loss,
    discriminator_loss,
    perceptual_loss,
    texture_loss,
)
from nhrr_core.config import COLOUR_CHANNELS

Batch = Mapping[str, Tensor]
Terms = dict[str, Tensor]


@dataclass(frozen=True)
class Drawn:
    """What the generator made of a batch, in float32.

    Attributes:
        feature_map: B x D x T x T.
        feature_image: B x C x S x S, what RenderNet read; None while only the map is trained.
        image: B x K x S x S in [-1, 1], RGB and perhaps alpha; None likewise.
    """

    feature_map: Float[Tensor, "B D T T"]
    feature_image: Float[Tensor, "B C S S"] | None
    image: Float[Tensor, "B K S S"] | None


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
    ) -> tuple[Tensor, Tensor | None, Tensor | None]:
        """The fields of `Drawn`; only the feature map where there is no target."""
        # the grid of the sampler has more digits than bf16
        feature_map = self.model.encode_texture(texture, visibility, clearance).float()
        if target_iuv is None:
            return feature_map, None, None
        feature_image = self.model.feature_image(feature_map, target_iuv)
        drawn = self.model.render_net(feature_image).float()
        return feature_map, feature_image, self.model.blend(drawn, feature_image)


@dataclass(frozen=True)
class Judges:
    """The frozen networks; None where the loss is left out."""

    perceptual: FeatureNetwork | None = None
    identity: FaceIdentity | None = None

    def to(self, device: torch.device) -> Judges:
        """On a device."""
        for network in (self.perceptual, self.identity):
            if network is not None:
                network.to(device)
        return self


def load_judges(settings: LossSettings) -> Judges:
    """The networks that the losses ask for.

    Raises: WeightsError or InputError naming the option that gives the network, and the one that
        leaves the loss out; a loss is never dropped in silence.
    """
    perceptual = None
    if settings.perceptual == "vgg19":
        perceptual = load_vgg19(Path(settings.vgg19_file) if settings.vgg19_file else None)
    elif settings.perceptual == "efficientnet-lite0":
        perceptual = load_efficientnet_lite0()
    identity = None
    if settings.identity == "sphereface":
        if not settings.sphereface_file:
            raise WeightsError(f"{WHAT} are not given; {REMEDY}")
        identity = FaceIdentity(load_sphereface(Path(settings.sphereface_file)))
    return Judges(perceptual, identity)


def real_image(batch: Batch) -> Float[Tensor, "B K S S"]:
    """What `Drawn.image` should be."""
    if "target_alpha" in batch:
        return torch.cat([batch["target_image"], batch["target_alpha"]], dim=1)
    return batch["target_image"]


def shown_image(batch: Batch, drawn: Drawn) -> Float[Tensor, "B K S S"]:
    """What is judged: a drawing with alpha over the background that the real image has, too.

    So the colours at an outline are the person's alone, and fit any other background as well.
    """
    assert drawn.image is not None
    if "target_background" not in batch:
        return drawn.image
    colours, alpha = drawn.image.tensor_split([COLOUR_CHANNELS], dim=1)
    background = batch["target_background"][:, :, None, None]
    return torch.cat([torch.lerp(background, colours, (alpha + 1) / 2), alpha], dim=1)


def generator_terms(
    batch: Batch, drawn: Drawn, judges: Judges, discriminator: nn.Module | None
) -> Terms:
    """The terms of L_G that this batch and these judges give, not yet weighted.

    The feature image is no way to please the discriminator: it is given to it without gradient.
    Source: the paper, Sec. 3.5.
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
        with torch.no_grad():
            wanted = judges.perceptual(truth)
        found = judges.perceptual(colours)
        terms["perceptual"] = perceptual_loss(
            [layer.float() for layer in found],
            [layer.float() for layer in wanted],
            judges.perceptual.layer_weights,
        )
    if judges.identity is not None:
        terms["identity"] = judges.identity(colours, truth, batch["target_iuv"]).float()
    if "target_alpha" in batch:
        terms["alpha"] = alpha_loss(image[:, COLOUR_CHANNELS:], batch["target_alpha"])
    if discriminator is not None:
        logits = discriminator(image, drawn.feature_image.detach())
        terms["adversarial"] = adversarial_loss([scale.float() for scale in logits])
    return terms


def discriminator_term(batch: Batch, drawn: Drawn, discriminator: nn.Module) -> Tensor:
    """L_D of a batch; nothing of it reaches the generator."""
    assert drawn.feature_image is not None
    condition = drawn.feature_image.detach()
    # one pass over both: its instance norm looks at each image alone
    pairs = torch.cat([real_image(batch), shown_image(batch, drawn).detach()])
    logits = [scale.float() for scale in discriminator(pairs, condition.repeat(2, 1, 1, 1))]
    halves = [scale.chunk(2) for scale in logits]
    return discriminator_loss([real for real, _ in halves], [fake for _, fake in halves])
