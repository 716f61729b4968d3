"""A training run: from a configuration to weights, stopped and continued as often as one likes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import torch
from accelerate import Accelerator, DistributedDataParallelKwargs
from torch import Tensor

from motion_transfer.errors import InputError, TrainingError
from motion_transfer.media.image import write_png
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.training.checkpoints import (
    list_steps,
    read_state,
    tidy,
    write_state,
)
from motion_transfer.training.clock import Clock
from motion_transfer.training.config import TrainConfig
from motion_transfer.training.events import Listener, Logged, Note, Saved, TrainResult
from motion_transfer.training.export import describe_weights, export_weights
from motion_transfer.training.loading import load_batches
from motion_transfer.training.networks import build_state
from motion_transfer.training.preview import PreviewPair, choose_previews, draw_grid
from motion_transfer.training.samples import SampleSettings, TrainingSamples
from motion_transfer.training.scalars import ScalarLog
from motion_transfer.training.sources import TrainingData
from motion_transfer.training.speed import arrange, choose_precision, keep_memory
from motion_transfer.training.step import Arithmetic, Average, Players, set_stage, update
from motion_transfer.training.terms import Generator, Judges, Terms
from nhrr_core import NeuralReRenderer

OpenData = Callable[[], TrainingData]


def make_accelerator(config: TrainConfig) -> Accelerator:
    """The devices there are, the precision that suits them, and gradient accumulation."""
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    dtype = choose_precision(config.speed.precision, device)
    return Accelerator(
        mixed_precision="bf16" if dtype == torch.bfloat16 else "no",
        gradient_accumulation_steps=config.optimiser.accumulation,
        # in the first stage of `ip` RenderNet takes no part, in the second FeatureNet
        kwargs_handlers=[
            DistributedDataParallelKwargs(find_unused_parameters=config.model.variant == "ip")
        ],
    )


class Trainer:
    """Everything of a run in one place, ready to be trained.

    Args:
        run: the run's folder, which exists.
        init: weights to start from where there is no checkpoint.
        open_data: called by one process first, so that what it caches is there for the others.
    Raises: InputError where the last checkpoint does not fit configuration or data.
    """

    def __init__(
        self,
        config: TrainConfig,
        run: Path,
        *,
        judges: Judges,
        open_data: OpenData,
        listener: Listener,
        init: NeuralReRenderer | None = None,
    ) -> None:
        self._config, self._run = config, run
        keep_memory()
        self._accelerator = make_accelerator(config)
        self._device = self._accelerator.device
        self._listener = listener if self._accelerator.is_main_process else lambda _event: None
        with self._accelerator.main_process_first():
            self._data = open_data()
        for line in self._data.dropped:
            self._listener(Note(f"left out: {line}"))
        self._judges = judges.to(self._device)
        self._build_players(init)
        self.step = self._resume()
        self._samples = self._make_samples()
        self._previews: list[PreviewPair] = []
        if self._accelerator.is_main_process and config.keeping.sample_every:
            self._previews = choose_previews(
                self._data.pairs, self._samples, config.keeping.samples, config.model.image_size
            )

    def _build_players(self, init: NeuralReRenderer | None) -> None:
        accelerator = self._accelerator
        self._state = build_state(self._config, init, self._device)
        self._model, discriminator = self._state.model, self._state.discriminator
        arrange(self._judges.perceptual)
        decay = self._config.optimiser.ema_decay
        self._average = self._state.average and Average(self._state.average, decay)
        optimisers = {
            name: accelerator.prepare(each) for name, each in self._state.optimisers.items()
        }
        self._players = Players(
            accelerator.prepare(Generator(self._model)),
            optimisers["generator"],
            discriminator and accelerator.prepare(discriminator),
            optimisers.get("discriminator"),
        )
        self._arithmetic = Arithmetic(
            lambda: accelerator.autocast(), accelerator.backward, accelerator.unwrap_model
        )

    def _resume(self) -> int:
        steps = list_steps(self._run)
        if not steps:
            return 0
        read_state(self._run, steps[-1], self._state, data_digest=self._data.digest)
        return steps[-1]

    def _make_samples(self) -> TrainingSamples:
        config = self._config
        textures = Path(config.keeping.textures or self._run / "textures")
        if getattr(self._data.pairs, "endless", False):
            textures = None
        elif self._accelerator.is_main_process:
            textures.mkdir(parents=True, exist_ok=True)
        self._accelerator.wait_for_everyone()
        return TrainingSamples(
            self._data.pairs,
            SampleSettings(
                seed=config.run.seed,
                image_size=config.model.image_size,
                texture_size=config.model.texture_size,
                background=config.data.background,
                jitter=config.data.jitter,
                alpha=config.model.alpha,
                target_texture=config.uses_texture_loss,
                clearance=config.model.clearance,
                textures=textures,
                half_size_samples=config.half_size_steps * self._samples_a_step,
            ),
        )

    def train(self, should_stop: Callable[[], bool] = lambda: False) -> TrainResult:
        """Go on to the last step, or until asked to stop; either way a checkpoint is written.

        Raises: TrainingError if a loss is no number any more.
        """
        first, steps = self.step, self._config.run.steps
        if first > steps:
            raise InputError(f"the run has {first} steps already; give --steps more than that")
        log = ScalarLog(self._run, first, enabled=self._wants_tensorboard())
        clock = Clock()
        stopped = False
        try:
            if first == 0:
                self._draw_samples(log)
            batches = load_batches(
                self._samples,
                self._config,
                range(first, steps),
                process=self._accelerator.process_index,
                processes=self._accelerator.num_processes,
                pin_memory=self._device.type == "cuda",
            )
            for _ in range(first, steps):
                self._take_step(batches, clock, log)
                stopped = self._agree(should_stop())
                if stopped:
                    break
            every = self._config.keeping.sample_every
            if self.step > first and every and self.step % every:
                self._draw_samples(log)
        finally:
            log.close()
        if self.step > first and self.step not in list_steps(self._run):
            self._save()
        path = self._run / "weights.safetensors"
        if self._accelerator.is_main_process:
            model = self._average.model if self._average is not None else self._model
            export_weights(path, model, self._notes())
        self._accelerator.wait_for_everyone()
        samples = (self.step - first) * self._samples_a_step
        self._accelerator.end_training()
        return TrainResult(
            step=self.step,
            stopped=stopped,
            weights=path,
            samples_per_second=samples / clock.seconds if clock.seconds else 0.0,
            wait_share=clock.wait_share,
        )

    @property
    def _samples_a_step(self) -> int:
        optimiser = self._config.optimiser
        return optimiser.batch_size * optimiser.accumulation * self._accelerator.num_processes

    def _take_step(
        self, batches: Iterator[dict[str, Tensor]], clock: Clock, log: ScalarLog
    ) -> None:
        config, keeping = self._config, self._config.keeping
        inpainting = self.step < config.inpainting_steps
        set_stage(self._model, inpainting=inpainting)
        for optimiser in self._state.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = config.learning_rate(self.step)
        sums: Terms = {}
        clock.start()
        for _ in range(config.optimiser.accumulation):
            with clock.waiting():
                batch = {k: v.to(self._device) for k, v in next(batches).items()}
            with self._accelerator.accumulate(
                self._players.generator,
                *([self._players.discriminator] if self._players.discriminator else []),
            ):
                terms = update(
                    batch,
                    self._players,
                    self._judges,
                    config.losses.weights,
                    self._arithmetic,
                    adversarial=self.step >= config.adversarial_start,
                    inpainting=inpainting,
                )
            for name, term in terms.items():
                sums[name] = sums.get(name, 0) + term / config.optimiser.accumulation
        self.step += 1
        if self._average is not None:
            self._average.update(self._model, self.step)
        clock.stop()
        if self.step % keeping.log_every == 0 or self.step == config.run.steps:
            self._log(sums, clock, log)
        if keeping.sample_every and self.step % keeping.sample_every == 0:
            self._draw_samples(log)
        if keeping.checkpoint_every and self.step % keeping.checkpoint_every == 0:
            self._save()

    def _log(self, terms: Terms, clock: Clock, log: ScalarLog) -> None:
        values = {name: float(term) for name, term in terms.items()}
        for name, value in values.items():
            if not math.isfinite(value):
                kept = list_steps(self._run)
                remedy = f"step {kept[-1]} is kept" if kept else "nothing is kept yet"
                raise TrainingError(
                    f"loss {name} is {value} at step {self.step}; {remedy}; try"
                    " --set optimiser.learning_rate=1e-4, or --fp32"
                )
        steps, seconds, wait_share = clock.lap()
        rate = steps * self._samples_a_step / seconds
        log.add({**values, "samples_per_second": rate, "wait_share": wait_share}, self.step)
        self._listener(Logged(self.step, self._config.run.steps, values, rate, wait_share))

    def _draw_samples(self, log: ScalarLog) -> None:
        if not self._previews:
            return
        model = self._average.model if self._average is not None else self._model
        grid = draw_grid(model, self._previews, self._config.data.background, self._device)
        path = self._run / "samples" / f"step_{self.step:06d}.png"
        with explain_disk_errors(path):
            path.parent.mkdir(exist_ok=True)
            write_png(path, grid)
        log.add_picture("samples", grid, self.step)
        self._listener(Saved(path))

    def _save(self) -> None:
        if self._accelerator.is_main_process:
            path = write_state(
                self._run,
                self.step,
                self._state,
                data_digest=self._data.digest,
                notes=self._notes(),
            )
            tidy(self._run, self._config.keeping)
            self._listener(Saved(path))
        self._accelerator.wait_for_everyone()

    def _notes(self) -> dict[str, str]:
        return describe_weights(self._config, self._data.description, self.step)

    def _wants_tensorboard(self) -> bool:
        return self._config.keeping.tensorboard and self._accelerator.is_main_process

    def _agree(self, stop: bool) -> bool:
        """Whether any process was asked to stop."""
        if self._accelerator.num_processes == 1:
            return stop
        flag = torch.tensor([stop], device=self._device)
        return bool(self._accelerator.gather(flag).any())  # pyright: ignore[reportAttributeAccessIssue]
