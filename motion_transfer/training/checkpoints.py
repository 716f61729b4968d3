"""Checkpoints of a run: whole or absent, kept by rule, and enough to go on bit for bit.

RUN/checkpoints/step_000500/
    model.safetensors, average.safetensors   each renders with `mt run` as it is
    discriminator.safetensors                where there is one
    optimisers.pt, random.pt                 tensors and plain values (`weights_only`)
    state.json                               step, seconds of training, the data's digest

Each model says in its notes what it was trained on, how, and under which licence.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.media.publish import publish, work_folder
from motion_transfer.media.structured import read_structured
from motion_transfer.training.settings import KeepingSettings
from motion_transfer.weights.checkpoint import load_checkpoint, save_checkpoint
from motion_transfer.weights.tensors import first_line, load_pickled
from nhrr_core import NeuralReRenderer

STATE = "state.json"
PATTERN = re.compile(r"step_(\d{6,})")


@dataclass(frozen=True)
class RunState:
    """Everything that a run has learned.

    Attributes:
        optimisers: By name, anything with `state_dict` and `load_state_dict`.
    """

    model: NeuralReRenderer
    average: NeuralReRenderer | None
    discriminator: nn.Module | None
    optimisers: Mapping[str, Any]

    @property
    def models(self) -> dict[str, NeuralReRenderer]:
        """Those that render, by the names of their files."""
        average = {} if self.average is None else {"average": self.average}
        return {"model": self.model, **average}


def checkpoint_folder(run: Path, step: int) -> Path:
    """Name the folder of a step's checkpoint."""
    return run / "checkpoints" / f"step_{step:06d}"


def list_steps(run: Path) -> list[int]:
    """List the steps that have a checkpoint, in order."""
    folder = run / "checkpoints"
    found = [PATTERN.fullmatch(item.name) for item in folder.iterdir()] if folder.is_dir() else []
    return sorted(int(match[1]) for match in found if match)


def write_state(
    run: Path,
    step: int,
    state: RunState,
    *,
    seconds: float,
    data_digest: str,
    notes: Mapping[str, str],
) -> Path:
    """Write a checkpoint under a temporary name, then give it its own.

    Args:
        seconds: How long the run has trained for.
    Raises: OutputError where the disk is full or the place cannot be written.
    """
    final = checkpoint_folder(run, step)
    with work_folder(final) as work:
        for name, model in state.models.items():
            save_checkpoint(work / f"{name}.safetensors", model, notes=notes)
        if state.discriminator is not None:
            weights = state.discriminator.state_dict()
            tensors = {name: value.detach().contiguous() for name, value in weights.items()}
            save_file(tensors, work / "discriminator.safetensors")
        optimisers = {name: each.state_dict() for name, each in state.optimisers.items()}
        torch.save(optimisers, work / "optimisers.pt")
        # batches follow from the step alone; this is for networks that draw numbers themselves
        random = {"cpu": torch.get_rng_state()}
        if torch.cuda.is_available():
            random["cuda"] = torch.cuda.get_rng_state()
        torch.save(random, work / "random.pt")
        content = {"step": step, "seconds": seconds, "data": data_digest}
        (work / STATE).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        work.chmod(0o755)  # a temporary folder is its owner's alone
        publish(work, final)
    return final


def read_state(run: Path, step: int, state: RunState, *, data_digest: str) -> float:
    """Fill the networks and optimisers, and set torch's random state, from a checkpoint.

    Returns: The seconds that the run had trained for; 0 where an older version wrote it.
    Raises: InputError or WeightsError if it is damaged or belongs to other data.
    """
    folder = checkpoint_folder(run, step)
    damages = (OSError, KeyError, TypeError, ValueError, RuntimeError, SafetensorError)
    try:
        content = read_structured(folder / STATE, "state").data
        if content["data"] != data_digest:
            raise InputError(
                f"checkpoint {folder} was trained on other pairs than the data has now; put the"
                " data back, or start anew with --init and another -o"
            )
        for name, model in state.models.items():
            kept = load_checkpoint(folder / f"{name}.safetensors")
            model.load_state_dict(kept.state_dict())
        if state.discriminator is not None:
            state.discriminator.load_state_dict(load_file(folder / "discriminator.safetensors"))
        optimisers = load_pickled(folder / "optimisers.pt", "optimisers")
        for name, optimiser in state.optimisers.items():
            optimiser.load_state_dict(optimisers[name])
        random = load_pickled(folder / "random.pt", "random state")
        torch.set_rng_state(random["cpu"])
        if "cuda" in random and torch.cuda.is_available():
            torch.cuda.set_rng_state(random["cuda"])
        return float(content.get("seconds", 0))
    except (*damages, WeightsError) as error:
        raise InputError(
            f"checkpoint {folder} is damaged ({first_line(error)}); remove the folder to go on from"
            " the one before"
        ) from error


def tidy(run: Path, settings: KeepingSettings) -> None:
    """Remove what the rule does not keep, and what a killed run left half-written."""
    for left in (run / "checkpoints").glob(".step_*"):
        shutil.rmtree(left)
    for step in list_steps(run)[: -settings.keep_last]:
        if not settings.keep_every or step % settings.keep_every:
            doomed = checkpoint_folder(run, step)
            hidden = doomed.with_name(f".{doomed.name}.gone")  # never a checkpoint by halves
            doomed.rename(hidden)
            shutil.rmtree(hidden)
