"""Options as a manifest has them: plain values by their words, which are read back as they were."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from motion_transfer.option import Option, list_options, options_from_words, parse_background
from motion_transfer.render.options import NO_AUDIO, Garment, Partner, RenderOptions
from motion_transfer.weights import names_weights_file
from nhrr_core.parts import PART_NAMES

NamePath = Callable[[Option, Path], str]
"""Writes the path of an option."""


def list_written(options: RenderOptions) -> list[tuple[Option, Any]]:
    """List the options that differ from their defaults, in the order of the help."""
    entries = [(entry, getattr(options, entry.name)) for entry in list_options(RenderOptions)]
    return [(entry, value) for entry, value in entries if entry.required or value != entry.default]


def write_value(entry: Option, value: Any, name_path: NamePath) -> Any:
    """Write an option's value as a manifest has it."""

    def name(path: Path) -> str:
        named = (entry.name, str(path)) == ("audio", NO_AUDIO) or (
            entry.name == "weights" and not names_weights_file(str(path))
        )
        return str(path) if named else name_path(entry, path)

    if entry.kind in ("garments", "partners"):
        return [
            {
                "photo": name(each.photo),
                **dict([second_word(each)]),
                **({"iuv": name(each.iuv)} if each.iuv else {}),
            }
            for each in value
        ]
    if entry.kind == "background":
        behind = parse_background(value)
        return name(behind) if isinstance(behind, Path) else value
    if entry.kind == "path":
        return name(value)
    if entry.kind == "paths":
        paths = [name(path) for path in value]
        return paths if len(paths) > 1 else paths[0]
    plain = entry.kind in ("flag", "switch", "integer", "number")
    return value if plain else write_text(entry, value)


def write_text(entry: Option, value: Any) -> str:
    """Write a value as one word."""
    if entry.kind == "frames":
        start, stop = ("" if end is None else str(end) for end in value)
        return f"{start}:{stop}"
    return str(value)


def second_word(entry: Garment | Partner) -> tuple[str, str]:
    """Write what a photo is given with, and its name in a manifest."""
    if isinstance(entry, Partner):
        return "person", entry.person
    return "parts", ",".join(PART_NAMES[part] for part in entry.parts)


def read_written(words: Mapping[str, Any]) -> RenderOptions:
    """Read options that were written so. Raises: InputError for what is none, or of no run."""
    names = {entry.word: entry.name for entry in list_options(RenderOptions)}
    return options_from_words(RenderOptions, {names[word]: words[word] for word in words})
