"""`mt train`, and `mt train iuv` for the network that paints IUV."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, Self

import click
from tqdm import tqdm

from motion_transfer.cli.bars import is_interactive
from motion_transfer.cli.options import (
    FILE,
    CommandGroup,
    SectionGroup,
    described_options,
    section,
)
from motion_transfer.cli.people import prepare_body_model
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.terminal import counted
from motion_transfer.errors import InputError
from motion_transfer.training.config import (
    SECTIONS,
    check_value,
    parse_assignment,
    read_settings,
    write_toml,
)
from motion_transfer.training.settings import LOSSES, PEOPLE

run_option = section("Run")
loss_option = section(LOSSES)
speed_option = section("Speed")


def setting_options(command: Any) -> Any:
    """Add the options that settings describe, in the order of the headings."""
    for name in reversed(("data", "model", "run", "losses", "optimiser", "speed")):
        command = described_options(SECTIONS[name])(command)
    return command


@click.group(cls=SectionGroup, invoke_without_command=True, subcommand_metavar="[iuv ...]")
@run_option("-o", "--output", type=FILE, metavar="RUN", help="A new folder for the run.")
@run_option("--resume", type=FILE, metavar="RUN", help="Go on with a run that was stopped.")
@run_option("--config", type=FILE, help="A train.toml; options and --set come after it.")
@run_option(
    "--set", "assignments", multiple=True, metavar="SECTION.KEY=VALUE", help="Any setting of it."
)
@run_option("-q", "--quiet", is_flag=True, help="Say nothing but errors and where the weights are.")
@setting_options
@loss_option("--no-perceptual", is_flag=True, help="Leave the perceptual loss out.")
@loss_option("--no-identity", is_flag=True, help="Leave the face loss out; default with people.")
@loss_option("--no-adversarial", is_flag=True, help="Leave the discriminator out.")
@speed_option(
    "--bf16/--fp32", "bf16", default=None, help="Default: bf16 where the hardware multiplies it."
)
@click.pass_context
def train(
    context: click.Context,
    output: Path | None,
    resume: Path | None,
    config: Path | None,
    assignments: tuple[str, ...],
    quiet: bool,
    **options: Any,
) -> None:
    """Train the network of the paper, or one of its variants.

    \b
    mt train --preset lite --data people --steps 500 -o run/
    mt train --resume run/ --steps 2000
    mt train --data pairs.csv --images photos/ --vgg19 vgg19-dcbb9e9d.pth \\
             --sphereface sphere20a.pth -o deepfashion/
    mt train --init run/weights.safetensors --data my_frames/ --no-identity -o me/
    mt train --init lite --people 0 --minutes 8 -o gpu/
    accelerate launch --multi-gpu -m motion_transfer train --config train.toml -o run/

    How long it takes: the default is 100,000 steps of 4 pairs. Two CPU cores make 1 to 2 pairs a
    second with the preset lite, which is two to five days, and weeks with the full one. An H100
    makes 210 a second with lite, and 100,000 steps of 48 in six hours. See --steps and --minutes.

    A run that is stopped (Ctrl-C, SIGTERM) writes a checkpoint first. Several devices are started
    by `accelerate launch`.

    `mt train iuv` trains the network that paints IUV.
    """
    if context.invoked_subcommand is not None:
        typed = map(context.get_parameter_source, context.params)
        if click.core.ParameterSource.COMMANDLINE in typed:
            raise click.UsageError("Options of `mt train` mean nothing to `mt train iuv`.")
        return
    from motion_transfer.training.runs import is_first_process, plan_new_run, plan_resumed_run

    if (output is None) == (resume is None):
        raise click.UsageError("Give one of -o (a new run) and --resume (a run that was stopped).")
    changes = {**(read_settings(config) if config else {}), **_settings_of(options)}
    changes |= [parse_assignment(text) for text in assignments]
    if resume is not None:
        planned = plan_resumed_run(resume, changes)
    else:
        assert output is not None
        planned = plan_new_run(output, changes)
    leads = is_first_process()
    quiet = quiet or not leads
    if not quiet:
        click.echo(write_toml(planned.config), err=True)
    with Progress(quiet=quiet) as progress:
        trainer = _prepare(planned, progress, quiet=quiet)
        with stop_on_signals() as stop:
            result = trainer.train(stop.asked)
    if leads:
        click.echo(
            f"{result.weights}: {counted(result.step, 'step')},"
            f" {result.samples_per_second:.2f} samples/s,"
            f" {result.wait_share:.0%} of the time waiting for data"
        )
    if result.stopped:
        run = planned.config.run
        whole = f"{run.minutes:g} minutes" if run.minutes else f"{run.steps}"
        where = f"{result.step}, {result.progress:.0%} of {whole}"
        stop.end(f"{where}; go on with mt train --resume {planned.folder}", leads)


def _settings_of(options: dict[str, Any]) -> dict[str, Any]:
    """What was said on the command line, as settings."""
    for loss, network in (("perceptual", "vgg19"), ("identity", "sphereface")):
        given = [name for name in (loss, f"{network}_file") if options.get(name) is not None]
        if options.pop(f"no_{loss}"):
            if given:
                name = given[0].removesuffix("_file")
                raise InputError(f"--{name} and --no-{loss} contradict each other")
            options[loss] = "none"
        elif f"{network}_file" in given:
            options[loss] = network
    if options.pop("no_adversarial"):
        options["adversarial"] = False
    bf16 = options.pop("bf16")
    if bf16 is not None:
        options["precision"] = "bf16" if bf16 else "fp32"
    keys = {
        entry.name: f"{name}.{entry.name}" for name in SECTIONS for entry in fields(SECTIONS[name])
    }
    return {
        keys[name]: check_value(keys[name], value)
        for name, value in options.items()
        if value is not None
    }


def _prepare(planned: Any, progress: Progress, *, quiet: bool) -> Any:
    """Read or make the data; stopped here, a run goes on with what is there already."""
    from motion_transfer.extras import require_extra
    from motion_transfer.training.runs import prepare

    if planned.config.data.source == PEOPLE:
        require_extra("people")
        from motion_transfer.people import find_assets

        prepare_body_model(quiet, find_assets(planned.config.data.assets))
    with (
        CountBar("photographing", unit="person", quiet=quiet) as people,
        CountBar("looking at the pairs", unit="picture", quiet=quiet) as pictures,
    ):
        return prepare(planned, progress, photographed=people.advance, checked=pictures.advance)


class Progress:
    """A bar on a terminal, and a line for each log event where there is none."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._bar: tqdm | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, event: Any) -> None:
        from motion_transfer.events import Notice
        from motion_transfer.training.progress import Logged

        if self._quiet:
            return
        if isinstance(event, Notice):
            tqdm.write(f"mt: note: {event.message}", file=sys.stderr)
        elif isinstance(event, Logged):
            terms = " ".join(f"{name} {value:.4f}" for name, value in event.terms.items())
            rate = f"{event.samples_per_second:.2f} samples/s, waiting {event.wait_share:.0%}"
            if not is_interactive():
                where = f"/{event.steps}" if event.steps else f", {event.progress:.0%}"
                click.echo(f"step {event.step}{where}: {terms}; {rate}", err=True)
                return
            if self._bar is None:
                self._bar = tqdm(total=event.steps, unit="step", dynamic_ncols=True, leave=False)
                self._bar.n = self._bar.last_print_n = event.step
            if event.steps is None:
                self._bar.set_description(f"{event.progress:.0%}", refresh=False)
            self._bar.set_postfix_str(f"{terms}; {rate}", refresh=False)
            self._bar.update(event.step - self._bar.n)


STOPPING = b"mt: stopping after this step; once more to stop at once\n"


class Stop:
    """Which signal asked to stop, if one did."""

    number: int | None = None

    def asked(self) -> bool:
        """Tell whether one did."""
        return self.number is not None

    def end(self, where: str, aloud: bool) -> NoReturn:
        """Leave the command as the signal would have, after saying where it stopped."""
        if aloud:
            click.echo(f"mt: stopped at step {where}", err=True)
        raise click.exceptions.Exit(128 + int(self.number or signal.SIGINT))


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Let the first Ctrl-C or SIGTERM end and keep the step; the second stops at once."""
    stop = Stop()
    before: dict[int, Any] = {}

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.number is not None and callable(before[number]):
            before[number](number, frame)
        stop.number = number
        # not by `sys.stderr`, in the midst of whose own write the signal may have come
        with suppress(OSError, ValueError):
            os.write(sys.stderr.fileno(), STOPPING)

    for number in (signal.SIGINT, signal.SIGTERM):
        before[number] = signal.signal(number, handle)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


quiet_option = click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")


@train.group(cls=CommandGroup)
def iuv() -> None:
    """Train the network that paints IUV from what BlazePose finds, on synthetic people.

    \b
    mt train iuv make data/ --people 2500
    mt train iuv fit data/ run/ --steps 20000
    mt train iuv make held-out/ --people 200 --split held-out
    mt train iuv score held-out/ run/weights.safetensors
    """


@iuv.command()
@click.argument("data", type=FILE)
@click.option("--people", type=click.IntRange(1), required=True, help="How many, 4 photos each.")
@click.option(
    "--split",
    type=click.Choice(["train", "held-out"]),
    default="train",
    help="train (default) or held-out: never the same people.",
)
@click.option(
    "--assets",
    type=FILE,
    metavar="DIR",
    help="Folder of MakeHuman's assets, which half of them wear; else MT_ASSETS, if it is set.",
)
@click.option("--heavy", is_flag=True, help="See them as the estimator blazepose-heavy does.")
@click.option("--workers", type=click.IntRange(1), help="Processes; default: one for each core.")
@quiet_option
def make(data: Path, quiet: bool, **options: Any) -> None:
    """Photograph synthetic people, and find them with BlazePose; what is there stays."""
    from motion_transfer.training.iuv.samples import SampleOptions, make_samples

    settings = SampleOptions(out=data, **options)
    prepare_body_model(quiet)
    with CountBar("photographing", unit="person", total=settings.people, quiet=quiet) as bar:
        added = make_samples(settings, bar.advance)
    if not quiet:
        click.echo(f"{data}: {added} of {settings.people} people added")


@iuv.command()
@click.argument("data", type=FILE)
@click.argument("run", type=FILE)
@click.option("--steps", type=click.IntRange(1), help="In all; default 20000.")
@click.option("--batch-size", type=click.IntRange(1), help="People at once; default 16.")
@click.option("--rate", "learning_rate", type=float, help="Highest learning rate; default 0.002.")
@click.option("--init", type=FILE, help="Weights to begin with, of the same sizes.")
@quiet_option
def fit(data: Path, run: Path, quiet: bool, **options: Any) -> None:
    """Train on samples; a run that was stopped goes on where it was."""
    from motion_transfer.training.iuv.trainer import IuvTraining, TrainingSettings

    given = {name: value for name, value in options.items() if value is not None}
    training = IuvTraining(data, run, TrainingSettings(**given))
    steps = training.settings.steps
    with Progress(quiet=quiet) as progress, stop_on_signals() as stop:
        stopped = training.train(progress, stop.asked)
    if stopped:
        stop.end(f"{training.step} of {steps}; the same command goes on", not quiet)
    click.echo(f"{run}/weights.safetensors: {counted(training.step, 'step')}")


@iuv.command()
@click.argument("data", type=FILE)
@click.argument("weights", type=FILE)
def score(data: Path, weights: Path) -> None:
    """Compare the IUV that weights paint with the exact one."""
    import numpy as np

    from motion_transfer.estimate.iuv.network import load_weights
    from motion_transfer.training.iuv.samples import list_samples
    from motion_transfer.training.iuv.trainer import IuvScore, score_samples

    files, network = list_samples(data), load_weights(weights).fused()
    scores = []
    with CountBar("scoring", unit="photo", total=len(files), quiet=False) as bar:
        for each in score_samples(files, network):
            scores.append(each)
            bar.advance(1)
    for entry in fields(IuvScore):
        values = [getattr(each, entry.name) for each in scores]
        worst = np.nanquantile(values, [0.1, 0.9]).round(3)
        click.echo(f"{entry.name:15} mean {np.nanmean(values):.3f}  worst tenth {worst}")
