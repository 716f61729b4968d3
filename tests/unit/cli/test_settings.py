"""Options in files and variables: who goes first, and what is said of what is wrong there."""

from __future__ import annotations

import json
from pathlib import Path

import click
import pytest

from motion_transfer.cli import main as program
from motion_transfer.cli.main import COMMANDS
from motion_transfer.cli.settings import Settings


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> dict:
    """What `mt run` was given, instead of a run."""
    options: dict = {}

    def hear(given, _listener) -> None:
        options.update(vars(given))

    monkeypatch.setattr("motion_transfer.render.run.run", hear)
    return options


RUN = ("run", "--source", "a.png", "--driver", "b", "-o", "c.mp4")


def write(folder: Path, text: str) -> Path:
    path = folder / "mt.toml"
    path.write_text(text)
    return path


def test_command_line_before_variable_before_file(heard, tmp_path, monkeypatch) -> None:
    config = write(tmp_path, "[run]\nworkers = 2\nfps = 25\ncompare = true\ncrf = 20\n")
    monkeypatch.setenv("MT_RUN_WORKERS", "3")
    monkeypatch.setenv("MT_RUN_CRF", "21")
    assert program.main(["--config", str(config), *RUN, "--crf", "22"]) == 0
    assert (heard["workers"], heard["crf"], heard["compare"]) == (3, 22, True)
    assert heard["frame_rate"] == 25
    monkeypatch.delenv("MT_RUN_WORKERS")
    monkeypatch.setenv("MT_CONFIG", str(config))
    assert program.main([*RUN]) == 0
    assert heard["workers"] == 2


def test_an_option_that_has_to_be_given_may_stand_there(heard, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("MT_RUN_SOURCE", "front one.jpg\nback.jpg")
    config = write(tmp_path, '[run]\ndriver = "people:walk"\noutput = "x.mp4"\nsource-iuv = []\n')
    assert program.main(["--config", str(config), "run"]) == 0
    assert heard["source"] == (Path("front one.jpg"), Path("back.jpg"))
    assert heard["driver"] == Path("people:walk")


def test_commands_of_commands_have_tables_of_their_own(tmp_path, capsys) -> None:
    config = write(tmp_path, "[batch.run]\nworkers = 0\n")
    assert program.main(["--config", str(config), "batch", "run", "nowhere.yaml"]) == 2
    said = capsys.readouterr().err
    assert "workers is 0" in said
    assert f"mt: note: set elsewhere: --workers ({config}:2: batch.run.workers)" in said


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[run]\nworkres = 2\n", "2: run.workres: `mt run` has no such option; did you mean work"),
        ("[rum]\nworkers = 2\n", "1: rum: no command is called that; did you mean run?"),
        ("run = 3\n", "1: run: a command is a table, such as [run]"),
        ("[run]\nworkers = [1, 2]\n", "2: run.workers: workers takes one value, and no list"),
        ("[run]\nfps = true\n", "2: run.fps: fps takes a text or a number, and not True"),
        ("[run]\nworkers = 2.5\n", "2: run.workers: '2.5' is not a valid integer; see `mt run --"),
        ('[run]\nforce = "perhaps"\n', "2: run.force: 'perhaps' is not a valid boolean"),
        ("[run\n", " Expected ']'"),
    ],
)
def test_what_is_wrong_in_a_file_is_one_line(tmp_path, capsys, text: str, line: str) -> None:
    config = write(tmp_path, text)
    assert program.main(["--config", str(config), *RUN]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"mt: {config}:{line}")
    assert said.count("\n") == 1


def test_a_wrong_variable_is_named(heard, monkeypatch, capsys) -> None:
    monkeypatch.setenv("MT_RUN_WORKERS", "two")
    assert program.main([*RUN]) == 2
    said = capsys.readouterr().err
    assert said == "mt: MT_RUN_WORKERS: 'two' is not a valid integer; see `mt run --help`\n"
    assert program.main([*RUN, "--workers", "1"]) == 0


def test_a_variable_that_is_no_option_is_told_of(heard, monkeypatch, capsys) -> None:
    monkeypatch.setenv("MT_RUN_WORKRES", "2")
    assert program.main([*RUN]) == 0  # it may be somebody else's
    assert capsys.readouterr().err == (
        "mt: note: the variable MT_RUN_WORKRES is no option of `mt run`; did you mean"
        " MT_RUN_WORKERS?\n"
    )


def test_help_comes_whatever_is_set(monkeypatch, tmp_path, capsys) -> None:
    config = write(tmp_path, "[rum]\n")
    assert program.main(["--config", str(config), "run", "--help"]) == 0


def options_of(command: click.Command, place: tuple[str, ...]):
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            yield place, parameter
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            yield from options_of(inner, (*place, name))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_of_every_command_has_a_variable(name: str) -> None:
    command = program.cli.get_command(click.Context(program.cli), name)
    assert command is not None
    for place, option in options_of(command, (name,)):
        word = max(option.opts, key=len).strip("-").replace("-", "_")
        variable = "_".join(("MT", *place, word)).upper().replace("-", "_")
        value = "1"
        settings = Settings(name, command, None, {variable: value}, known=[], quiet=False)
        tree = settings.tree
        for step in place:
            tree = tree[step]
        found = {key: kept for key, kept in tree.items() if not isinstance(kept, dict)}
        assert found == {option.name: [value] if option.multiple else value}, variable


def test_json_tells_of_failures(tmp_path, capsys) -> None:
    assert program.main(["run", "--crf", "good", "--json"]) == 2
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert told["event"] == "failed"
    assert (told["version"], told["exit_code"]) == (1, 2)
    assert err == f"mt: {told['message']}\n"
