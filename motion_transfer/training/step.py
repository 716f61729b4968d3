"""One update of both players. Tensors in, numbers out: no files, no devices chosen."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor, nn

from motion_transfer.training.terms import (
    Batch,
    Drawn,
    Judges,
    Terms,
    discriminator_term,
    generator_terms,
)
from nhrr_core import LossWeights, NeuralReRenderer, generator_loss


class Optimiser(Protocol):
    """What is asked of an optimiser, torch's own or accelerate's around it."""

    def step(self) -> object: ...
    def zero_grad(self) -> object: ...


@dataclass(frozen=True)
class Arithmetic:
    """How numbers are computed: where autocast holds, and what backward does.

    Attributes:
        without_hooks: the module itself, out of what several devices wrapped it in.
    """

    autocast: Callable[[], AbstractContextManager[None]]
    backward: Callable[[Tensor], object]
    without_hooks: Callable[[nn.Module], nn.Module]


@dataclass(frozen=True)
class Players:
    """The networks that learn; without a discriminator there is no adversarial loss."""

    generator: nn.Module
    generator_optimiser: Optimiser
    discriminator: nn.Module | None = None
    discriminator_optimiser: Optimiser | None = None


def set_stage(model: NeuralReRenderer, *, inpainting: bool) -> None:
    """Train or freeze FeatureNet, as the two stages of `ip` ask; other variants stay as they are.

    Source: the paper, Sec. 4.4, IP: the inpainting network is trained first, then fixed.
    """
    model.train()
    if model.config.variant == "ip" and model.feature_net is not None:
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
) -> Terms:
    """One step of the generator, then one of the discriminator against what was drawn.

    Args:
        adversarial: whether the discriminator takes part yet.
        inpainting: only the feature map is drawn and trained.
    Returns: the terms, not weighted, detached; `total`; and `discriminator`.
    """
    discriminator = players.discriminator if adversarial and not inpainting else None
    if discriminator is not None:
        discriminator.requires_grad_(False)
    with arithmetic.autocast():
        drawn = Drawn(
            *players.generator(
                batch["source_texture"],
                batch["source_visibility"],
                None if inpainting else batch["target_iuv"],
                batch.get("source_clearance"),
            )
        )
        judge = discriminator and arithmetic.without_hooks(discriminator)
        terms = generator_terms(batch, drawn, judges, judge)
        total = generator_loss(terms, weights)
    arithmetic.backward(total)
    players.generator_optimiser.step()
    players.generator_optimiser.zero_grad()
    terms["total"] = total
    if discriminator is not None:
        terms["discriminator"] = _update_discriminator(batch, drawn, players, arithmetic)
    return {name: term.detach() for name, term in terms.items()}


def _update_discriminator(
    batch: Batch, drawn: Drawn, players: Players, arithmetic: Arithmetic
) -> Tensor:
    discriminator, optimiser = players.discriminator, players.discriminator_optimiser
    assert discriminator is not None and optimiser is not None
    discriminator.requires_grad_(True)
    with arithmetic.autocast():
        loss = discriminator_term(batch, drawn, discriminator)
    arithmetic.backward(loss)
    optimiser.step()
    optimiser.zero_grad()
    return loss


class Average:
    """An exponential moving average of a model's weights; what is exported and sampled.

    The average begins short, so that early weights are forgotten: the decay of step s is at most
    (1 + s) / (10 + s). Batch norms' running averages are copied.

    Args:
        model: what is averaged into: a copy of the one that is trained.
    """

    def __init__(self, model: NeuralReRenderer, decay: float) -> None:
        self.model = model
        self._decay = decay

    @torch.no_grad()
    def update(self, model: NeuralReRenderer, step: int) -> None:
        """Take in the weights after a step (1 first)."""
        decay = min(self._decay, (1 + step) / (10 + step))
        ours: list[Tensor] = list(self.model.parameters())
        theirs: list[Tensor] = list(model.parameters())
        torch._foreach_lerp_(ours, theirs, 1 - decay)
        for own, other in zip(self.model.buffers(), model.buffers(), strict=True):
            own.copy_(other)
