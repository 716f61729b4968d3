"""The settings of a training run, a dataclass for each section of `train.toml`.

A field's annotation says which values are possible, as pydantic checks them, and `option` describes
it where the command line has it. Defaults are the paper's where the paper gives one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from motion_transfer.option import option

if TYPE_CHECKING:
    from nhrr_core import LossWeights

Count = Annotated[int, Field(ge=1)]
Number = Annotated[int, Field(ge=0)]
Factor = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Decay = Annotated[float, Field(ge=0, lt=1)]
Perceptual = Literal["efficientnet-lite0", "vgg19", "none"]
Identity = Literal["sphereface", "dlib", "none"]
AUTO = "auto"
Precision = Literal["auto", "fp32", "bf16"]

LOSSES = "Losses (the paper's; one without its network is an error)"
DEFAULT_PRESET = "lite"
PEOPLE = "people"
"""The data set that is painted while training goes on, or before."""


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """How long a run is, where it starts, and what is said of its weights."""

    steps: Count = option(
        "--steps", "Run", "Updates in all; default 100000.", kind="integer", default=100_000
    )
    minutes: Factor = option(
        "--minutes",
        "Run",
        "Train for so long instead of so many steps.",
        kind="number",
        default=0.0,
        metavar="M",
    )
    seed: Number = option(
        "--seed", "Run", "Of weights, order and crops; default 0.", kind="integer", default=0
    )
    init: str = option(
        "--init", "Model", "Weights to start from, for fine-tuning.", default="", metavar="FILE"
    )
    licence: str = option(
        "--licence", "Run", "Of the weights, stored with them.", default="not stated"
    )


@dataclass(frozen=True, kw_only=True)
class ModelSettings:
    """What the command line has of [model], whose other keys are those of `ModelConfig`."""

    preset: str = option(
        "--preset",
        "Model",
        "Sizes of the networks; default lite.",
        default=DEFAULT_PRESET,
        metavar="lite|paper",
    )
    variant: str = option(
        "--variant",
        "Model",
        "full (default), no-int, ip, warp, warp-cond, texture-features, cbi or dpt.",
        metavar="NAME",
    )


@dataclass(frozen=True, kw_only=True)
class DataSettings:
    """What is learned from.

    Attributes:
        background: The colour behind targets whose alpha is known; `photo` leaves them as they are.
        jitter: By up to which share of its side a crop is larger than the renderer's, and shifted
            within that; a driver's crop holds all of its poses and is larger, too.
        people: 0: ever new ones, painted while training goes on.
        views: Photos of each, `size_px` high and wide.
        pool: How many of the ever new ones are kept, as far as there is memory.
        draws: How often each of them is drawn on average, before painters go on; by default as
            often as there are ordered pairs of its views.
        people_seed: Who they are, if they are kept; `run.seed` decides the order of their pairs.
        noise: The share of the photos of people whose IUV has the faults of DensePose's.
        moments: Frames of a clip that are targets, two in a row for each.
    """

    source: str = option(
        "--data",
        "Data",
        "Synthetic people (default); a CSV of pairs from,to; a folder with pairs.csv, of clips"
        " with their IUV, or of one person's photos.",
        default=PEOPLE,
        metavar="people|CSV|FOLDER",
    )
    images: str = option(
        "--images", "Data", "Folder that a CSV's names are relative to; else the CSV's.", default=""
    )
    background: str = "white"
    jitter: Factor = 0.15
    people: Number = option(
        "--people", "Data", "How many; default 64, 0 for ever new ones.", kind="integer", default=64
    )
    views: Annotated[int, Field(ge=2)] = 4
    pool: Count = 8192
    draws: Count = 12
    size_px: Annotated[int, Field(ge=32)] = 256
    people_seed: Number = 0
    noise: Share = 0.5
    people_cache: str = option(
        "--people-cache",
        "Data",
        "Folder that keeps them; default RUN/people.",
        default="",
        metavar="DIR",
    )
    assets: str = option(
        "--assets",
        "Data",
        "Folder of MakeHuman's assets: people in photographed clothes; else MT_ASSETS.",
        default="",
        metavar="DIR",
    )
    free_share: Share = option(
        "--free",
        "Data",
        "Share of people who wear them; default 0.5.",
        kind="number",
        default=0.5,
        metavar="SHARE",
    )
    moments: Count = 8
    skip_broken: bool = option(
        "--skip-broken", "Data", "Leave out pairs with a problem.", kind="flag", default=False
    )


@dataclass(frozen=True, kw_only=True)
class LossSettings:
    """Which losses, with which weights and networks.

    Attributes:
        perceptual, identity: `none` leaves the loss out.
        vgg19_file: Empty: where torchvision keeps it.
        adversarial_from: The share of the run after which the discriminator joins.
        *_weight: The lambdas. Source: the paper, Sec. 3.5; alpha's and head's are this project's,
            matching's is Pix2PixHD's.
        r1_weight: Gamma, of the penalty on the discriminator's gradient (`nhrr_core.r1_penalty`).
    """

    perceptual: Perceptual = option(
        "--perceptual",
        LOSSES,
        "efficientnet-lite0 (default) or vgg19 (the paper's, from torchvision's cache).",
        default="efficientnet-lite0",
        metavar="NAME",
    )
    vgg19_file: str = option(
        "--vgg19", LOSSES, "VGG-19's weights; chooses it as well.", default="", metavar="FILE"
    )
    identity: Identity = option(
        "--identity",
        LOSSES,
        "sphereface (the paper's) or dlib (from `mt models fetch --faces`).",
        default="sphereface",
        metavar="NAME",
    )
    sphereface_file: str = option(
        "--sphereface", LOSSES, "Weights for the face loss.", default="", metavar="FILE"
    )
    adversarial: bool = True
    adversarial_from: Share = 0.0
    discriminator_width: Count = 64
    discriminator_scales: Count = 3
    perceptual_weight: Factor = 10.0
    adversarial_weight: Factor = 1.0
    identity_weight: Factor = 5.0
    texture_weight: Factor = 1.0
    alpha_weight: Factor = 10.0
    head_weight: Factor = 0.0
    matching_weight: Factor = 0.0
    r1_weight: Factor = 0.0

    @property
    def weights(self) -> LossWeights:
        """The lambdas, for `nhrr_core.generator_loss`."""
        from nhrr_core import LossWeights

        names = [entry.name for entry in fields(LossWeights)]
        return LossWeights(**{name: getattr(self, f"{name}_weight") for name in names})


@dataclass(frozen=True, kw_only=True)
class OptimiserSettings:
    """Adam, for both players. Source: the paper, Sec. 3.5; batch and average are this project's.

    Attributes:
        decay_from: The share of the run after which the learning rate falls in a straight line,
            to nothing at the end; 1: it stays as it is. Source: Pix2PixHD, where it is 0.5; the
            paper says nothing of it.
        accumulation: Batches whose gradients make one step.
        ema_decay: Of the averaged weights, which are what is exported; 0: no average.
        half_size: The share of the run, its beginning, at half the sides of textures and images:
            a quarter of the work.
        inpainting: The share of the run in which FeatureNet of `ip`, `cbi`, `dpt` learns alone.
    """

    learning_rate: Factor = 2e-4
    decay_from: Share = 1.0
    beta1: Decay = 0.5
    beta2: Decay = 0.999
    batch_size: Count = option(
        "--batch-size",
        "Speed",
        "Pairs at once on each device; default 4, with people on a GPU 48.",
        kind="integer",
        default=4,
    )
    accumulation: Count = 1
    ema_decay: Decay = 0.999
    half_size: Share = 0.0
    inpainting: Share = 0.5


@dataclass(frozen=True, kw_only=True)
class SpeedSettings:
    """What changes the time a run takes, and its results only in the last digits.

    Attributes:
        device: `cpu`, `cuda`, `cuda:1` or `mps`; `auto`: CUDA devices where there are any, else
            the CPU.
        precision: `auto` is bf16 where the hardware multiplies it, else fp32.
        workers: -1: half of the cores, at most 4, or all but one for ever new people beside a GPU;
            0: the process that trains reads, or paints, as well.
    """

    device: str = option(
        "--device",
        "Speed",
        "cpu, cuda, cuda:1 or mps (Apple's GPUs); default: cuda where it is.",
        default=AUTO,
        metavar="NAME",
    )
    precision: Precision = "auto"
    compile: bool = option(
        "--compile/--no-compile", "Speed", "Compile; default: no.", kind="switch", default=False
    )
    workers: Annotated[int, Field(ge=-1)] = option(
        "--workers",
        "Speed",
        "Processes that read or paint; default: half of the cores, or all but one for a GPU.",
        kind="integer",
        default=-1,
    )

    @property
    def wish(self) -> str | None:
        """The device that is asked for; None: the fastest here."""
        return None if self.device == AUTO else self.device


@dataclass(frozen=True, kw_only=True)
class KeepingSettings:
    """What is left on the disk, and how often, in steps; 0: never.

    Attributes:
        checkpoint_every: One is also written at the end and when the run is stopped.
        keep_last: Checkpoints kept.
        keep_every: Those at multiples of it are kept for good.
        sample_every: Sample grids of `samples` pairs.
        log_every: A line, and scalars for TensorBoard.
        textures: The folder that keeps unfolded textures, which runs on the same photos may share;
            empty: `textures` in the run's.
    """

    checkpoint_every: Number = 250
    keep_last: Count = 2
    keep_every: Number = 10_000
    sample_every: Number = 250
    samples: Count = 4
    log_every: Count = 10
    textures: str = ""
    tensorboard: bool = True
