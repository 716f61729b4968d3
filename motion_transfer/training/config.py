"""What a training run is: all its settings, and `train.toml`, the file that holds them.

A setting, `section.key`, is a field of one of the dataclasses of `settings`. What needs torch is
imported where it is used, so that help is instant.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

from pydantic import TypeAdapter, ValidationError

from motion_transfer.devices import check_device
from motion_transfer.errors import InputError
from motion_transfer.option import parse_colour
from motion_transfer.training.settings import (
    DEFAULT_PRESET,
    PEOPLE,
    DataSettings,
    KeepingSettings,
    LossSettings,
    ModelSettings,
    OptimiserSettings,
    RunSettings,
    SpeedSettings,
)

if TYPE_CHECKING:
    from nhrr_core import ModelConfig

FREE_TO_CHANGE = ("colour_margin", "clearance", "geometry", "prior", "even", "bilinear")
"""Settings of the model that a run may turn on, whatever it starts from."""

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
