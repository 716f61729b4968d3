"""Networks that learn one person from a few photos of theirs, in minutes.

Only the last layers of RenderNet learn, those that bring its drawing up to full size. So feature
maps are computed once, and FeatureNet's batch norms never see one person alone; and the layers
before, which have seen all people and know what a body looks like, stay as they are. A step costs
1.15 s of one core instead of 1.9 s for all of RenderNet.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from copy import deepcopy

import torch
import torch.nn.functional as F
from torch import Tensor

from motion_transfer.drawing.source import SourcePicture
from motion_transfer.errors import TrainingError
from motion_transfer.events import FramesDone, Listener, Notice, Stage, ignore
from motion_transfer.training.adaptation_settings import AdaptationSettings
from motion_transfer.training.feature_networks import FeatureNetwork
from motion_transfer.training.lessons import Lessons, lay_over_white
from motion_transfer.training.pictures import Image
from motion_transfer.training.speed import arrange, keep_memory
from motion_transfer.training.step import Batch, Drawn, Judges, Terms, generator_terms
from nhrr_core import LossWeights, NeuralReRenderer, generator_loss
from nhrr_core.render_net import ResidualBlock

WEIGHTS = LossWeights(perceptual=10.0, head=3.0, alpha=10.0)
"""As in training on people. Nothing reaches the texture loss, as FeatureNet is fixed; and there is
no discriminator: in so few steps it would learn the photos before the networks do."""

COARSE_SHARE = 1.0
"""Of the perceptual loss, how much is asked once more of the picture at half size: photos are drawn
larger than in training, and what is seen of a whole person is coarser than EfficientNet's reach."""

WARM_UP = 0.05
"""The share of the steps in which the learning rate rises: Adam's first steps have no mean yet."""

TIMED_STEPS = 2
"""Steps, the first ones, that tell how long all of them take."""

LONG_SECONDS = 20.0
"""What takes longer is announced."""


def adapt_model(
    model: NeuralReRenderer,
    pictures: Sequence[SourcePicture],
    poses: Sequence[Image],
    settings: AdaptationSettings,
    judge: FeatureNetwork,
    listener: Listener = ignore,
) -> NeuralReRenderer:
    """Let a copy of a model learn the person of some photos.

    Each photo is drawn from itself and, where there are several, from another one and from several
    together. What no photo shows is drawn in `poses`, and held as the model drew it.

    Args:
        model: In evaluation mode, on the device that is to learn.
        pictures: One person; the first photo decides the light.
        poses: IUV of anybody in motion, H x W x 3.
        listener: Told how long it will take, and of each step.
    Returns: The copy, in evaluation mode.
    Raises: TrainingError if a loss is no number any more.
    Source: fine-tuning on one person as few-shot talking heads do (Zakharov et al., ICCV 2019);
        what is held is distilled from the model itself, as in learning without forgetting (Li and
        Hoiem, ECCV 2016).
    """
    keep_memory()
    began = time.perf_counter()
    lessons = Lessons(model, pictures, poses, settings)
    learner = deepcopy(model).requires_grad_(False)
    learning = learner.render_net.layers[first_learned(model) :].requires_grad_(True)
    arrange(learner.render_net, judge)
    optimiser = torch.optim.Adam(learning.parameters(), settings.learning_rate, betas=(0.5, 0.999))
    prepared = time.perf_counter()
    for step, batch in zip(range(settings.steps), lessons, strict=False):
        for group in optimiser.param_groups:
            group["lr"] = settings.learning_rate * anneal(step / settings.steps)
        loss = generator_loss(_judge(learner, batch, judge), WEIGHTS)
        if not loss.isfinite():
            raise TrainingError(
                f"the loss is {float(loss.detach())} at step {step}; a photo or its IUV may be"
                " damaged, or the weights are"
            )
        loss.backward()
        optimiser.step()
        optimiser.zero_grad()
        if step + 1 == min(TIMED_STEPS, settings.steps):
            now = time.perf_counter()
            _announce((prepared - began) + (now - prepared) / (step + 1) * settings.steps, listener)
            listener(Stage("adapt", settings.steps))
            listener(FramesDone(step + 1))
        elif step >= TIMED_STEPS:
            listener(FramesDone(1))
    return learner.requires_grad_(False).eval()


def first_learned(model: NeuralReRenderer) -> int:
    """Tell which of RenderNet's layers is the first that learns: the one after its last block."""
    layers = list(model.render_net.layers)
    return 1 + max(at for at, layer in enumerate(layers) if isinstance(layer, ResidualBlock))


def anneal(progress: float) -> float:
    """Tell the share of the learning rate: it rises in a line, then falls along a cosine to 0."""
    if progress < WARM_UP:
        return 0.1 + 0.9 * progress / WARM_UP
    return (1 + math.cos(math.pi * (progress - WARM_UP) / (1 - WARM_UP))) / 2


def _judge(model: NeuralReRenderer, batch: Batch, judge: FeatureNetwork) -> Terms:
    """Draw a lesson, and compare it with what it should look like."""
    with torch.no_grad():
        feature_image = model.feature_image(
            batch["feature_map"], batch["target_iuv"], batch.get("detail")
        )
    drawn = model.blend(model.render_net(feature_image), feature_image)
    colours, alpha = lay_over_white(drawn), drawn[:, 3:]
    if "learned" in batch:  # elsewhere nothing is asked of the colours
        colours = torch.where(batch["learned"], colours, batch["target_image"])
    image = Drawn(batch["feature_map"], feature_image, torch.cat([colours, alpha], dim=1))
    judges = Judges(perceptual=judge)
    terms = generator_terms(batch, image, judges, None, heads=True)
    halves = {"target_image": F.avg_pool2d(batch["target_image"], 2)}
    half = image._replace(image=F.avg_pool2d(colours, 2))
    coarse: Tensor = generator_terms(halves, half, judges, None)["perceptual"]
    return {**terms, "perceptual": terms["perceptual"] + COARSE_SHARE * coarse}


def _announce(seconds: float, listener: Listener) -> None:
    if seconds > LONG_SECONDS:
        minutes = max(1, round(seconds / 60))
        listener(
            Notice(
                f"learning the person takes about {minutes} minute{'s' * (minutes > 1)} here; later"
                " runs with the same photos find it done"
            )
        )
