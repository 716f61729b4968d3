"""Help is instant and complete."""

from __future__ import annotations

import subprocess
import sys
import time

import click
import pytest

from motion_transfer.cli.main import COMMANDS

HELP = """
import sys
from motion_transfer.cli.main import main
code = main(sys.argv[1:])
print([name for name in ("torch", "cv2", "av", "numpy") if name in sys.modules])
"""
PATIENCE_SECONDS = 1.5  # it takes 0.2 on an idle machine


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["--version"],
        ["run", "--help"],
        ["demo", "-h"],
        ["info", "-h"],
        ["eval", "-h"],
        ["export", "-h"],
        ["iuv", "repair", "-h"],
        ["iuv", "estimate", "-h"],
    ],
)
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    began = time.perf_counter()
    result = subprocess.run(
        [sys.executable, "-c", HELP, *arguments], capture_output=True, text=True, check=True
    )
    assert result.stdout.splitlines()[-1] == "[]"
    assert result.stderr == ""
    assert time.perf_counter() - began < PATIENCE_SECONDS


def test_help_lists_every_command(mt) -> None:
    result = mt("--help")
    assert (result.code, result.err) == (0, "")
    for command, sentence in COMMANDS.items():
        assert f"{command} " in result.out
        assert sentence[:40] in result.out


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(mt, command: str) -> None:
    result = mt(command, "--help")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"Usage: mt {command} ")


def test_help_of_run_has_sections_in_order(mt) -> None:
    lines = mt("run", "--help").out.splitlines()
    headings = [line for line in lines if line.endswith(":") and not line.startswith(" ")]
    assert headings[:7] == [
        *("Source:", "Driver:", "Raw pictures:"),
        *("Garment transfer:", "Rendering:", "Scene:", "Output:"),
    ]


@pytest.mark.parametrize("command", ["run", "eval"])
def test_every_option_is_explained(mt, command: str) -> None:
    from motion_transfer.cli.main import cli

    found = cli.get_command(click.Context(cli), command)
    assert found is not None
    text = mt(command, "--help").out
    for parameter in found.params:
        assert parameter.help, parameter.name
        assert all(option in text for option in parameter.opts)


def test_the_module_is_the_command() -> None:
    from motion_transfer import __version__

    result = subprocess.run(
        [sys.executable, "-m", "motion_transfer", "--version"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert result.stdout == f"motion-transfer {__version__}\n"


def test_public_names() -> None:
    import motion_transfer

    assert sorted(motion_transfer.__all__) == [
        *("EncodedSource", "Garment", "MotionTransfer", "MotionTransferError", "Partner"),
        *("RenderOptions", "RenderReport", "RenderedFrames"),
        *("__version__", "estimate_frames", "render_video"),
    ]
    for name in motion_transfer.__all__:
        assert getattr(motion_transfer, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'render_audio'"):
        _ = motion_transfer.render_audio
