"""Training the IUV network on samples.

    python -m motion_transfer.estimate.iuv_training make DATA --people 2500
    python -m motion_transfer.estimate.iuv_training train DATA RUN --steps 20000
    python -m motion_transfer.estimate.iuv_training score DATA WEIGHTS

RUN/weights.safetensors     the averaged weights, as they ship
RUN/state.pt                everything needed to go on: `train` does so where it finds one
RUN/log.csv                 step, seconds, losses

Batches follow from the seed and the step's number alone: a run that goes on sees what one that was
never stopped would have seen. The learning rate falls as a half cosine over all steps.
"""

from __future__ import annotations

import math
import pickle
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from motion_transfer.errors import InputError, TrainingError
from motion_transfer.estimate.augmentation import NOTHING, Augmentation, training_pair
from motion_transfer.estimate.body_features import BodyInput, stack_inputs
from motion_transfer.estimate.interface import Box
from motion_transfer.estimate.iuv_loss import IuvScore, iuv_loss, score_iuv
from motion_transfer.estimate.iuv_network import OUTPUT_SIZE, IuvNetwork, IuvNetworkConfig
from motion_transfer.estimate.iuv_painting import paint_iuv
from motion_transfer.estimate.iuv_weights import average, load_weights, save_weights
from motion_transfer.estimate.samples import list_samples, read_sample
from motion_transfer.media.publish import publish

Batch = tuple[BodyInput, UInt8[Tensor, "B 128 128 3"]]


@dataclass(frozen=True)
class TrainingSettings:
    """A run.

    Attributes:
        steps: in all; the learning rate falls to nothing at the last one.
        warm_up_steps: in which the learning rate rises to its full height.
        keep: of the averaged weights at each step.
        save_every: steps between two states on disk.
    """

    steps: int = 20000
    batch_size: int = 16
    learning_rate: float = 2e-3
    warm_up_steps: int = 200
    weight_decay: float = 1e-4
    keep: float = 0.999
    save_every: int = 250
    seed: int = 0
    network: IuvNetworkConfig = field(default_factory=IuvNetworkConfig)
    augmentation: Augmentation = field(default_factory=Augmentation)


class IuvTraining:
    """A run in a folder, begun or gone on with."""

    def __init__(self, data: Path, run: Path, settings: TrainingSettings) -> None:
        """Raises: InputError where there are no samples, or the run's state is damaged."""
        self.settings, self.run = settings, run
        self.files = list_samples(data)
        torch.manual_seed(settings.seed)
        self.network = IuvNetwork(settings.network)
        self.averaged = deepcopy(self.network).requires_grad_(False)
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), settings.learning_rate, weight_decay=settings.weight_decay
        )
        self.step = 0
        run.mkdir(parents=True, exist_ok=True)
        if (run / "state.pt").exists():
            self._read_state()

    def train(self, say=print) -> None:
        """All steps that are left. Raises: TrainingError when the loss is no number any more."""
        log = (self.run / "log.csv").open("a", buffering=1)
        began = time.monotonic()
        with ThreadPoolExecutor(1) as loader, log:
            ahead = loader.submit(self.batch, self.step)
            while self.step < self.settings.steps:
                batch = ahead.result()
                ahead = loader.submit(self.batch, self.step + 1)
                losses = self._learn(batch)
                self.step += 1
                if self.step % 20 == 0:
                    seconds = time.monotonic() - began
                    line = ",".join(f"{value:.4f}" for value in losses.values())
                    log.write(f"{self.step},{seconds:.1f},{line}\n")
                if self.step % self.settings.save_every == 0 or self.step == self.settings.steps:
                    self._write_state()
                    say(
                        f"step {self.step}: " + ", ".join(f"{k} {v:.3f}" for k, v in losses.items())
                    )

    def batch(self, step: int) -> Batch:
        """The batch of a step."""
        rng = np.random.default_rng((self.settings.seed, step))
        pairs: list[tuple[BodyInput, np.ndarray]] = []
        while len(pairs) < self.settings.batch_size:
            sample = read_sample(self.files[rng.integers(len(self.files))])
            if pair := training_pair(sample, self.settings.augmentation, rng):
                pairs.append(pair)
        answers = torch.from_numpy(np.stack([answer for _, answer in pairs]))
        return stack_inputs([body for body, _ in pairs]), answers

    def _learn(self, batch: Batch) -> dict[str, float]:
        settings = self.settings
        share = self.step / settings.steps
        warm = min(1.0, (self.step + 1) / settings.warm_up_steps)
        rate = settings.learning_rate * warm * 0.5 * (1 + math.cos(math.pi * share))
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.network.train()
        losses = iuv_loss(self.network(batch[0]), batch[1])
        if not torch.isfinite(losses["total"]):
            raise TrainingError(f"the loss is no number at step {self.step}; lower the rate")
        self.optimiser.zero_grad(set_to_none=True)
        losses["total"].backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimiser.step()
        # early on the average would remember the beginning for too long
        average(self.averaged, self.network, min(settings.keep, (self.step + 1) / (self.step + 10)))
        return {name: float(value.detach()) for name, value in losses.items()}

    def _write_state(self) -> None:
        state = {
            "step": self.step,
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimiser": self.optimiser.state_dict(),
        }
        temporary = self.run / ".state.tmp"
        torch.save(state, temporary)
        publish(temporary, self.run / "state.pt")
        notes = {
            "licence": "CC0-1.0",
            "trained-on": f"{len(self.files)} photos of synthetic people, {self.step} steps",
        }
        temporary = self.run / ".weights.tmp"
        save_weights(temporary, self.averaged, notes)
        publish(temporary, self.run / "weights.safetensors")

    def _read_state(self) -> None:
        file = self.run / "state.pt"
        try:
            state = torch.load(file, map_location="cpu", weights_only=True)
            self.network.load_state_dict(state["network"])
            self.averaged.load_state_dict(state["averaged"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.step = int(state["step"])
        except (OSError, KeyError, ValueError, RuntimeError, pickle.UnpicklingError) as error:
            raise InputError(
                f"{file} is damaged, or of a network of another size ({error}); remove it to begin"
                " anew"
            ) from error


def score_samples(files: list[Path], network: IuvNetwork) -> Iterator[IuvScore]:
    """Scores on BlazePose's own view of samples; those where it saw nobody are left out."""
    rng = np.random.default_rng(0)
    for file in files:
        pair = training_pair(read_sample(file), NOTHING, rng)
        if pair is None:
            continue
        square = Box(0, 0, OUTPUT_SIZE, OUTPUT_SIZE)
        with torch.inference_mode():
            yield score_iuv(paint_iuv(network(pair[0]), square, square), pair[1])


def main() -> None:
    """The commands in this module's description."""
    import click

    from motion_transfer.estimate.samples import SampleOptions, make_samples

    folder = click.Path(path_type=Path)
    commands = click.Group(help=__doc__)

    @commands.command()
    @click.argument("data", type=folder)
    @click.option("--people", type=int, required=True)
    @click.option("--split", type=click.Choice(["train", "held-out"]), default="train")
    @click.option("--workers", type=int)
    def make(data: Path, **options) -> None:
        with click.progressbar(length=options["people"]) as bar:
            make_samples(SampleOptions(out=data, **options), bar.update)

    @commands.command()
    @click.argument("data", type=folder)
    @click.argument("run", type=folder)
    @click.option("--steps", type=int, default=TrainingSettings.steps)
    @click.option("--batch-size", type=int, default=TrainingSettings.batch_size)
    @click.option("--rate", "learning_rate", type=float, default=TrainingSettings.learning_rate)
    def train(data: Path, run: Path, **options) -> None:
        say = partial(print, flush=True)
        IuvTraining(data, run, TrainingSettings(**options)).train(say)

    @commands.command()
    @click.argument("data", type=folder)
    @click.argument("weights", type=folder)
    def score(data: Path, weights: Path) -> None:
        scores = list(score_samples(list_samples(data), load_weights(weights)))
        for name in IuvScore.__dataclass_fields__:
            values = [getattr(each, name) for each in scores]
            print(
                f"{name:15} mean {np.nanmean(values):.3f}  worst tenth "
                f"{np.nanquantile(values, [0.1, 0.9]).round(3)}"
            )

    commands()


if __name__ == "__main__":
    main()
