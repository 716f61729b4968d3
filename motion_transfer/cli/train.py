"""`mt train`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import click
from tqdm import tqdm

from motion_transfer.cli.people import prepare_body_model
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.sections import SectionCommand, SectionOption
from motion_transfer.errors import InputError

FILE = click.Path(path_type=Path)
SETTINGS = {  # option: the setting that it stands for
    "data": "data.source",
    "images": "data.images",
    "people": "data.people",
    "people_cache": "data.people_cache",
    "skip_broken": "data.skip_broken",
    "preset": "model.preset",
    "variant": "model.variant",
    "init": "run.init",
    "steps": "run.steps",
    "seed": "run.seed",
    "licence": "run.licence",
    "batch_size": "optimiser.batch_size",
    "perceptual": "losses.perceptual",
    "identity": "losses.identity",
    "adversarial": "losses.adversarial",
    "precision": "speed.precision",
    "compile_networks": "speed.compile",
    "workers": "speed.workers",
}


def section(heading: str) -> Any:
    """An option decorator whose options stand under one heading."""
    return partial(click.option, cls=SectionOption, section=heading)


run_option = section("Run")
data_option = section("Data")
model_option = section("Model")
loss_option = section("Losses (the paper's; one without its network is an error)")
speed_option = section("Speed")


@click.command(cls=SectionCommand)
@run_option("-o", "--output", type=FILE, metavar="RUN", help="A new folder for the run.")
@run_option("--resume", type=FILE, metavar="RUN", help="Go on with a run that was stopped.")
@run_option("--config", type=FILE, help="A train.toml; options and --set come after it.")
@run_option(
    "--set", "assignments", multiple=True, metavar="SECTION.KEY=VALUE", help="Any setting of it."
)
@run_option("--steps", type=int, help="Updates in all; default 100000.")
@run_option("--seed", type=int, help="Of weights, order and crops; default 0.")
@run_option("--licence", help="Of the weights, stored with them.")
@run_option("-q", "--quiet", is_flag=True, help="Say nothing but errors and where the weights are.")
@data_option(
    "--data",
    metavar="people|CSV|FOLDER",
    help="Synthetic people (default); a CSV of pairs from,to; a folder with pairs.csv, of clips"
    " with their IUV, or of one person's photos.",
)
@data_option("--images", help="Folder that a CSV's names are relative to; else the CSV's.")
@data_option("--people", type=int, help="How many; default 64, 0 for ever new ones.")
@data_option("--people-cache", metavar="DIR", help="Folder that keeps them; default RUN/people.")
@data_option("--skip-broken", is_flag=True, default=None, help="Leave out pairs with a problem.")
@model_option("--preset", metavar="lite|paper", help="Sizes of the networks; default lite.")
@model_option("--variant", metavar="NAME", help="full (default), no-int, ip, warp or warp-cond.")
@model_option("--init", metavar="FILE", help="Weights to start from, for fine-tuning.")
@loss_option(
    "--perceptual",
    metavar="NAME",
    help="efficientnet-lite0 (default) or vgg19 (the paper's, from torchvision's cache).",
)
@loss_option("--vgg19", "vgg19_file", metavar="FILE", help="VGG-19's weights; chooses it as well.")
@loss_option("--no-perceptual", is_flag=True, help="Leave the perceptual loss out.")
@loss_option("--sphereface", "sphereface_file", metavar="FILE", help="Weights for the face loss.")
@loss_option("--no-identity", is_flag=True, help="Leave the face loss out; default with people.")
@loss_option("--no-adversarial", is_flag=True, help="Leave the discriminator out.")
@speed_option("--batch-size", type=int, help="Pairs at once on each device; default 4.")
@speed_option(
    "--bf16/--fp32", "bf16", default=None, help="Default: bf16 where the hardware multiplies it."
)
@speed_option(
    "--compile/--no-compile", "compile_networks", default=None, help="Compile; default: no."
)
@speed_option("--workers", type=int, help="Processes that read data; default: half of the cores.")
def train(
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
    accelerate launch --multi-gpu -m motion_transfer train --config train.toml -o run/

    A run that is stopped (Ctrl-C, SIGTERM) writes a checkpoint first. Several devices are started
    by `accelerate launch`.
    """
    from motion_transfer.training.config_file import parse_assignment, read_settings, write_toml
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
    quiet_here = quiet or not is_first_process()
    if not quiet_here:
        click.echo(write_toml(planned.config), err=True)
    progress = Progress(planned.config.run.steps, quiet=quiet_here)
    trainer = _prepare(planned, progress, quiet=quiet_here)
    with stop_on_signals() as stop:
        result = trainer.train(lambda: stop.number is not None)
    progress.close()
    if is_first_process():
        click.echo(
            f"{result.weights}: {result.step} steps, {result.samples_per_second:.2f} samples/s,"
            f" {result.wait_share:.0%} of the time waiting for data"
        )
    if result.stopped:
        if is_first_process():
            click.echo(
                f"mt: stopped at step {result.step} of {planned.config.run.steps}; go on with"
                f" mt train --resume {planned.folder}",
                err=True,
            )
        raise click.exceptions.Exit(128 + int(stop.number or signal.SIGINT))


def _prepare(planned: Any, progress: Progress, *, quiet: bool) -> Any:
    """Read or make the data; stopped here, a run goes on with what is there already."""
    from motion_transfer.people.extra import require_people
    from motion_transfer.training.config import PEOPLE
    from motion_transfer.training.runs import prepare

    if planned.config.data.source == PEOPLE:
        require_people()
        prepare_body_model(quiet)
    with (
        CountBar("photographing", unit="person", quiet=quiet) as people,
        CountBar("looking at the pairs", unit="picture", quiet=quiet) as pictures,
    ):
        return prepare(planned, progress, photographed=people.advance, looked=pictures.advance)


class Progress:
    """A bar on a terminal, and a line for each log event where there is none."""

    def __init__(self, steps: int, *, quiet: bool) -> None:
        self._quiet, self._steps = quiet, steps
        self._bar: tqdm | None = None

    def __call__(self, event: Any) -> None:
        from motion_transfer.training.events import Logged, Note

        if self._quiet:
            return
        if isinstance(event, Note):
            tqdm.write(f"mt: note: {event.message}", file=sys.stderr)
        elif isinstance(event, Logged):
            terms = " ".join(f"{name} {value:.4f}" for name, value in event.terms.items())
            rate = f"{event.samples_per_second:.2f} samples/s, waiting {event.wait_share:.0%}"
            if not sys.stderr.isatty():
                click.echo(f"step {event.step}/{self._steps}: {terms}; {rate}", err=True)
                return
            if self._bar is None:
                self._bar = tqdm(total=self._steps, unit="step", dynamic_ncols=True, leave=False)
                self._bar.n = self._bar.last_print_n = event.step
            self._bar.set_postfix_str(f"{terms}; {rate}", refresh=False)
            self._bar.update(event.step - self._bar.n)

    def close(self) -> None:
        """Take the bar off the screen."""
        if self._bar is not None:
            self._bar.close()


class Stop:
    """Which signal asked to stop, if one did."""

    number: int | None = None


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """The first Ctrl-C or SIGTERM lets the step end and be kept; the second stops at once."""
    stop = Stop()
    before: dict[int, Any] = {}

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.number is not None and callable(before[number]):
            before[number](number, frame)
        stop.number = number
        click.echo("mt: stopping after this step; once more to stop at once", err=True)

    for number in (signal.SIGINT, signal.SIGTERM):
        before[number] = signal.signal(number, handle)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _settings_of(options: dict[str, Any]) -> dict[str, Any]:
    """What was said on the command line, as settings."""
    from motion_transfer.training.config_file import check_value

    if options.pop("no_perceptual"):
        _refuse_both(options, "perceptual", "vgg19_file", but="--no-perceptual")
        options["perceptual"] = "none"
    if options.pop("no_identity"):
        _refuse_both(options, "sphereface_file", but="--no-identity")
        options["identity"] = "none"
    if options.pop("no_adversarial"):
        options["adversarial"] = False
    settings = {}
    for option, network, name in (
        ("vgg19_file", "perceptual", "vgg19"),
        ("sphereface_file", "identity", "sphereface"),
    ):
        file = options.pop(option)
        if file is not None:
            settings[f"losses.{option}"] = file
            options[network] = name
    bf16 = options.pop("bf16")
    if bf16 is not None:
        options["precision"] = "bf16" if bf16 else "fp32"
    for option, value in options.items():
        if value is not None:
            settings[SETTINGS[option]] = check_value(SETTINGS[option], value)
    return settings


def _refuse_both(options: dict[str, Any], *names: str, but: str) -> None:
    for name in names:
        if options[name] is not None:
            raise InputError(f"--{name.removesuffix('_file')} and {but} contradict each other")
