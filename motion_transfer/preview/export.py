"""Options written out again: as a command line, and as a manifest of one job."""

from __future__ import annotations

import glob
import shlex
from pathlib import Path
from typing import Any

import yaml

from motion_transfer.media.iuv.formats import names_file
from motion_transfer.option import Option
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.options.written import (
    list_written,
    second_word,
    write_text,
    write_value,
)


def command_line(options: RenderOptions) -> str:
    """Write the `mt run` that does the same, for a POSIX shell."""
    words = ["mt", "run"]
    for entry, value in list_written(options):
        flag = entry.flags[0]
        if entry.kind in ("garments", "partners"):
            for each in value:
                iuv = f",{each.iuv}" if each.iuv else ""
                words += [flag, f"{each.photo}{iuv}", entry.flags[1], second_word(each)[1]]
        elif entry.kind == "paths":
            words += [word for path in value for word in (flag, str(path))]
        elif entry.kind == "flag":
            words.append(flag)
        elif entry.kind == "switch":
            on, off = flag.split("/")
            words.append(on if value else off)
        else:
            words += [flag, write_text(entry, value)]
    return shlex.join(words)


def manifest_text(options: RenderOptions, manifest: Path) -> str:
    """Write a manifest of this one run, for `mt batch run`, as it stands at a path.

    Paths below the manifest's folder are written relative to it, so that the folder can move.
    """
    folder = manifest.absolute().parent

    def name(entry: Option, path: Path) -> str:
        if not names_file(path):
            return str(path)
        below = _below(path, folder)
        # marks of a glob in a file's name are to mean themselves
        return glob.escape(below) if entry.name in ("source", "driver") else below

    job: dict[str, Any] = {}
    for entry, value in list_written(options):
        if entry.in_manifest and entry.name not in ("output", "sheet"):
            job[entry.word] = write_value(entry, value, name)
    root = options.output.absolute().parent
    job["output"] = _template(options.output.name)
    whole: dict[str, Any] = {"version": 1, "output_root": _below(root, folder)}
    if options.sheet is not None:
        job["sheet"] = _template(_below(options.sheet, root))
        if not options.sheet.absolute().is_relative_to(root):
            whole["outside_outputs"] = True
    whole["jobs"] = [job]
    return yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)


def _below(path: Path, folder: Path) -> str:
    """Write a path relative to a folder if it lies there, else absolute."""
    whole = path.absolute()
    return str(whole.relative_to(folder)) if whole.is_relative_to(folder) else str(whole)


def _template(name: str) -> str:
    """Write a file's name as a template without placeholders."""
    return name.replace("{", "{{").replace("}", "}}")
