"""The `mt` command: a group that loads each subcommand when it is called."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from types import FrameType

import click

from motion_transfer.errors import MotionTransferError
from motion_transfer.version import __version__

COMMANDS = {
    "run": "Render the person of a photo in the motion of a driver.",
    "preview": "See a run frame by frame in the browser, before it is rendered.",
    "batch": "Render a manifest of many jobs: validate, run, status, report, clean.",
    "demo": "Render a photo and a driver that ship with the program.",
    "train": "Train the network, or fine-tune it on one person.",
    "people": "Synthetic people: photos with exact IUV, and drivers from motion.",
    "models": "The networks that find people in raw pictures: fetch them.",
    "eval": "Score renderers, and other methods' pictures, on the same pairs.",
    "iuv": "IUV from photos and videos; convert IUV between formats, repair it.",
    "inspect": "Say what an IUV file, driver, photo or weights file holds.",
    "info": "Versions, device, renderers, sizes of a run; part names.",
}
HOMES = {"demo": "run", "inspect": "info", "models": "info"}
"""Commands that stand in another one's module."""

INTERRUPTED = 130  # 128 and the signal's number, as shells have it
TERMINATED = 143


class LazyGroup(click.Group):
    """Knows its commands by name and imports only the one that is used: help is instant."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"motion_transfer.cli.{HOMES.get(cmd_name, cmd_name)}")
        # `eval_` for `eval`: a function does not take a builtin's name
        return getattr(module, cmd_name, None) or getattr(module, f"{cmd_name}_")

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, "-V", "--version", message="motion-transfer %(version)s")
def cli() -> None:
    """One photo of a person plus the motion of another becomes a video.

    \b
    mt demo
    mt run --source photo.png --driver iuv_frames/ -o out.mp4
    mt run --source me.jpg --driver dance.mp4 -o out.mp4
    """


class Terminated(BaseException):
    """Raised by SIGTERM; not a KeyboardInterrupt, which click would take for Ctrl-C."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command; every failure becomes one line on stderr and an exit code."""
    signal.signal(signal.SIGTERM, _terminate)
    # torch's threads would spin while they wait, and take the cores from decoding and encoding;
    # read when torch is first imported, which no command has done yet
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    try:
        code = cli.main(args=arguments, prog_name="mt", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except MotionTransferError as error:
        click.echo(f"mt: {error}", err=True)
        return error.exit_code
    except Terminated:
        click.echo("mt: terminated, nothing half-written was left behind", err=True)
        return TERMINATED
    except (KeyboardInterrupt, click.Abort):
        click.echo("mt: interrupted, nothing half-written was left behind", err=True)
        return INTERRUPTED
    return code if isinstance(code, int) else 0  # click returns the code of an early exit


def entry_point() -> None:
    """Run the installed `mt` script."""
    sys.exit(main())


def _terminate(_signal: int, _frame: FrameType | None) -> None:
    raise Terminated
