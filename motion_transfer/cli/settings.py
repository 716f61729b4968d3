"""Options that stand in a file (`--config`) or in variables (`MT_RUN_WORKERS`), not in the command.

One mechanism for every option of every command: what is found becomes click's defaults for the
command that is called, as text, so that it is checked as if it had been typed. The command line
goes before variables, these before the file, and the file before an option's own default.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.terminal import note
from motion_transfer.errors import InputError, did_you_mean

PREFIX = "MT"
Place = tuple[str, ...]
"""A command's words, such as `("batch", "run")`, with an option's behind them."""

Tree = dict[str, Any]
"""Values by the parameter's name, and those of a command's commands by theirs."""


class Settings:
    """What stands elsewhere for one command, and where.

    Attributes:
        tree: As click's `default_map` has it.
    """

    def __init__(
        self,
        name: str,
        command: click.Command,
        config: Path | None,
        variables: Mapping[str, str],
        *,
        known: list[str],
        quiet: bool,
    ) -> None:
        """Gather it.

        Args:
            known: All commands: what a file may have tables of.
        Raises: InputError naming the file's line for what is no option, or no value of one.
        """
        self._places: dict[tuple[str, str], str] = {}
        self._quiet = quiet
        self._variables = {k: v for k, v in variables.items() if v}  # empty: as if it were unset
        self._config = config
        table: Any = {}
        if config is not None:
            from motion_transfer.media.structured import read_structured  # loads libyaml

            self._content = read_structured(config, "config")
            data = {} if self._content.data is None else self._content.data
            if not isinstance(data, dict):
                raise InputError(f"{config}: options stand in tables, such as [run]")
            for key in data:
                if key not in known:
                    raise InputError(
                        f"{self._where((key,))}: no command is called that"
                        f"{did_you_mean(key, known)}"
                    )
            table = data.get(name)
        self.tree = {name: self._gather((name,), command, table)}

    def origins(self, context: click.Context) -> Iterator[tuple[str, str]]:
        """List the options of a command that were not typed, and where each stands."""
        for parameter in context.command.params:
            if origin := self.origin(context, parameter):
                yield max(parameter.opts, key=len), origin

    def origin(self, context: click.Context, parameter: click.Parameter) -> str:
        """Say where an option's value stands; nothing if it was typed, or is its own default."""
        source = context.get_parameter_source(parameter.name or "")
        if source is not click.core.ParameterSource.DEFAULT_MAP:
            return ""
        return self._places.get((context.command_path, parameter.name or ""), "")

    def _gather(self, place: Place, command: click.Command, table: Any) -> Tree:
        options = {_word(p): p for p in command.params if isinstance(p, click.Option)}
        inner = command.commands if isinstance(command, click.Group) else {}
        tree: Tree = {}
        tables: dict[str, Any] = {}
        if not isinstance(table, dict | None):
            raise InputError(f"{self._where(place)}: a command is a table, such as [{place[-1]}]")
        for key, value in (table or {}).items():
            if key in inner:
                tables[key] = value
            elif key.replace("-", "_") in options:
                self._set(tree, place, options[key.replace("-", "_")], value, self._where, key)
            else:
                known = [*options, *inner]
                raise InputError(
                    f"{self._where((*place, key))}: `mt {' '.join(place)}` has no such option"
                    f"{did_you_mean(key, known)}"
                )
        for variable, word in self._variables_of(place, list(inner)):
            if word in options:
                parameter, text = options[word], self._variables[variable]
                value = text.splitlines() if parameter.multiple else text
                self._set(tree, place, parameter, value, lambda _place, v=variable: v, word)
            else:  # somebody else may use the prefix
                known = [_variable((*place, each)) for each in options]
                words = f"the variable {variable} is no option of `mt {' '.join(place)}`"
                note(words + did_you_mean(variable, known), quiet=self._quiet)
        for name, each in inner.items():
            tree[name] = self._gather((*place, name), each, tables.get(name))
        return tree

    def _variables_of(self, place: Place, inner: list[str]) -> Iterator[tuple[str, str]]:
        """List variables that are named after a command, but for those of its commands."""
        prefix = f"{_variable(place)}_"
        deeper = tuple(f"{_variable((*place, name))}_" for name in inner)
        for variable in sorted(self._variables):
            if variable.startswith(prefix) and not variable.startswith(deeper):
                yield variable, variable.removeprefix(prefix).lower()

    def _set(
        self, tree: Tree, place: Place, option: click.Option, value: Any, where: Any, key: str
    ) -> None:
        origin = where((*place, key))
        several = value if isinstance(value, list) else [value]
        flag = option.is_flag
        if isinstance(value, list) and not option.multiple:
            raise InputError(f"{origin}: {key} takes one value, and no list")
        for each in several:
            if not isinstance(each, str | int | float) or (isinstance(each, bool) and not flag):
                raise InputError(f"{origin}: {key} takes a text or a number, and not {each!r}")
        texts = [str(each) for each in several]
        tree[option.name or ""] = texts if option.multiple else texts[0]
        self._places["mt " + " ".join(place), option.name or ""] = origin

    def _where(self, place: Place) -> str:
        line = self._content.line(place)
        return f"{self._config}{f':{line}' if line else ''}: {'.'.join(place)}"


def _word(option: click.Option) -> str:
    """Name an option as files do: its first long flag, `--source-iuv` as `source_iuv`."""
    long = next((flag for flag in option.opts if flag.startswith("--")), option.opts[0])
    return long.lstrip("-").replace("-", "_")


def _variable(place: Place) -> str:
    return "_".join((PREFIX, *place)).upper().replace("-", "_")
