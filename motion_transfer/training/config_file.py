"""`train.toml`: settings from text, with every key checked, and back to text."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError
from motion_transfer.media.image import read_bytes
from motion_transfer.training.config import PEOPLE, PEOPLE_RECIPE, TrainConfig
from nhrr_core import ConfigError, ModelConfig
from nhrr_core.config import PRESETS

SECTIONS = {section.name: section for section in fields(TrainConfig)}
DEFAULT_PRESET = "lite"
FREE_TO_CHANGE = ("colour_margin", "clearance", "geometry")
"""Settings of the model that a run may turn on, whatever it starts from."""


def read_settings(path: Path) -> dict[str, Any]:
    """The keys of a `train.toml` as `section.key`, all of them known.

    Raises: InputError naming file, line of the section and key.
    """
    try:
        text = read_bytes(path, "configuration").decode()
        tables = tomllib.loads(text)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"configuration {path} is not TOML: {error}") from error
    settings = {}
    for section, table in tables.items():
        where = f"configuration {path}{_line_of(text, section)}"
        if not isinstance(table, dict):
            raise InputError(f"{where}: {section} stands outside a section")
        for key, value in table.items():
            try:
                settings[f"{section}.{key}"] = check_value(f"{section}.{key}", value)
            except InputError as error:
                raise InputError(f"{where}, [{section}]: {error}") from error
    return settings


def parse_assignment(text: str) -> tuple[str, Any]:
    """`section.key=value` of the command line; the value as in TOML, or bare words.

    Raises: InputError.
    """
    name, equals, word = text.partition("=")
    if not equals:
        raise InputError(f"{text!r} sets nothing; write section.key=value")
    try:
        value = tomllib.loads(f"value = {word}")["value"]
    except tomllib.TOMLDecodeError:
        value = word
    return name.strip(), check_value(name.strip(), value)


def check_value(name: str, value: Any) -> Any:
    """The value of `section.key`, of the type that it has. Raises: InputError."""
    section, _, key = name.partition(".")
    if section not in SECTIONS:
        raise InputError(f"unknown section {section!r}; there are {', '.join(SECTIONS)}")
    defaults = _defaults(section)
    if key not in defaults:
        raise InputError(f"unknown key {key!r}; [{section}] has {', '.join(defaults)}")
    wanted = type(defaults[key])
    if wanted is float and type(value) is int:
        return float(value)
    if type(value) is not wanted:
        raise InputError(f"{name} is {value!r}; it must be of type {wanted.__name__}")
    return value


def build_config(settings: Mapping[str, Any], *, model: ModelConfig | None = None) -> TrainConfig:
    """A configuration from `section.key` settings; what is not set has its default.

    Args:
        model: the networks' shape where a checkpoint already decides it.
    Raises: InputError on impossible values, or on settings that contradict that checkpoint.
    """
    settings = dict(settings)
    if settings.get("data.source", PEOPLE) == PEOPLE:
        recipe = dict(PEOPLE_RECIPE)
        if model is not None:  # its checkpoint has decided that
            del recipe["model.alpha"]
        settings = {**recipe, **settings}
    values = {
        section: {
            name.partition(".")[2]: value
            for name, value in settings.items()
            if name.startswith(f"{section}.")
        }
        for section in SECTIONS
    }
    sections = {
        name: type(getattr(TrainConfig(), name))(**values[name])
        for name in SECTIONS
        if name != "model"
    }
    return TrainConfig(model=_build_model(values["model"], model), **sections)


def write_toml(config: TrainConfig) -> str:
    """The whole configuration as TOML, every key of every section."""
    lines = []
    for section in SECTIONS:
        lines.append(f"[{section}]")
        for key, value in asdict(getattr(config, section)).items():
            lines.append(f"{key} = {_toml(value)}")
        lines.append("")
    return "\n".join(lines)


def _build_model(values: dict[str, Any], given: ModelConfig | None) -> ModelConfig:
    preset = values.pop("preset", DEFAULT_PRESET)
    try:
        if given is None:
            return ModelConfig.preset(preset, **values)
        given = replace(given, **{name: values[name] for name in FREE_TO_CHANGE if name in values})
        other = [name for name, value in values.items() if getattr(given, name) != value]
        if other:
            raise InputError(
                f"model.{other[0]} is {values[other[0]]!r}, but the weights to start from have"
                f" {getattr(given, other[0])!r}; leave it out, or start from others"
            )
        return given
    except ConfigError as error:
        raise InputError(f"[model]: {error}") from error


def _defaults(section: str) -> dict[str, Any]:
    if section == "model":
        return {"preset": DEFAULT_PRESET, **asdict(PRESETS[DEFAULT_PRESET])}
    return asdict(getattr(TrainConfig(), section))


def _line_of(text: str, section: str) -> str:
    pattern = re.compile(
        rf"^\s*(\[\s*\"?{re.escape(section)}\"?\s*\]|\"?{re.escape(section)}\"?\s*[.=])"
    )
    for number, line in enumerate(text.splitlines(), start=1):
        if pattern.match(line):
            return f", line {number}"
    return ""


def _toml(value: bool | int | float | str) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else repr(value)
