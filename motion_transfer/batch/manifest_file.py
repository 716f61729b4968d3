"""Manifests from files: YAML, TOML or JSON, with the line of whatever is wrong in them."""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from motion_transfer.batch.manifest import Defaults, Manifest
from motion_transfer.errors import InputError

SUFFIXES = (".yaml", ".yml", ".json", ".toml")
MOST_ERRORS = 10
SETTABLE = [f for f in Manifest.model_fields if f not in ("version", "defaults", "jobs", "matrix")]
Place = tuple[int | str, ...]
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class ManifestError(InputError):
    """A manifest that cannot be used; the message has one line for each thing wrong."""


def read_manifest(path: Path, settings: Sequence[str] = ()) -> tuple[Manifest, ManifestText]:
    """Read and check a manifest; `settings` are `key=value`, for the manifest or for every job.

    Raises: ManifestError naming file, line where possible, field, value and what is allowed.
    """
    text = ManifestText(path)
    data = text.data()
    if not isinstance(data, dict):
        raise ManifestError(f"{path}: a manifest is a mapping with version and jobs")
    given = {_set(data, setting): setting for setting in settings}
    try:
        return Manifest.model_validate(data), text
    except ValidationError as error:
        raise text.error(error.errors(), given) from None


class ManifestText:
    """A manifest's text, which can say where a field stands."""

    def __init__(self, path: Path) -> None:
        """Raises: ManifestError for a file that cannot be read or has an unknown ending."""
        self.path = path
        self._suffix = path.suffix.lower()
        if self._suffix not in SUFFIXES:
            raise ManifestError(f"{path}: unknown ending; supported are {', '.join(SUFFIXES)}")
        try:
            self._text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            raise ManifestError(f"manifest {path} does not exist") from None
        except (OSError, UnicodeDecodeError) as error:
            raise ManifestError(f"manifest {path} cannot be read: {error}") from None

    def data(self) -> Any:
        """The content. Raises: ManifestError where the syntax is broken."""
        try:
            if self._suffix == ".toml":
                return tomllib.loads(self._text)
            if self._suffix == ".json":
                return json.loads(self._text)
            return yaml.load(self._text, Loader=_Loader)
        except (tomllib.TOMLDecodeError, json.JSONDecodeError) as error:
            raise ManifestError(f"{self.path}: {error}") from None
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            line = f":{mark.line + 1}" if mark else ""
            reason = getattr(error, "problem", None) or str(error)
            raise ManifestError(f"{self.path}{line}: {reason}") from None

    def line(self, place: Place) -> int | None:
        """The line, from 1, on which a field stands, or the nearest thing around it."""
        if self._suffix == ".toml":
            return self._toml_line(place)
        node = yaml.compose(self._text, Loader=_Loader)
        line: int | None = None
        for step in place:
            if isinstance(node, yaml.MappingNode):
                pair = next(((k, v) for k, v in node.value if k.value == step), None)
                if pair is None:
                    break
                line, node = pair[0].start_mark.line, pair[1]
            elif isinstance(node, yaml.SequenceNode) and isinstance(step, int):
                if step >= len(node.value):
                    break
                node = node.value[step]
                line = node.start_mark.line
            else:
                break
        return None if line is None else line + 1

    def where(self, place: Place) -> str:
        """File, line where possible, and field, for messages."""
        line = self.line(place)
        words = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in place).lstrip(".")
        return f"{self.path}{f':{line}' if line else ''}: {words}"

    def error(self, details: Sequence[ErrorDetails], given: Mapping[str, str]) -> ManifestError:
        """Everything that is wrong, a line each.

        Args:
            given: `key=value` settings by key; what is wrong there does not stand in the file.
        """
        lines: dict[str, None] = {}
        for number, detail in enumerate(details):
            if len(lines) == MOST_ERRORS:
                lines[f"and {len(details) - number} more"] = None
                break
            setting = next((given[s] for s in map(str, detail["loc"]) if s in given), None)
            if setting is None:
                lines[self._sentence(detail)] = None
            else:
                lines[f"--set {setting}: {_reason(detail)}"] = None
        return ManifestError("\n".join(lines))

    def _sentence(self, detail: ErrorDetails) -> str:
        place = detail["loc"]
        value, kind = detail["input"], detail["type"]
        if kind == "extra_forbidden":
            known = self._known_fields(place)
            near = difflib.get_close_matches(str(list(place)[-1]), known, 1)
            hint = f"did you mean {near[0]}? " if near else ""
            return f"{self.where(place)}: unknown field; {hint}allowed are {', '.join(known)}"
        if kind == "missing":
            return f"{self.where(place)}: is missing"
        return f"{self.where(place)}: {value!r}: {_reason(detail)}"

    def _known_fields(self, place: Place) -> list[str]:
        model: Any = Manifest
        for step in list(place)[:-1]:
            if isinstance(step, str) and step in model.model_fields:
                annotation = model.model_fields[step].annotation
                inner = getattr(annotation, "__args__", None)
                while inner:
                    annotation = inner[0]
                    inner = getattr(annotation, "__args__", None)
                model = annotation
        return list(getattr(model, "model_fields", Manifest.model_fields))

    def _toml_line(self, place: Place) -> int | None:
        lines = self._text.splitlines()
        start = 0
        if len(place) > 1:
            header = re.compile(rf"\s*\[+\s*{re.escape(str(place[0]))}\s*\]+")
            headers = [number for number, line in enumerate(lines) if header.match(line)]
            index = place[1] if isinstance(place[1], int) else 0
            if index >= len(headers):
                return None
            start = headers[index]
        key = re.compile(rf"\s*{re.escape(str(list(place)[-1]))}\s*=")
        for number in range(start, len(lines)):
            if key.match(lines[number]):
                return number + 1
            if number > start and lines[number].startswith("["):
                break
        return start + 1 if start else None


def _reason(detail: ErrorDetails) -> str:
    return detail["msg"].removeprefix("Value error, ")


def _set(data: dict[str, Any], setting: str) -> str:
    """Apply `key=value`: to the manifest if it has such a field, else to all jobs; the key.

    Raises: ManifestError for a key that is neither.
    """
    key, equals, value = setting.partition("=")
    if not equals:
        raise ManifestError(f"--set {setting!r}; write key=value")
    try:
        parsed = yaml.load(value, Loader=_Loader)
    except yaml.YAMLError:
        parsed = value
    if parsed is None and value.strip() not in ("", "~", "null"):
        parsed = value  # such as #102030, which YAML takes for a comment
    if key in SETTABLE:
        data[key] = parsed
        return key
    if key not in Defaults.model_fields:
        known = [*SETTABLE, *Defaults.model_fields]
        near = difflib.get_close_matches(key, known, 1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ManifestError(f"--set {setting}: unknown field; {hint}allowed are {', '.join(known)}")
    data["defaults"] = {**(data.get("defaults") or {}), key: parsed}
    for entry in [*(data.get("jobs") or []), *(data.get("matrix") or [])]:
        if isinstance(entry, dict) and key in entry:
            entry[key] = parsed
    return key
