"""What a training run is: every setting, with the paper's values where the paper gives one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any, Literal, get_args

from motion_transfer.errors import InputError
from motion_transfer.render.options import parse_colour
from nhrr_core import LossWeights, ModelConfig

Perceptual = Literal["efficientnet-lite0", "vgg19", "none"]
Identity = Literal["sphereface", "none"]
Precision = Literal["auto", "fp32", "bf16"]
CHOICES: dict[str, tuple[str, ...]] = {
    "perceptual": get_args(Perceptual),
    "identity": get_args(Identity),
    "precision": get_args(Precision),
}

PEOPLE = "people"
PEOPLE_RECIPE: dict[str, Any] = {
    "model.alpha": True,
    "losses.identity": "none",
    "losses.adversarial_from": 0.85,
    "optimiser.half_size": 0.7,
}
"""What synthetic people change: they come with alpha, and are trained on without any file, on
whatever machine there is. Departs from the paper: no face identity loss, as no weights of
SphereFace may be shipped; most steps are made at half size, and the discriminator joins late."""


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """How long, and what is said of the weights.

    Attributes:
        steps: updates of the networks, in all.
        seed: of the initial weights, the order of the pairs and the jitter of the crops.
        init: checkpoint to start from (fine-tuning); empty: from random weights.
        licence: of the weights, stored with them.
    """

    steps: int = 100_000
    seed: int = 0
    init: str = ""
    licence: str = "not stated"


@dataclass(frozen=True, kw_only=True)
class DataSettings:
    """What is learned from.

    Attributes:
        source: `people`, a CSV of pairs, a folder with `pairs.csv`, a folder of clips, or a folder
            of one person's photos.
        images: folder that a CSV's names are relative to; empty: the CSV's own.
        background: colour behind targets whose alpha is known; `photo`: leave them as they are.
        jitter: by up to which share of its side a crop is larger than the renderer's, and shifted
            within that; a driver's crop holds all of its poses and is larger, too.
        people, views, size_px: how many synthetic people, photos of each, and their side; 0
            people: ever new ones, two photos each, made while training goes on.
        people_seed: who they are, if they are kept; `run.seed` decides the order of their pairs.
        noise: share of the photos of people whose IUV has the faults of DensePose's.
        people_cache: folder that keeps them; empty: `people` in the run's.
        moments: frames of a clip that are targets, two in a row for each.
        skip_broken: leave pairs with a problem out.
    """

    source: str = PEOPLE
    images: str = ""
    background: str = "white"
    jitter: float = 0.15
    people: int = 64
    views: int = 4
    size_px: int = 256
    people_seed: int = 0
    noise: float = 0.5
    people_cache: str = ""
    moments: int = 8
    skip_broken: bool = False


@dataclass(frozen=True, kw_only=True)
class LossSettings:
    """Which losses, with which weights and networks.

    Attributes:
        perceptual, identity: the network, or `none` to leave the loss out.
        vgg19_file: empty: where torchvision keeps it.
        adversarial_from: share of the steps after which the discriminator joins.
        *_weight: the lambdas. Source: the paper, Sec. 3.5; alpha's is this project's.
    """

    perceptual: Perceptual = "efficientnet-lite0"
    vgg19_file: str = ""
    identity: Identity = "sphereface"
    sphereface_file: str = ""
    adversarial: bool = True
    adversarial_from: float = 0.0
    discriminator_width: int = 64
    discriminator_scales: int = 3
    perceptual_weight: float = 10.0
    adversarial_weight: float = 1.0
    identity_weight: float = 5.0
    texture_weight: float = 1.0
    alpha_weight: float = 10.0

    @property
    def weights(self) -> LossWeights:
        """The lambdas, for `nhrr_core.generator_loss`."""
        return LossWeights(
            perceptual=self.perceptual_weight,
            adversarial=self.adversarial_weight,
            identity=self.identity_weight,
            texture=self.texture_weight,
            alpha=self.alpha_weight,
        )


@dataclass(frozen=True, kw_only=True)
class OptimiserSettings:
    """Adam, for both players. Source: the paper, Sec. 3.5; batch and average are this project's.

    Attributes:
        decay_from: share of the steps after which the learning rate falls in a straight line, to
            nothing after the last one; 1: it stays as it is. Source: Pix2PixHD, where it is 0.5;
            the paper says nothing of it.
        batch_size: pairs at once on each device.
        accumulation: batches whose gradients make one step.
        ema_decay: of the averaged weights, which are what is exported; 0: no average.
        half_size: share of the steps, the first ones, at half the sides of textures and images: a
            quarter of the work.
        inpainting: share of the steps that are the first stage of `ip`.
    """

    learning_rate: float = 2e-4
    decay_from: float = 1.0
    beta1: float = 0.5
    beta2: float = 0.999
    batch_size: int = 4
    accumulation: int = 1
    ema_decay: float = 0.999
    half_size: float = 0.0
    inpainting: float = 0.5


@dataclass(frozen=True, kw_only=True)
class SpeedSettings:
    """What changes the time a run takes, and its results only in the last digits.

    Attributes:
        precision: `auto` is bf16 where the hardware multiplies it, else fp32.
        workers: processes that read data; -1: half of the cores, at most 4; 0: none.
    """

    precision: Precision = "auto"
    compile: bool = False
    workers: int = -1


@dataclass(frozen=True, kw_only=True)
class KeepingSettings:
    """What is left on the disk, and how often, in steps; 0: never.

    Attributes:
        checkpoint_every: also written at the end and when the run is stopped.
        keep_last: checkpoints kept.
        keep_every: those at multiples of it are kept for good.
        sample_every: sample grids of `samples` pairs.
        log_every: a line, and scalars for TensorBoard.
        textures: folder that keeps unfolded textures, which runs on the same photos may share;
            empty: `textures` in the run's.
    """

    checkpoint_every: int = 250
    keep_last: int = 2
    keep_every: int = 10_000
    sample_every: int = 250
    samples: int = 4
    log_every: int = 10
    textures: str = ""
    tensorboard: bool = True


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """Everything about a run. Raises: InputError naming the key whose value is impossible."""

    run: RunSettings = field(default_factory=RunSettings)
    model: ModelConfig = field(default_factory=lambda: ModelConfig.preset("lite"))
    data: DataSettings = field(default_factory=DataSettings)
    losses: LossSettings = field(default_factory=LossSettings)
    optimiser: OptimiserSettings = field(default_factory=OptimiserSettings)
    speed: SpeedSettings = field(default_factory=SpeedSettings)
    keeping: KeepingSettings = field(default_factory=KeepingSettings)

    def __post_init__(self) -> None:
        for section in fields(self):
            for key in fields(getattr(self, section.name)):
                value = getattr(getattr(self, section.name), key.name)
                problem = _find_problem(key.name, value)
                if problem:
                    raise InputError(
                        f"{section.name}.{key.name} is {value!r}; it must be {problem}"
                    )
        parse_colour(self.data.background)
        if self.optimiser.half_size:
            for key, multiple in (("image_size", 2**self.model.down_blocks), ("texture_size", 16)):
                side = getattr(self.model, key)
                if side % (2 * multiple):
                    raise InputError(
                        f"optimiser.half_size is {self.optimiser.half_size}, but half of"
                        f" model.{key}, {side}, is no multiple of {multiple}; set half_size to 0"
                    )

    @property
    def half_size_steps(self) -> int:
        """Steps at half the sides."""
        return round(self.run.steps * self.optimiser.half_size)

    @property
    def adversarial_start(self) -> int:
        """Steps before the discriminator joins."""
        return round(self.run.steps * self.losses.adversarial_from)

    def learning_rate(self, step: int) -> float:
        """Of the update after `step` others."""
        steps, constant = self.run.steps, self.run.steps * self.optimiser.decay_from
        left = min(1.0, (steps - step) / (steps - constant)) if constant < steps else 1.0
        return self.optimiser.learning_rate * left

    @property
    def inpainting_steps(self) -> int:
        """Steps of the first stage; 0 for all variants but `ip`."""
        if self.model.variant != "ip":
            return 0
        return round(self.run.steps * self.optimiser.inpainting)

    @property
    def uses_texture_loss(self) -> bool:
        """The warps learn no texture, and No-Int leaves its loss out."""
        return self.model.variant in ("full", "ip")


LOWEST = {
    **dict.fromkeys(("steps", "batch_size", "accumulation", "keep_last", "samples", "moments"), 1),
    **dict.fromkeys(("discriminator_width", "discriminator_scales", "log_every"), 1),
    "views": 2,
    "size_px": 32,
    "workers": -1,
}
SHARES = ("beta1", "beta2", "ema_decay")
WHOLE_SHARES = ("noise", "adversarial_from", "decay_from", "half_size", "inpainting")


def _find_problem(key: str, value: Any) -> str | None:
    """What a value must be, if it is not."""
    if key in CHOICES and value not in CHOICES[key]:
        return " or ".join(CHOICES[key])
    if isinstance(value, bool | str):
        return None
    low = LOWEST.get(key, 0)
    if not math.isfinite(value) or value < low:
        return f"{low} or more"
    if key in SHARES and value >= 1:
        return "below 1"
    if key in WHOLE_SHARES and value > 1:
        return "at most 1"
    return None
