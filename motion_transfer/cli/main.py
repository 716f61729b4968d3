"""The `mt` command: a group that loads each subcommand when it is called."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import traceback
import warnings
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any

import click
from click.shell_completion import CompletionItem

try:
    import resource
except ImportError:  # Windows has no such limits
    resource = None

from motion_transfer.cli.event_lines import write_line
from motion_transfer.cli.log import show_log
from motion_transfer.cli.options import FILE, CommandGroup
from motion_transfer.cli.settings import Settings
from motion_transfer.cli.terminal import note, printable
from motion_transfer.errors import MotionTransferError, RenderError
from motion_transfer.events import Failed
from motion_transfer.version import __version__

COMMANDS = {
    "run": "Render the person of a photo in the motion of a driver.",
    "preview": "See a run frame by frame in the browser, before it is rendered.",
    "batch": "Render a manifest of many jobs: validate, run, status, report, clean.",
    "source": "Keep a person in one file, encoded once, for any number of runs.",
    "adapt": "Let the network learn one person from their own photos.",
    "demo": "Render a photo and a driver that ship with the program.",
    "train": "Train the network, or fine-tune it on one person.",
    "people": "Synthetic people: photos with exact IUV; drivers from motion, motion from clips.",
    "models": "The networks that find people in raw pictures: fetch them.",
    "eval": "Score renderers, and other methods' pictures, on the same pairs.",
    "calibrate": "Let a checkpoint's network be computed in 8 bits, twice as fast.",
    "export": "Write the networks as ONNX, OpenVINO or TensorRT files, for other programs.",
    "iuv": "IUV from photos and videos; convert IUV between formats, repair it.",
    "inspect": "Say what an IUV file, driver, photo, output or weights file holds.",
    "verify": "Whether an output is what its record says: untouched, of these inputs.",
    "info": "Versions, device, renderers, sizes of a run; part names; what made an output.",
    "completion": "What lets a shell complete commands and options.",
}
HOMES = {"demo": "run", "inspect": "info", "models": "info"}
"""Commands that stand in another one's module."""

OUT_OF_MEMORY = (
    *("can't allocate memory", "Cannot allocate memory", "out of memory", "Insufficient memory"),
    *("bad_alloc", "failed to map segment", "can't start new thread"),
)
"""What libraries say where memory ends, from the loader of libraries on."""

LEAST_ADDRESS_SPACE_BYTES = 3 << 29
"""With two cores OpenBLAS waits without end at 1.2 GiB, and any run needs 1.7."""

NO_ARGUMENTS: Any = getattr(click.exceptions, "NoArgsIsHelpError", ())
"""Help is what a group without a command asks for; the first versions of click 8 print it."""

INTERRUPTED = 130  # 128 and the signal's number, as shells have it
TERMINATED = 143
UNEXPECTED = 1
UNUSABLE = 2  # as InputError has it
GONE = (errno.EIO, errno.ENXIO, errno.ENODEV, errno.ETIMEDOUT, getattr(errno, "ESTALE", errno.EIO))
"""What the system says where a disk fails, or a drive is no longer there."""

DEBUG = click.Option(
    ["--debug"],
    is_flag=True,
    expose_value=False,
    help="After an error, show where in the program it arose.",
    callback=lambda context, _option, value: _remember(context, debug=value),
)
VERBOSE = click.Option(
    ["-v", "--verbose"],
    is_flag=True,
    expose_value=False,
    help="Say on stderr what is chosen and found, with the time of each step.",
    callback=lambda _context, _option, value: show_log() if value else None,
)
"""Options of every command: people add them to one that has just failed."""

EPILOGUE = """\b
Exit codes: 0 done, 1 failed, 2 what was given cannot be used, 130 Ctrl-C, 143 terminated.
Options can stand in a file (--config) or in variables, such as MT_RUN_WORKERS=2.
Both, --json, logs and URLs: docs/pipelines.md.
"""


class LazyGroup(CommandGroup):
    """Knows its commands by name and imports only the one that is used: help is instant."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        _check_address_space()
        module = import_module(f"motion_transfer.cli.{HOMES.get(cmd_name, cmd_name)}")
        # `eval_` for `eval`: a function does not take a builtin's name
        command = getattr(module, cmd_name, None) or getattr(module, f"{cmd_name}_")
        _add_common(command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name, command, rest = super().resolve_command(ctx, args)
        if name and command and not set(ctx.help_option_names) & set(rest):  # help always comes
            quiet = not {"-q", "--quiet"}.isdisjoint(rest)
            settings = Settings(
                *(name, command, ctx.params["config"], os.environ),
                known=list(COMMANDS),
                quiet=quiet,
            )
            ctx.default_map = settings.tree
            ctx.ensure_object(dict)["settings"] = settings
        return name, command, rest

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete commands without importing them all, as a shell waits for that."""
        names = [name for name in COMMANDS if name.startswith(incomplete)]
        commands = [CompletionItem(name, help=COMMANDS[name]) for name in names]
        return commands + click.Command.shell_complete(self, ctx, incomplete)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]}, epilog=EPILOGUE
)
@click.option(
    "--config",
    type=FILE,
    envvar="MT_CONFIG",
    help="Defaults of options: TOML with a table for each command, such as [run]. Goes before the"
    " command.",
)
@click.version_option(__version__, "-V", "--version", message="motion-transfer %(version)s")
def cli(config: Path | None) -> None:
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
    # NumPy's would begin with a fifth of a second of work each, and multiply nothing large here
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # what Apple's GPUs lack, the CPU computes
    os.environ.setdefault("PYTORCH_ENABLE_MPS_FALLBACK", "1")
    for stream in (sys.stdout, sys.stderr):  # Windows' old code pages lack many characters
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    settings: dict[str, Any] = {"debug": False}
    try:
        with warnings.catch_warnings():
            if not sys.warnoptions:  # what libraries tell developers is not for users
                warnings.simplefilter("ignore")
            code = cli.main(args=arguments, prog_name="mt", standalone_mode=False, obj=settings)
            sys.stdout.flush()
    except NO_ARGUMENTS as error:
        error.show()
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return _fail(settings, INTERRUPTED, ["interrupted, nothing half-written was left behind"])
    except Terminated:
        return _fail(settings, TERMINATED, ["terminated, nothing half-written was left behind"])
    except Exception as error:
        if settings["debug"]:
            traceback.print_exc()
        if isinstance(error, click.ClickException):
            return _fail(settings, error.exit_code, [_explain_usage(error, settings)])
        return _fail(settings, *_explain(error))
    return code if isinstance(code, int) else 0  # click returns the code of an early exit


def _fail(settings: dict[str, Any], code: int, words: list[str]) -> int:
    """Say why a command ends, to people and to programs; give its exit code."""
    for line in words:
        click.echo(f"mt: {line}", err=True)
    elsewhere, context = settings.get("settings"), settings.get("context")
    if code == UNUSABLE and elsewhere and context:  # what nobody typed is easily forgotten
        origins = [f"{flag} ({where})" for flag, where in elsewhere.origins(context)]
        if origins:
            note(f"set elsewhere: {', '.join(origins)}")
    if settings.get("json"):
        with suppress(OSError):  # it may be the very pipe that broke
            click.echo(write_line(Failed(code, "\n".join(words))))
            sys.stdout.flush()
    return code


def _explain_usage(error: click.ClickException, settings: dict[str, Any]) -> str:
    """Say in one line what click says in three, and where help is."""
    message = error.format_message()
    context = getattr(error, "ctx", None)
    if isinstance(error, click.NoSuchOption):
        near = (error.possibilities or [""])[0]
        message = f"no option {error.option_name}" + (f"; did you mean {near}?" if near else "")
    elif isinstance(error, click.BadParameter) and error.param and context:
        elsewhere = settings.get("settings")
        origin = elsewhere.origin(context, error.param) if elsewhere else ""
        message = f"{origin}: {error.message}" if origin else message
    message = printable(" ".join(message.split())).rstrip(".")
    message = message[0].lower() + message[1:] if message.partition(" ")[0].istitle() else message
    if context is None:
        return message
    see = f"ee `{context.command_path} --help`"
    return f"{message} S{see}" if message.endswith("?") else f"{message}; s{see}"


def _explain(error: Exception) -> tuple[int, list[str]]:
    """Give the exit code of an error, and what to say of it."""
    match error:
        case MotionTransferError():
            return error.exit_code, [printable(line) for line in error.lines]
        case OSError() if _while_printing(error):
            return UNEXPECTED, [f"cannot write to standard output: {error.strerror}"]
        case _ if _is_memory_error(error):
            return UNEXPECTED, [
                "the memory is used up; give fewer --workers, a smaller picture, or more memory (or"
                " threads, see `ulimit -a`)"
            ]
        case OSError() if error.filename is not None:  # a name that no check has foreseen
            return UNUSABLE, [printable(f"{os.fsdecode(error.filename)}: {error.strerror}")]
        case OSError() if error.errno in GONE:
            return UNEXPECTED, [
                f"a file could not be read or written ({error.strerror}): its disk or network"
                " fails; see to that, then give the command again"
            ]
    kind, said = type(error).__name__, printable(next(iter(str(error).splitlines()), ""))
    return UNEXPECTED, [
        f"unexpected {kind}{': ' * bool(said)}{said}; this is a fault of the program: please report"
        " it with what --debug adds"
    ]


def _while_printing(error: Exception) -> bool:
    """Tell whether it was the result that could not be printed."""
    return any(
        frame.f_code is click.echo.__code__ for frame, _ in traceback.walk_tb(error.__traceback__)
    )


def _is_memory_error(error: Exception) -> bool:
    """Tell whether memory, or the threads that are allowed, ran out; libraries have many words."""
    return (
        isinstance(error, MemoryError)
        or (isinstance(error, OSError) and error.errno in (errno.ENOMEM, errno.EAGAIN))
        or any(mark in str(error) for mark in OUT_OF_MEMORY)
    )


def _check_address_space() -> None:
    """Refuse a limit under which libraries would not begin, but crash or wait without end.

    Raises: RenderError.
    """
    if resource is None:
        return
    allowed_bytes = resource.getrlimit(resource.RLIMIT_AS)[0]
    if allowed_bytes != resource.RLIM_INFINITY and allowed_bytes < LEAST_ADDRESS_SPACE_BYTES:
        raise RenderError(
            f"only {allowed_bytes >> 20} MiB of memory may be addressed, and libraries alone need"
            f" {LEAST_ADDRESS_SPACE_BYTES >> 20}; allow more by `ulimit -v`, best unlimited"
        )


def _add_common(command: click.Command) -> None:
    if DEBUG not in command.params:
        command.params += [VERBOSE, DEBUG]
    if isinstance(command, click.Group):
        for inner in command.commands.values():
            _add_common(inner)


def _remember(context: click.Context, *, debug: bool) -> None:
    settings = context.find_root().ensure_object(dict)
    settings["debug"] = debug or settings.get("debug", False)
    settings["context"] = context


def entry_point() -> None:
    """Run the installed `mt` script."""
    code = main()
    try:
        sys.stdout.flush()
    except OSError:
        # `main` has told of it; some Pythons try once more at their end, and exit by 120 then
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)


def _terminate(_signal: int, _frame: FrameType | None) -> None:
    raise Terminated
