"""Run folders: begun anew, or gone on with.

RUN/train.toml          every setting
RUN/checkpoints/        see `motion_transfer.training.checkpoints`
RUN/samples/            step_000250.png: source, drawn, target
RUN/tensorboard/        scalars and sample grids
RUN/textures/           unfolded once
RUN/people/             synthetic people, where those are the data
RUN/weights.safetensors for `mt run`, when the run ends or is stopped
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.devices import find_device
from motion_transfer.errors import InputError, OutputError, WeightsError
from motion_transfer.extras import require_extra
from motion_transfer.media.growing import write_whole
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.training.config import (
    GPU_RECIPE,
    TrainConfig,
    build_config,
    read_settings,
    write_toml,
)
from motion_transfer.training.pairs import Done, ignore_done
from motion_transfer.training.progress import Listener
from motion_transfer.training.settings import AUTO, PEOPLE, SpeedSettings
from motion_transfer.training.sources import open_training_data
from motion_transfer.training.step import load_judges
from motion_transfer.weights import SHIPPED, find_weights
from motion_transfer.weights.checkpoint import load_checkpoint
from nhrr_core import NeuralReRenderer
from nhrr_core.config import PRESETS

if TYPE_CHECKING:  # it needs the `train` extra
    from motion_transfer.training.trainer import Trainer

CONFIG_FILE = "train.toml"
MAY_CHANGE = ("run.steps", "run.minutes", "run.licence", "data.people_cache", "speed.", "keeping.")
"""What a run that goes on may have otherwise than it began."""


@dataclass(frozen=True)
class PlannedRun:
    """A run folder, its configuration, and the weights that it starts from, if any."""

    folder: Path
    config: TrainConfig
    init: NeuralReRenderer | None


def plan_new_run(folder: Path, settings: Mapping[str, Any]) -> PlannedRun:
    """Plan a run that begins.

    Args:
        settings: By `section.key`, see `motion_transfer.training.config`.
    Raises: OutputError if the folder holds something; InputError.
    """
    if is_first_process() and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputError(
            f"{folder} exists already; go on with it by mt train --resume {folder}, or choose"
            " another name"
        )
    init = _load_init(str(settings["run.init"])) if settings.get("run.init") else None
    wish = SpeedSettings(device=str(settings.get("speed.device", AUTO))).wish
    on_cuda = find_device(wish).startswith("cuda")
    if settings.get("data.source", PEOPLE) == PEOPLE and on_cuda:
        settings = {**GPU_RECIPE, **settings}
    return PlannedRun(folder, build_config(settings, model=init and init.config), init)


def plan_resumed_run(folder: Path, changes: Mapping[str, Any]) -> PlannedRun:
    """Plan a run that goes on from its last checkpoint, or from the start if there is none yet.

    Raises: InputError if it is no run, or a change would make it another.
    """
    file = folder / CONFIG_FILE
    if not file.is_file():
        raise InputError(f"{folder} is no run: it has no {CONFIG_FILE}; begin one with -o {folder}")
    settings = read_settings(file)
    for name, value in changes.items():
        # what is said again and is the same is no change
        if not name.startswith(MAY_CHANGE) and settings.get(name) != value:
            raise InputError(
                f"{name} was {settings.get(name)!r} when the run began and cannot become"
                f" {value!r}; begin another run, with --init {folder}/weights.safetensors if its"
                " weights are to be kept"
            )
    config = build_config({**settings, **changes})
    init = None
    if config.run.init and not any(folder.glob("checkpoints/step_*")):
        init = _load_init(config.run.init)
    return PlannedRun(folder, config, init)


def prepare(
    planned: PlannedRun,
    listener: Listener,
    *,
    photographed: Done = ignore_done,
    checked: Done = ignore_done,
) -> Trainer:
    """Prepare everything up to the first step: networks, data, the last checkpoint.

    Args:
        photographed, checked: Progress of `open_training_data`.
    Raises: InputError if anything is missing or does not fit.
    """
    config, folder = planned.config, planned.folder
    require_extra("train")  # asked for before minutes are spent on data
    if config.keeping.tensorboard:
        require_extra("tensorboard")
    judges = load_judges(config.losses)
    from motion_transfer.training.trainer import Trainer

    open_data = partial(
        open_training_data, config, folder, photographed=photographed, checked=checked
    )
    if is_first_process():
        with explain_disk_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            write_whole(folder / CONFIG_FILE, write_toml(config))
    return Trainer(
        config, folder, judges=judges, open_data=open_data, listener=listener, init=planned.init
    )


def is_first_process() -> bool:
    """Tell the first of several that `accelerate launch` started: it alone writes and talks."""
    # read from the environment, as it is asked before accelerate is imported
    return os.environ.get("RANK", "0") == "0"


def _load_init(name: str) -> NeuralReRenderer:
    if name in PRESETS and name not in SHIPPED:
        raise WeightsError(
            f"--init {name}: no such weights ship with the program; give the file of a checkpoint,"
            f" start from {', '.join(SHIPPED)}, or train from random weights with --preset {name}"
        )
    return load_checkpoint(find_weights(Path(name)))
