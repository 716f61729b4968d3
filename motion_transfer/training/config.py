"""What a training run is: its settings, and `train.toml`, the file that holds all of them.

A setting, `section.key`, is a field of one of the dataclasses below. Its annotation says which
values are possible, as pydantic checks them, and `option` describes it where the command line has
it. Defaults are the paper's where the paper gives one. What needs torch is imported where it is
used, so that help is instant.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

from pydantic import Field, TypeAdapter, ValidationError

from motion_transfer.devices import check_device
from motion_transfer.errors import InputError
from motion_transfer.option import option, parse_colour

if TYPE_CHECKING:
    from nhrr_core import LossWeights, ModelConfig

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
FREE_TO_CHANGE = ("colour_margin", "clearance", "geometry", "prior", "even", "bilinear")
"""Settings of the model that a run may turn on, whatever it starts from."""

PEOPLE = "people"
PEOPLE_RECIPE: dict[str, Any] = {
    "model.alpha": True,
    "losses.identity": "none",
    "losses.head_weight": 3.0,
    "losses.matching_weight": 4.0,
    "losses.r1_weight": 0.002,
    "losses.adversarial_from": 0.85,
    "optimiser.half_size": 0.7,
}
"""What synthetic people change: they come with alpha, and are trained on without any file, on
whatever machine there is. Departs from the paper: no face identity loss, as no weights of
SphereFace may be shipped; most steps are made at half size, and the discriminator joins late. It is
held by feature matching, weighted so that this is about as large a term as the perceptual one (0.16
to 0.20 before, when a new discriminator meets `lite`), and by R1, as weak as in LaMa (Suvorov et
al., WACV 2022: 0.001 without the half), whose discriminator is Pix2PixHD's, too."""

GPU_RECIPE: dict[str, Any] = {
    "optimiser.batch_size": 48,
    "optimiser.learning_rate": 4e-4,
    "optimiser.decay_from": 2 / 3,
    "optimiser.ema_decay": 0.998,
}
"""What people change besides on a GPU. In a trial of 430 s on one H100 this batch filled it, at 210
samples a second; the average forgets in as many seconds as one of 0.999 does with smaller ones."""


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


SECTIONS: dict[str, type] = {
    "run": RunSettings,
    "model": ModelSettings,
    "data": DataSettings,
    "losses": LossSettings,
    "optimiser": OptimiserSettings,
    "speed": SpeedSettings,
    "keeping": KeepingSettings,
}


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """Everything about a run. Raises: InputError naming the key whose value is impossible."""

    run: RunSettings = field(default_factory=RunSettings)
    model: ModelConfig = field(default_factory=lambda: _build_model({}, None))
    data: DataSettings = field(default_factory=DataSettings)
    losses: LossSettings = field(default_factory=LossSettings)
    optimiser: OptimiserSettings = field(default_factory=OptimiserSettings)
    speed: SpeedSettings = field(default_factory=SpeedSettings)
    keeping: KeepingSettings = field(default_factory=KeepingSettings)

    def __post_init__(self) -> None:
        for section in SECTIONS:
            for key, value in vars(getattr(self, section)).items():
                check_value(f"{section}.{key}", value)
        parse_colour(self.data.background)
        if self.speed.wish is not None:
            check_device(self.speed.wish)
        if self.optimiser.half_size:
            # FeatureNet's four down blocks halve a texture to a sixteenth
            for key, multiple in (("image_size", 2**self.model.down_blocks), ("texture_size", 16)):
                side = getattr(self.model, key)
                if side % (2 * multiple):
                    raise InputError(
                        f"optimiser.half_size is {self.optimiser.half_size}, but half of"
                        f" model.{key}, {side}, is no multiple of {multiple}; set half_size to 0"
                    )

    def progress(self, step: int, seconds: float) -> float:
        """Tell the share of the run that is done after so many steps, or so long; from 0 to 1.

        The clock counts where `run.minutes` are given, steps otherwise.
        """
        if self.run.minutes:
            return min(1.0, seconds / (self.run.minutes * 60))
        return min(1.0, step / self.run.steps)

    @property
    def half_size_steps(self) -> int:
        """Steps at half the sides, where steps count."""
        return round(self.run.steps * self.optimiser.half_size)

    def is_adversarial(self, progress: float) -> bool:
        """Tell whether the discriminator takes part by then."""
        return progress >= self.losses.adversarial_from

    def is_inpainting(self, progress: float) -> bool:
        """Tell whether FeatureNet is trained alone by then, as `ip`, `cbi` and `dpt` begin."""
        return self.model.inpaints_first and progress < self.optimiser.inpainting

    def learning_rate(self, progress: float) -> float:
        """Compute the learning rate of the update before which that share of the run is done."""
        falling = 1 - self.optimiser.decay_from
        left = min(1.0, (1 - progress) / falling) if falling else 1.0
        return self.optimiser.learning_rate * left


def read_settings(path: Path) -> dict[str, Any]:
    """Read the keys of a `train.toml` as `section.key`, all of them known.

    Raises: InputError naming file, line, section and key.
    """
    from motion_transfer.media.structured import parse_structured, read_text, shown_name

    where = f"configuration {path}"
    text = parse_structured(read_text(path, "configuration"), ".toml", where)
    settings = {}
    for section, table in text.data.items():
        name = shown_name(section)
        if not isinstance(table, dict):
            line = text.line((section,))
            raise InputError(f"{where}, line {line}: {name} stands outside a section")
        for key, value in table.items():
            try:
                settings[f"{section}.{key}"] = check_value(f"{section}.{key}", value)
            except InputError as error:
                line = text.line((section, key) if section in SECTIONS else (section,))
                raise InputError(f"{where}, line {line}, [{name}]: {error}") from error
    return settings


def parse_assignment(text: str) -> tuple[str, Any]:
    """Read `section.key=value` of the command line; the value as in TOML, or bare words.

    Raises: InputError.
    """
    from motion_transfer.media.structured import parse_structured

    name, equals, word = text.partition("=")
    if not equals:
        raise InputError(f"{text!r} sets nothing; write section.key=value")
    try:
        value = parse_structured(f"value = {word}", ".toml", name).data["value"]
    except InputError:
        value = word
    return name.strip(), check_value(name.strip(), value)


def check_value(name: str, value: Any) -> Any:
    """Check the value of `section.key`; a whole number becomes a float where one is meant.

    Raises: InputError naming section and key, the value, and what it must be.
    """
    from motion_transfer.media.structured import shown

    section, _, key = name.partition(".")
    if section not in SECTIONS:
        raise InputError(f"unknown section {shown(section)}; there are {', '.join(SECTIONS)}")
    kinds = _kinds(section)
    if key not in kinds:
        raise InputError(f"unknown key {shown(key)}; [{section}] has {', '.join(kinds)}")
    try:
        return kinds[key].validate_python(value, strict=True)
    except ValidationError as error:
        wanted = error.errors()[0]["msg"].removeprefix("Input should be ")
        raise InputError(f"{name} is {shown(value)}; it must be {wanted}") from None


def build_config(settings: Mapping[str, Any], *, model: ModelConfig | None = None) -> TrainConfig:
    """Build a configuration from `section.key` settings; what is not set has its default.

    Args:
        model: The networks' shape where a checkpoint already decides it.
    Raises: InputError on impossible values, or on settings that contradict that checkpoint.
    """
    settings = dict(settings)
    if settings.get("data.source", PEOPLE) == PEOPLE:
        recipe = dict(PEOPLE_RECIPE)
        if model is not None:  # its checkpoint has decided that
            del recipe["model.alpha"]
        settings = {**recipe, **settings}
    values: dict[str, dict[str, Any]] = {section: {} for section in SECTIONS}
    for name, value in settings.items():
        section, _, key = name.partition(".")
        values[section][key] = value
    shape = _build_model(values.pop("model"), model)
    return TrainConfig(model=shape, **{name: SECTIONS[name](**values[name]) for name in values})


def write_toml(config: TrainConfig) -> str:
    """Write the whole configuration as TOML, every key of every section."""
    lines = []
    for section in SECTIONS:
        lines.append(f"[{section}]")
        for key, value in asdict(getattr(config, section)).items():
            lines.append(f"{key} = {_toml(value)}")
        lines.append("")
    return "\n".join(lines)


def _build_model(values: dict[str, Any], given: ModelConfig | None) -> ModelConfig:
    from nhrr_core import ConfigError, ModelConfig

    preset = values.pop("preset", DEFAULT_PRESET)
    try:
        if given is None:
            return ModelConfig.preset(preset, **values)
        given = replace(given, **{name: values[name] for name in FREE_TO_CHANGE if name in values})
    except ConfigError as error:
        raise InputError(f"[model]: {error}") from error
    for name, value in values.items():
        if getattr(given, name) != value:
            raise InputError(
                f"model.{name} is {value!r}, but the weights to start from have"
                f" {getattr(given, name)!r}; leave it out, or start from others"
            )
    return given


@cache
def _kinds(section: str) -> dict[str, TypeAdapter[Any]]:
    """What checks the value of each key of a section."""
    hints = get_type_hints(SECTIONS[section], include_extras=True)
    if section == "model":  # sizes depend on each other: `ModelConfig` checks their bounds
        from nhrr_core import ModelConfig

        hints |= get_type_hints(ModelConfig)
    return {key: TypeAdapter(hint) for key, hint in hints.items()}


def _toml(value: bool | int | float | str) -> str:
    if isinstance(value, str):
        # TOML's strings are JSON's but for DEL, which has to be escaped
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else repr(value)
