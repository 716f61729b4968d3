"""A training run: from a configuration to weights, stopped and continued as often as one likes."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
import torch.nn.functional as F
from accelerate import Accelerator, DistributedDataParallelKwargs
from torch import Tensor

from motion_transfer.devices import find_device
from motion_transfer.errors import InputError, TrainingError
from motion_transfer.events import Notice
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.training.checkpoints import (
    RunState,
    list_steps,
    read_state,
    tidy,
    write_state,
)
from motion_transfer.training.config import TrainConfig, write_toml
from motion_transfer.training.painters import Painter, Painters
from motion_transfer.training.pool import PeoplePool
from motion_transfer.training.progress import (
    Listener,
    Logged,
    Preview,
    TrainResult,
    choose_previews,
    draw_grid,
)
from motion_transfer.training.samples import TrainingSamples, count_workers, halve, load_batches
from motion_transfer.training.sources import StreamedPairs, TrainingData
from motion_transfer.training.speed import Clock, arrange, choose_precision, keep_memory
from motion_transfer.training.step import (
    R1_EVERY,
    Arithmetic,
    Average,
    Generator,
    Judges,
    Players,
    Terms,
    set_stage,
    update,
)
from motion_transfer.version import __version__
from motion_transfer.weights.checkpoint import save_checkpoint
from nhrr_core import Discriminator, NeuralReRenderer

if TYPE_CHECKING:  # a run without curves does not need it
    from torch.utils.tensorboard import SummaryWriter


class Trainer:
    """Everything of a run in one place, ready to be trained.

    Args:
        run: The run's folder, which exists.
        init: Weights to start from where there is no checkpoint.
        open_data: Called by one process first, so that what it caches is there for the others.
    Raises: InputError where the last checkpoint does not fit configuration or data.
    """

    def __init__(
        self,
        config: TrainConfig,
        run: Path,
        *,
        judges: Judges,
        open_data: Callable[[], TrainingData],
        listener: Listener,
        init: NeuralReRenderer | None = None,
    ) -> None:
        self._config, self._run = config, run
        keep_memory()
        self._accelerator = make_accelerator(config)
        self._device = self._accelerator.device
        if self._device.type == "cuda":
            torch.set_float32_matmul_precision("high")  # TF32, as convolutions have it anyway
        self._listener = listener if self._accelerator.is_main_process else lambda _event: None
        with self._accelerator.main_process_first():
            self._data = open_data()
        for line in self._data.dropped:
            self._listener(Notice(f"left out: {line}"))
        self._judges = judges.to(self._device)
        arrange(self._judges.perceptual)
        self.step = max(list_steps(run), default=0)
        self._state = build_state(config, init, self._device)
        self._average = self._state.average and Average(
            self._state.average, config.optimiser.ema_decay
        )
        self._players = self._enter_players()
        # accelerate decides about precision, scaling and what is shared among devices
        self._arithmetic = Arithmetic(
            lambda: self._accelerator.autocast(),
            self._accelerator.backward,
            self._accelerator.unwrap_model,
        )
        # of training, those of earlier pieces of the run included
        self._began = self._seconds = 0.0
        if self.step:
            digest = self._data.digest
            self._seconds = read_state(run, self.step, self._state, data_digest=digest)
        self._painters = self._start_painters()  # they get ready while the rest is prepared
        self._samples = self._make_samples()
        self._board: SummaryWriter | None = None
        self._previews: list[Preview] = []
        if self._accelerator.is_main_process and config.keeping.sample_every:
            self._previews = choose_previews(
                self._data.pairs, self._samples, config.keeping.samples, config.model.image_size
            )

    def train(self, should_stop: Callable[[], bool] = lambda: False) -> TrainResult:
        """Go on to the last step or minute, or until asked to stop; a checkpoint is written then.

        Raises: TrainingError if a loss is no number any more, or people cannot be painted.
        """
        try:
            return self._train(should_stop)
        finally:
            if self._painters is not None:
                self._painters.close()

    def _train(self, should_stop: Callable[[], bool]) -> TrainResult:
        first, run, keeping = self.step, self._config.run, self._config.keeping
        if not run.minutes and first > run.steps:
            raise InputError(f"the run has {first} steps already; give --steps more than that")
        if keeping.tensorboard and self._accelerator.is_main_process:
            from torch.utils.tensorboard import SummaryWriter

            # what an earlier, killed run wrote after its last checkpoint is hidden
            purge = first + 1 if first else None
            self._board = SummaryWriter(str(self._run / "tensorboard"), purge_step=purge)
        clock = Clock()
        self._began = time.monotonic() - self._seconds
        stopped = False
        try:
            if first == 0:
                self._draw_samples()
            batches = self._open_batches()
            while (progress := self._progress()) < 1:
                self._take_step(batches, clock, progress)
                stopped = self._agree(should_stop())
                if stopped:
                    break
            if self.step > first and keeping.sample_every and self.step % keeping.sample_every:
                self._draw_samples()
        finally:
            if self._board is not None:
                self._board.close()
        if self.step > first and self.step not in list_steps(self._run):
            self._save()  # the last step, or the one at which it was stopped, may lie between two
        path = self._run / "weights.safetensors"
        if self._accelerator.is_main_process:
            with explain_disk_errors(path):
                save_checkpoint(path, self._best, notes=self._notes())
        self._accelerator.wait_for_everyone()
        progress = self._progress()
        samples = (self.step - first) * self._samples_a_step
        self._accelerator.end_training()
        return TrainResult(
            step=self.step,
            stopped=stopped,
            progress=progress,
            weights=path,
            samples_per_second=samples / clock.seconds if clock.seconds else 0.0,
            wait_share=clock.wait_share,
        )

    def _enter_players(self) -> Players:
        prepare, discriminator = self._accelerator.prepare, self._state.discriminator
        optimisers = {name: prepare(each) for name, each in self._state.optimisers.items()}
        return Players(
            prepare(Generator(self._state.model)),
            optimisers["generator"],
            discriminator and prepare(discriminator),
            optimisers.get("discriminator"),
        )

    def _make_samples(self) -> TrainingSamples:
        config = self._config
        textures = Path(config.keeping.textures or self._run / "textures")
        if self._data.pairs.endless:  # none of them comes again
            textures = None
        elif self._accelerator.is_main_process:
            textures.mkdir(parents=True, exist_ok=True)
        self._accelerator.wait_for_everyone()
        half_size = 0 if self._halves_batches else config.half_size_steps * self._samples_a_step
        return TrainingSamples(
            self._data.pairs, config, textures=textures, half_size_samples=half_size
        )

    def _start_painters(self) -> Painters | None:
        """Have ever new people painted, if that is what the data are."""
        pairs, accelerator = self._data.pairs, self._accelerator
        if not isinstance(pairs, StreamedPairs):
            return None
        workers = count_workers(self._config.speed, beside_gpu=self._device.type == "cuda")
        first = self.step * self._samples_a_step  # nobody who was painted for earlier steps
        return Painters(
            Painter(pairs, self._config),
            count(first + accelerator.process_index, accelerator.num_processes),
            workers=workers and max(1, workers // accelerator.num_processes),
            note=lambda text: self._listener(Notice(text)),
        )

    def _open_batches(self) -> Iterator[dict[str, Tensor]]:
        config, process = self._config, self._accelerator.process_index
        if self._painters is not None:
            seed = (config.run.seed, 2, self.step, process)
            return iter(PeoplePool(config, self._painters, self._device, seed))
        return load_batches(
            self._samples,
            config,
            range(self.step, sys.maxsize if config.run.minutes else config.run.steps),
            process=process,
            processes=self._accelerator.num_processes,
            pin_memory=self._device.type == "cuda",
        )

    @property
    def _halves_batches(self) -> bool:
        """Whether batches are halved here: samples do not know how far a run by the clock is."""
        return self._painters is not None or self._config.run.minutes > 0

    def _progress(self) -> float:
        """The share of the run that is done, the same for all processes."""
        self._seconds = time.monotonic() - self._began
        if self._config.run.minutes and self._accelerator.num_processes > 1:
            seconds = torch.tensor([self._seconds], device=self._device)
            self._seconds = float(self._accelerator.gather(seconds)[0])  # pyright: ignore
        return self._config.progress(self.step, self._seconds)

    @property
    def _best(self) -> NeuralReRenderer:
        """What is sampled and exported."""
        return self._average.model if self._average is not None else self._state.model

    @property
    def _samples_a_step(self) -> int:
        optimiser = self._config.optimiser
        return optimiser.batch_size * optimiser.accumulation * self._accelerator.num_processes

    def _take_step(
        self, batches: Iterator[dict[str, Tensor]], clock: Clock, progress: float
    ) -> None:
        config, keeping = self._config, self._config.keeping
        inpainting = config.is_inpainting(progress)
        halves = self._halves_batches and progress < config.optimiser.half_size
        penalised = (self.step + 1) % R1_EVERY == 0
        set_stage(self._state.model, inpainting=inpainting)
        for optimiser in self._state.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = config.learning_rate(progress)
        networks = [self._players.generator, self._players.discriminator]
        sums: Terms = {}  # on the device: reading them now would wait for it
        with clock.step():
            for _ in range(config.optimiser.accumulation):
                with clock.waiting():
                    batch = {k: v.to(self._device) for k, v in next(batches).items()}
                    batch = halve(batch) if halves else batch
                with self._accelerator.accumulate(*filter(None, networks)):
                    terms = update(
                        batch,
                        self._players,
                        self._judges,
                        config.losses.weights,
                        self._arithmetic,
                        adversarial=config.is_adversarial(progress),
                        inpainting=inpainting,
                        r1_weight=config.losses.r1_weight * R1_EVERY if penalised else 0.0,
                    )
                for name, term in terms.items():
                    sums[name] = sums.get(name, 0) + term / config.optimiser.accumulation
            self.step += 1
            if self._average is not None:
                self._average.update(self._state.model, self.step)
        if self.step % keeping.log_every == 0 or self.step == config.run.steps:
            self._log(sums, clock, progress)
        if keeping.sample_every and self.step % keeping.sample_every == 0:
            self._draw_samples()
        if keeping.checkpoint_every and self.step % keeping.checkpoint_every == 0:
            self._save()

    def _log(self, terms: Terms, clock: Clock, progress: float) -> None:
        values = {name: float(term) for name, term in terms.items()}
        for name, value in values.items():
            if not math.isfinite(value):
                kept = list_steps(self._run)
                remedy = f"step {kept[-1]} is kept" if kept else "nothing is kept yet"
                raise TrainingError(
                    f"loss {name} is {value} at step {self.step}; {remedy}; try"
                    " --set optimiser.learning_rate=1e-4, or --fp32"
                )
        steps_per_second, wait_share = clock.lap()
        rate = steps_per_second * self._samples_a_step
        if self._board is not None:
            curves = {**values, "samples_per_second": rate, "wait_share": wait_share}
            for name, value in curves.items():
                self._board.add_scalar(name, value, self.step)
        run = self._config.run
        steps = None if run.minutes else run.steps
        self._listener(Logged(self.step, steps, values, rate, wait_share, progress))

    def _draw_samples(self) -> None:
        if not self._previews:
            return
        grid = draw_grid(self._best, self._previews, self._config.data.background, self._device)
        path = self._run / "samples" / f"step_{self.step:06d}.png"
        with explain_disk_errors(path):
            path.parent.mkdir(exist_ok=True)
            write_png(path, grid)
        if self._board is not None:
            self._board.add_image("samples", grid, self.step, dataformats="HWC")

    def _save(self) -> None:
        if self._accelerator.is_main_process:
            digest, notes = self._data.digest, self._notes()
            write_state(
                self._run,
                self.step,
                self._state,
                seconds=self._seconds,
                data_digest=digest,
                notes=notes,
            )
            tidy(self._run, self._config.keeping)
        self._accelerator.wait_for_everyone()

    def _notes(self) -> dict[str, str]:
        """What travels inside a weights file."""
        return {
            "licence": self._config.run.licence,
            "data": self._data.description,
            "step": str(self.step),
            "trained_by": f"motion-transfer {__version__}",
            "train.toml": write_toml(self._config),
        }

    def _agree(self, stop: bool) -> bool:
        """Whether any process was asked to stop."""
        if self._accelerator.num_processes == 1:
            return stop
        flag = torch.tensor([stop], device=self._device)
        return bool(self._accelerator.gather(flag).any())  # pyright: ignore[reportAttributeAccessIssue]


DEVICE_VARIABLE = "ACCELERATE_TORCH_DEVICE"


def make_accelerator(config: TrainConfig) -> Accelerator:
    """Take the devices there are, with the precision that suits them, and gradient accumulation."""
    wish = config.speed.wish
    device = torch.device(find_device(wish))
    dtype = choose_precision(config.speed.precision, device)
    if wish is not None and device.type != "cpu":
        os.environ[DEVICE_VARIABLE] = wish  # the one way to tell accelerate which
    return Accelerator(
        cpu=device.type == "cpu",
        mixed_precision="bf16" if dtype == torch.bfloat16 else "no",
        gradient_accumulation_steps=config.optimiser.accumulation,
        # in the first stage RenderNet takes no part, in the second FeatureNet
        kwargs_handlers=[
            DistributedDataParallelKwargs(find_unused_parameters=config.model.inpaints_first)
        ],
    )


def build_state(
    config: TrainConfig, init: NeuralReRenderer | None, device: torch.device
) -> RunState:
    """Build networks with weights from the run's seed, or from `init`, and Adam for each player.

    Source of Adam's settings: the paper, Sec. 3.5; it has no weight decay.
    """
    torch.manual_seed(config.run.seed)
    model = NeuralReRenderer(config.model)
    if init is not None:
        model.load_state_dict(_widen(init, model))
    discriminator = None
    if config.losses.adversarial:
        discriminator = Discriminator(
            image_channels=config.model.render_outputs,
            condition_channels=config.model.render_inputs,
            width=config.losses.discriminator_width,
            scales=config.losses.discriminator_scales,
        ).to(device)
    model.to(device)
    arrange(model.feature_net, model.render_net, discriminator)
    average = None
    if config.optimiser.ema_decay:
        average = NeuralReRenderer(config.model).to(device).requires_grad_(False).eval()
        average.load_state_dict(model.state_dict())
    if config.speed.compile:
        for network in (model.feature_net, model.render_net, discriminator):
            # what is compiled has no gradient of a gradient, as R1 needs
            if network is not None and not (network is discriminator and config.losses.r1_weight):
                network.compile(dynamic=False)  # there are two image sizes at most
    adam: dict[str, Any] = {
        "lr": config.optimiser.learning_rate,
        "betas": (config.optimiser.beta1, config.optimiser.beta2),
        "fused": True,
    }
    optimisers = {"generator": torch.optim.Adam(model.parameters(), **adam)}
    if discriminator is not None:
        optimisers["discriminator"] = torch.optim.Adam(discriminator.parameters(), **adam)
    return RunState(model, average, discriminator, optimisers)


def _widen(init: NeuralReRenderer, model: NeuralReRenderer) -> dict[str, Tensor]:
    """The weights to start from; inputs that only the new networks read begin without effect."""
    weights = init.state_dict()
    for name, own in model.state_dict().items():
        if name not in weights:  # a prior that was not there
            weights[name] = own
        elif own.ndim == 4:
            # new inputs are the last ones of their convolutions
            missing = own.shape[1] - weights[name].shape[1]
            weights[name] = F.pad(weights[name], (0, 0, 0, 0, 0, missing))
    return weights
