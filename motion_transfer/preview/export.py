"""Options written out again: as a command line, and as a manifest of one job."""

from __future__ import annotations

import glob
import shlex
from pathlib import Path
from typing import Any

import yaml

from motion_transfer.media.iuv.formats import names_file
from motion_transfer.option import Option, list_options, parse_background
from motion_transfer.render.options import NO_AUDIO, Garment, Partner, RenderOptions
from motion_transfer.weights import names_weights_file
from nhrr_core.parts import PART_NAMES


def command_line(options: RenderOptions) -> str:
    """Write the `mt run` that does the same, for a POSIX shell."""
    words = ["mt", "run"]
    for entry, value in _written(options):
        flag = entry.flags[0]
        if entry.kind in ("garments", "partners"):
            for each in value:
                iuv = f",{each.iuv}" if each.iuv else ""
                words += [flag, f"{each.photo}{iuv}", entry.flags[1], _second_word(each)[1]]
        elif entry.kind == "paths":
            words += [word for path in value for word in (flag, str(path))]
        elif entry.kind == "flag":
            words.append(flag)
        elif entry.kind == "switch":
            on, off = flag.split("/")
            words.append(on if value else off)
        else:
            words += [flag, _text(entry, value)]
    return shlex.join(words)


def manifest_text(options: RenderOptions, manifest: Path) -> str:
    """Write a manifest of this one run, for `mt batch run`, as it stands at a path.

    Paths below the manifest's folder are written relative to it, so that the folder can move.
    """
    folder = manifest.absolute().parent
    job: dict[str, Any] = {}
    for entry, value in _written(options):
        if entry.in_manifest and entry.name not in ("output", "sheet"):
            job[entry.word] = _manifest_value(entry, value, folder)
    root = options.output.absolute().parent
    job["output"] = _template(options.output.name)
    whole: dict[str, Any] = {"version": 1, "output_root": _below(root, folder)}
    if options.sheet is not None:
        job["sheet"] = _template(_below(options.sheet, root))
        if not options.sheet.absolute().is_relative_to(root):
            whole["outside_outputs"] = True
    whole["jobs"] = [job]
    return yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)


def _written(options: RenderOptions) -> list[tuple[Option, Any]]:
    """List the options that differ from their defaults, in the order of the help."""
    entries = [(entry, getattr(options, entry.name)) for entry in list_options(RenderOptions)]
    return [(entry, value) for entry, value in entries if entry.required or value != entry.default]


def _manifest_value(entry: Option, value: Any, folder: Path) -> Any:
    if entry.kind in ("garments", "partners"):
        return [
            {
                "photo": _below(each.photo, folder),
                **dict([_second_word(each)]),
                **({"iuv": _below(each.iuv, folder)} if each.iuv else {}),
            }
            for each in value
        ]
    if entry.kind == "background":
        behind = parse_background(value)
        return _below(behind, folder) if isinstance(behind, Path) else value
    if entry.kind == "path":
        return _manifest_path(entry, value, folder)
    if entry.kind == "paths":
        paths = [_manifest_path(entry, path, folder) for path in value]
        return paths if len(paths) > 1 else paths[0]
    return value if entry.kind in ("flag", "switch", "integer", "number") else _text(entry, value)


def _manifest_path(entry: Option, value: Path, folder: Path) -> str:
    named = (entry.name, str(value)) == ("audio", NO_AUDIO) or (
        entry.name == "weights" and not names_weights_file(str(value))
    )
    if named or not names_file(value):
        return str(value)
    path = _below(value, folder)
    # marks of a glob in a file's name are to mean themselves
    return glob.escape(path) if entry.name in ("source", "driver") else path


def _text(entry: Option, value: Any) -> str:
    if entry.kind == "frames":
        start, stop = ("" if end is None else str(end) for end in value)
        return f"{start}:{stop}"
    return str(value)


def _second_word(entry: Garment | Partner) -> tuple[str, str]:
    """Write what a photo is given with, and its name in a manifest."""
    if isinstance(entry, Partner):
        return "person", entry.person
    return "parts", ",".join(PART_NAMES[part] for part in entry.parts)


def _below(path: Path, folder: Path) -> str:
    """Write a path relative to a folder if it lies there, else absolute."""
    whole = path.absolute()
    return str(whole.relative_to(folder)) if whole.is_relative_to(folder) else str(whole)


def _template(name: str) -> str:
    """Write a file's name as a template without placeholders."""
    return name.replace("{", "{{").replace("}", "}}")
