"""The networks of a run and their optimisers, at its beginning."""

from __future__ import annotations

from typing import Any

import torch
import torch.nn.functional as F

from motion_transfer.training.checkpoints import RunState
from motion_transfer.training.config import TrainConfig
from motion_transfer.training.speed import arrange
from nhrr_core import Discriminator, NeuralReRenderer


def build_state(
    config: TrainConfig, init: NeuralReRenderer | None, device: torch.device
) -> RunState:
    """Networks with weights from the run's seed, or from `init`, and Adam for each player.

    Source of Adam's settings: the paper, Sec. 3.5; it has no weight decay.
    """
    torch.manual_seed(config.run.seed)
    model = NeuralReRenderer(config.model)
    if init is not None:
        model.load_state_dict(_widened(init, model))
    discriminator = None
    if config.losses.adversarial:
        discriminator = Discriminator(
            image_channels=config.model.render_outputs,
            condition_channels=config.model.render_inputs,
            width=config.losses.discriminator_width,
            scales=config.losses.discriminator_scales,
        ).to(device)
    model.to(device)
    arrange(model.feature_net, model.render_net, discriminator)
    average = None
    if config.optimiser.ema_decay:
        average = NeuralReRenderer(config.model).to(device).requires_grad_(False).eval()
        average.load_state_dict(model.state_dict())
    if config.speed.compile:
        for network in (model.feature_net, model.render_net, discriminator):
            if network is not None:
                network.compile(dynamic=False)  # there are two image sizes at most
    adam: dict[str, Any] = {
        "lr": config.optimiser.learning_rate,
        "betas": (config.optimiser.beta1, config.optimiser.beta2),
        "fused": True,
    }
    optimisers = {"generator": torch.optim.Adam(model.parameters(), **adam)}
    if discriminator is not None:
        optimisers["discriminator"] = torch.optim.Adam(discriminator.parameters(), **adam)
    return RunState(model, average, discriminator, optimisers)


def _widened(init: NeuralReRenderer, model: NeuralReRenderer) -> dict[str, torch.Tensor]:
    """The weights to start from; inputs that only the new networks read begin without effect.

    They are the last ones of their convolutions.
    """
    weights = init.state_dict()
    for name, own in model.state_dict().items():
        if own.ndim == 4:
            missing = own.shape[1] - weights[name].shape[1]
            weights[name] = F.pad(weights[name], (0, 0, 0, 0, 0, missing))
    return weights
