"""What `mt completion` prints works in a shell, and what it asks for is told quickly."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from motion_transfer.cli.completion import SHELLS
from motion_transfer.cli.main import COMMANDS, main

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_is_told_whom_to_ask(shell: str, capsys) -> None:
    assert main(["completion", shell]) == 0
    told = capsys.readouterr().out
    assert f"_MT_COMPLETE={shell}_complete" in told


def completions(words: str) -> list[str]:
    """Ask as bash does."""
    environment = {"_MT_COMPLETE": "bash_complete", "COMP_WORDS": words}
    environment["COMP_CWORD"] = str(len(words.split(" ")) - 1)
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "motion_transfer"],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "torch" not in done.stderr
    return [line.partition(",")[2] for line in done.stdout.splitlines()]


def test_commands_and_options_are_completed() -> None:
    assert completions("mt ") == list(COMMANDS)
    assert completions("mt pre") == ["preview"]
    assert completions("mt run --dev") == ["--device"]


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_takes_the_script(capsys, tmp_path: Path) -> None:
    main(["completion", "bash"])
    script = capsys.readouterr().out + "\ncomplete -p mt\n"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "_mt_completion" in done.stdout
