"""Whatever goes wrong is one line and an exit code."""

from __future__ import annotations

import errno
import logging
import re
import subprocess
import sys
import warnings
from pathlib import Path

import click
import pytest

from motion_transfer.cli import main as program
from motion_transfer.cli.terminal import printable
from motion_transfer.errors import InputError, RenderError

ENTRY_POINT = "from motion_transfer.cli.main import entry_point; entry_point()"


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch):
    """Make `mt info` raise."""

    def fail_with(error: BaseException) -> None:
        @click.command()
        def info() -> None:
            raise error

        monkeypatch.setattr("motion_transfer.cli.info.info", info)

    return fail_with


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (InputError("driver a is none"), 2, "mt: driver a is none"),
        (InputError("one", "two"), 2, "mt: one\nmt: two"),
        (RenderError("the encoder stopped"), 1, "mt: the encoder stopped"),
        (InputError("driver a\nb\x1b[31m is none"), 2, r"mt: driver a\nb\x1b[31m is none"),
        (InputError("driver \udcff is none"), 2, r"mt: driver \udcff is none"),
        (OSError(errno.ENAMETOOLONG, "File name too long", "x"), 2, "mt: x: File name too long"),
        (MemoryError(), 1, "mt: the memory is used up; give fewer --workers"),
        (RuntimeError("DefaultCPUAllocator: can't allocate memory: you"), 1, "mt: the memory is"),
        (RuntimeError("can't start new thread"), 1, "mt: the memory is used up"),
        (Exception("std::bad_alloc"), 1, "mt: the memory is used up"),
        (ImportError("x.so: failed to map segment from shared object"), 1, "mt: the memory is"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), 1, "mt: the memory is"),
        (OSError(errno.ENOMEM, "Cannot allocate memory", "x"), 1, "mt: the memory is used up"),
        (OSError(errno.EIO, "Input/output error"), 1, "mt: a file could not be read or written"),
        (KeyError("key"), 1, "mt: unexpected KeyError: 'key'; this is a fault of the program"),
        (RecursionError(), 1, "mt: unexpected RecursionError; this is a fault of the program"),
        (ValueError("one\ntwo"), 1, "mt: unexpected ValueError: one; this"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_every_error_is_one_line(
    failing, capsys, error: BaseException, code: int, line: str
) -> None:
    failing(error)
    assert program.main(["info"]) == code
    said = capsys.readouterr().err
    assert said.startswith(line)
    assert said.count("\n") == line.count("\n") + 1
    assert "Traceback" not in said


def test_debug_shows_where(failing, capsys) -> None:
    failing(KeyError("key"))
    assert program.main(["info", "--debug"]) == 1
    said = capsys.readouterr().err
    assert "Traceback" in said
    assert "in info" in said
    assert said.splitlines()[-1].startswith("mt: unexpected KeyError")


@pytest.mark.parametrize("command", [["run"], ["iuv", "convert"], ["batch", "status"], ["demo"]])
def test_every_command_takes_debug(command: list[str], capsys) -> None:
    program.main([*command, "--help"])
    assert "--debug" in capsys.readouterr().out


def test_warnings_of_libraries_are_kept_from_users(monkeypatch, capsys) -> None:
    @click.command()
    def info() -> None:
        warnings.warn("for developers", stacklevel=1)

    monkeypatch.setattr("motion_transfer.cli.info.info", info)
    monkeypatch.setattr(sys, "warnoptions", [])
    assert program.main(["info"]) == 0
    assert capsys.readouterr().err == ""


def test_a_limit_under_which_libraries_crash_is_one_line(monkeypatch, capsys) -> None:
    monkeypatch.setattr(program.resource, "getrlimit", lambda _which: (1200 << 20, 1 << 40))
    assert program.main(["info", "parts"]) == 1
    assert capsys.readouterr().err == (
        "mt: only 1200 MiB of memory may be addressed, and libraries alone need 1536; allow more by"
        " `ulimit -v`, best unlimited\n"
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux' /dev/full")
@pytest.mark.parametrize("arguments", [["--help"], ["info", "parts"], ["run", "--help"]])
def test_a_full_standard_output_is_one_line(arguments: list[str]) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-c", ENTRY_POINT, *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "mt: cannot write to standard output: No space left on device\n"


def test_what_a_terminal_would_obey_is_written_out() -> None:
    assert printable("größe 人.png") == "größe 人.png"
    assert printable("a\tb\r\x07‮c") == "a\\tb\\r\\x07\\u202ec"


def test_verbose_shows_our_log_and_no_library_s(monkeypatch, capsys) -> None:
    @click.command()
    def info() -> None:
        logging.getLogger("motion_transfer.render.run").debug("two\nlines")
        logging.getLogger("PIL").debug("for developers")

    monkeypatch.setattr("motion_transfer.cli.info.info", info)
    log = logging.getLogger("motion_transfer")
    monkeypatch.setattr(log, "handlers", [])
    monkeypatch.setattr(log, "level", logging.WARNING)
    monkeypatch.setattr(log, "propagate", True)
    assert program.main(["info"]) == 0
    assert capsys.readouterr().err == ""
    for _ in range(2):  # the second time, it is not said twice
        assert program.main(["info", "-v"]) == 0
        (line,) = capsys.readouterr().err.splitlines()
        assert re.fullmatch(r"mt: [0-9-]+T[0-9:.]+ DEBUG test_main: two\\nlines", line)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["rum"], "no command 'rum'; did you mean run? See `mt --help`"),
        (["batch", "stat"], "no command 'stat'; did you mean status? See `mt batch --help`"),
        (["qqq"], "no command 'qqq'; see `mt --help`"),
        (["run", "--drivr", "a"], "no option --drivr; did you mean --driver? See `mt run --help`"),
        (["run", "a"], "missing option '--source'; see `mt run --help`"),
    ],
)
def test_wrong_usage_is_one_line_in_the_one_style(capsys, arguments: list[str], line: str) -> None:
    assert program.main(arguments) == program.UNUSABLE
    said = capsys.readouterr().err
    assert said.startswith(f"mt: {line}")
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "code"),
    [(KeyboardInterrupt(), 130), (program.Terminated(), 143), (click.Abort(), 130)],
)
def test_exit_codes_of_signals(failing, capsys, error: BaseException, code: int) -> None:
    failing(error)
    assert program.main(["info"]) == code
    assert str(code) in program.EPILOGUE  # where `mt --help` tells them
