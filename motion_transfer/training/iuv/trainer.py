"""Training the IUV network on samples: its loss, its runs, and how its answers are scored.

RUN/weights.safetensors     the averaged weights, as they ship
RUN/state.pt                everything needed to go on: a run does so where it finds one
RUN/log.csv                 step, seconds, losses

Batches follow from the seed and the step's number alone: a run that goes on sees what one that was
never stopped would have seen. The learning rate falls as a half cosine over all steps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn import functional as F

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError, TrainingError, WeightsError
from motion_transfer.estimate.iuv.features import BodyInput, stack_inputs
from motion_transfer.estimate.iuv.network import (
    OUTPUT_SIZE,
    PARTS,
    IuvLogits,
    IuvNetwork,
    IuvNetworkConfig,
    load_weights,
    save_weights,
)
from motion_transfer.estimate.iuv.painting import paint_iuv
from motion_transfer.media.publish import publish
from motion_transfer.training.iuv.augmentation import NOTHING, Augmentation, training_pair
from motion_transfer.training.iuv.samples import list_samples, read_sample
from motion_transfer.training.progress import Listener, Logged
from motion_transfer.training.settings import Precision
from motion_transfer.training.speed import Clock, choose_precision, keep_memory
from motion_transfer.weights.tensors import first_line, load_pickled

UV_WEIGHT = 5.0  # chosen: an l1 of U and V is small beside a cross-entropy
SMALL_PARTS = 0.3
"""Parts weigh their mean area to the power of minus this: hands and feet count too. Measured:
without it synthetic people come out a little better, and real ones worse."""

LONGEST_GRADIENT = 5.0  # norm of all gradients together; longer ones are cut to it
LOG_EVERY = 20  # steps
KEPT = ("network", "averaged", "optimiser")  # of a run, in its state.pt

PART_AREAS = (
    *(0.72, 0.029, 0.033, 0.003, 0.003, 0.004, 0.004),
    *(0.010, 0.010, 0.012, 0.012, 0.010, 0.010, 0.010, 0.010),
    *(0.006, 0.006, 0.006, 0.006, 0.006, 0.006, 0.006, 0.006, 0.017, 0.017),
)
"""Shares of the window, roughly, over the training people."""


def iuv_loss(logits: IuvLogits, iuv: UInt8[Tensor, "B 128 128 3"]) -> dict[str, Float[Tensor, ""]]:
    """Compute the cross-entropy of parts, and l1 of U and V on the true part of the person."""
    part = iuv[..., 0].long()
    weights = torch.tensor(PART_AREAS) ** -SMALL_PARTS
    parts = F.cross_entropy(logits.parts, part, weights / weights.mean())
    body = part > 0
    batch, rows, columns = body.nonzero(as_tuple=True)
    chosen = logits.uv.permute(0, 3, 4, 1, 2)[batch, rows, columns, part[body] - 1]
    uv = (chosen - iuv[..., 1:][body].float() / 255).abs().mean()
    return {"parts": parts, "uv": uv, "total": parts + UV_WEIGHT * uv}


@dataclass(frozen=True)
class IuvScore:
    """How near an IUV image is to another.

    Attributes:
        iou: Intersection over union of the persons.
        part_agreement: The share of the pixels in both persons with the same part.
        uv_error: The median of |U - U'| and |V - V'| where the part is the same, 0..1.
        swapped: The share of the pixels in both persons whose part is the other side's.
        turned: The share of the trunk's pixels in both that are front in one and back in the other.
    """

    iou: float
    part_agreement: float
    uv_error: float
    swapped: float
    turned: float


OTHER_SIDE = np.arange(PARTS)
OTHER_SIDE[3:] = 1 + ((OTHER_SIDE[3:] - 1) ^ 1)
"""The part of the other side: from 3 on, a right one and a left one are neighbours."""


def score_iuv(found: UInt8[np.ndarray, "H W 3"], true: UInt8[np.ndarray, "H W 3"]) -> IuvScore:
    """Compare two IUV images of one person; NaN where there is nothing to compare."""
    mine, yours = found[..., 0], true[..., 0]
    both, either = (mine > 0) & (yours > 0), (mine > 0) | (yours > 0)
    same = both & (mine == yours)
    other = both & (mine == OTHER_SIDE[yours]) & (OTHER_SIDE[yours] != yours)
    trunk = both & (mine <= 2) & (yours <= 2)
    away = np.abs(found[same][:, 1:].astype(int) - true[same][:, 1:])
    return IuvScore(
        iou=_share(both, either),
        part_agreement=_share(same, both),
        uv_error=float(np.median(away)) / 255 if same.any() else float("nan"),
        swapped=_share(other, both),
        turned=_share(trunk & (mine != yours), trunk),
    )


def _share(of: np.ndarray, whole: np.ndarray) -> float:
    return float(of.sum() / whole.sum()) if whole.any() else float("nan")


Batch = tuple[BodyInput, UInt8[Tensor, "B 128 128 3"]]


@dataclass(frozen=True)
class TrainingSettings:
    """A run.

    Attributes:
        steps: In all; the learning rate falls to nothing at the last one.
        warm_up_steps: Those in which the learning rate rises to its full height.
        keep: The share of the averaged weights that stays at each step.
        save_every: Steps between two states on disk.
        init: Weights to begin with, of a network of the same sizes; None: random ones.
        precision: Of the convolutions; `auto` is bf16 where the hardware multiplies it.
    """

    steps: int = 20000
    batch_size: int = 16
    learning_rate: float = 2e-3
    warm_up_steps: int = 200
    weight_decay: float = 1e-4
    keep: float = 0.999
    save_every: int = 250
    seed: int = 0
    init: Path | None = None
    precision: Precision = "auto"
    network: IuvNetworkConfig = field(default_factory=IuvNetworkConfig)
    augmentation: Augmentation = field(default_factory=Augmentation)


class IuvTraining:
    """A run in a folder, begun or gone on with.

    Raises: InputError where there are no samples, or the run's state is damaged.
    """

    def __init__(self, data: Path, run: Path, settings: TrainingSettings) -> None:
        self.settings, self.run = settings, run
        self.files = list_samples(data)
        torch.manual_seed(settings.seed)
        if settings.init is None:
            self.network = IuvNetwork(settings.network)
        else:
            self.network = load_weights(settings.init)
        keep_memory()
        self._dtype = choose_precision(settings.precision, torch.device("cpu"))
        self.averaged = deepcopy(self.network).requires_grad_(False)
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), settings.learning_rate, weight_decay=settings.weight_decay
        )
        self.step = 0
        run.mkdir(parents=True, exist_ok=True)
        if (run / "state.pt").exists():
            self._read_state()

    def train(
        self,
        listener: Listener = lambda _event: None,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> bool:
        """Make the steps that are left, or those until asked to stop; either way they are kept.

        Returns: Whether it was stopped.
        Raises: TrainingError when the loss is no number any more.
        """
        settings, stopped = self.settings, False
        began, clock = time.monotonic(), Clock()
        log = (self.run / "log.csv").open("a", buffering=1, encoding="utf-8")
        with ThreadPoolExecutor(1) as loader, log:
            # the next batch is made while the network learns from this one
            ahead = loader.submit(self.batch, self.step)
            while self.step < settings.steps and not stopped:
                with clock.step():
                    with clock.waiting():
                        batch = ahead.result()
                    ahead = loader.submit(self.batch, self.step + 1)
                    losses = self._learn(batch)
                self.step += 1
                stopped, last = should_stop(), self.step == settings.steps
                if self.step % LOG_EVERY == 0 or last:
                    seconds = time.monotonic() - began
                    line = ",".join(f"{value:.4f}" for value in losses.values())
                    log.write(f"{self.step},{seconds:.1f},{line}\n")
                    rate, wait = clock.lap()
                    rate *= settings.batch_size
                    listener(Logged(self.step, settings.steps, losses, rate, wait))
                if self.step % settings.save_every == 0 or last or stopped:
                    self._write_state()
        return stopped

    def batch(self, step: int) -> Batch:
        """Make the batch of a step."""
        rng = np.random.default_rng((self.settings.seed, step))
        pairs: list[tuple[BodyInput, np.ndarray]] = []
        while len(pairs) < self.settings.batch_size:
            sample = read_sample(self.files[rng.integers(len(self.files))])
            if pair := training_pair(sample, self.settings.augmentation, rng):
                pairs.append(pair)
        answers = torch.from_numpy(np.stack([answer for _, answer in pairs]))
        return stack_inputs([body for body, _ in pairs]), answers

    def _learn(self, batch: Batch) -> dict[str, float]:
        settings, share = self.settings, self.step / self.settings.steps
        # Adam's averages mean little in the first steps
        warm = min(1.0, (self.step + 1) / settings.warm_up_steps)
        rate = settings.learning_rate * warm * 0.5 * (1 + math.cos(math.pi * share))
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.network.train()
        with torch.autocast("cpu", self._dtype, enabled=self._dtype != torch.float32):
            logits = self.network(batch[0])
        losses = iuv_loss(IuvLogits(*(each.float() for each in logits)), batch[1])
        if not torch.isfinite(losses["total"]):
            raise TrainingError(f"the loss is no number at step {self.step}; lower the rate")
        self.optimiser.zero_grad(set_to_none=True)
        losses["total"].backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), LONGEST_GRADIENT)
        self.optimiser.step()
        # early on the average would remember the beginning for too long
        keep = min(settings.keep, (self.step + 1) / (self.step + 10))
        states = self.averaged.state_dict(), self.network.state_dict()
        for kept, new in zip(*(state.values() for state in states), strict=True):
            # weights and statistics are averaged, counts of batches are not
            kept.copy_(torch.lerp(kept, new, 1 - keep) if kept.is_floating_point() else new)
        return {name: float(value.detach()) for name, value in losses.items()}

    def _write_state(self) -> None:
        parts = {name: getattr(self, name).state_dict() for name in KEPT}
        state = {"step": self.step, **parts}
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
            state = load_pickled(file, "state")
            for name in KEPT:
                getattr(self, name).load_state_dict(state[name])
            self.step = int(state["step"])
        except (KeyError, TypeError, ValueError, RuntimeError, WeightsError) as error:
            raise InputError(
                f"{file} is damaged, or of a network of another size ({first_line(error)}); remove"
                " it to begin anew"
            ) from error


def score_samples(files: list[Path], network: IuvNetwork) -> Iterator[IuvScore]:
    """Score BlazePose's own view of samples; those where it saw nobody are left out."""
    rng = np.random.default_rng(0)
    for file in files:
        if pair := training_pair(read_sample(file), NOTHING, rng):
            square = Box(0, 0, OUTPUT_SIZE, OUTPUT_SIZE)
            with torch.inference_mode():
                parts, uv = (logits[0].numpy() for logits in network(pair[0]))
            yield score_iuv(paint_iuv(parts, uv, square, square), pair[1])
