"""What the page changes: words, as a manifest would write them, become options of the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.output.formats import OUTPUT_KINDS
from motion_transfer.option import list_options, parse_background, read_whole
from motion_transfer.preview.dropped import clean_name
from motion_transfer.render.composition import read_format
from motion_transfer.render.options import NO_AUDIO, RenderOptions, SceneOptions

SCENE = tuple(entry.name for entry in list_options(SceneOptions) if entry.name != "partners")
MAKING = ("crf", "audio", "compare")
SEEN = ("person", "unseen_legs")
"""What else decides what is seen of the source, besides the files."""

SHOWN_AS_IS = ("renderer", *SCENE, *SEEN, "driver_person", "missing", "size", *MAKING)
CHANGEABLE = (*SHOWN_AS_IS, "window", "frames", "frame_rate")
NAMING = ("name", "format")
"""What the output is called, in its folder: two words of the page that are no options."""

FORMATS = tuple(suffix for row in OUTPUT_KINDS.values() for suffix in row.suffixes if suffix)
ENTRIES = {entry.name: entry for entry in list_options(RenderOptions)}


def change_options(
    options: RenderOptions,
    words: Mapping[str, Any],
    *,
    frame_count: int | None,
    weights: Path | None,
) -> RenderOptions:
    """Change options of a run; whether they fit source and driver is not asked here.

    Args:
        frame_count: Of the driver, where it is known.
        weights: Those that the preview began with: they go with the network, and come back with it.
    Raises: InputError for an option that is none, or a value that it cannot have.
    """
    known = (*CHANGEABLE, *NAMING)
    if unknown := [word for word in words if word not in known]:
        raise InputError(f"option {unknown[0]!r}; here one can set {', '.join(known)}")
    changes = _read(options, words)
    if changes.get("frames") == (0, frame_count):
        changes["frames"] = (None, None)
    if "renderer" in changes:
        row = RENDERERS.get(changes["renderer"])  # an unknown one is refused with the others
        changes["weights"] = weights if row and row.default_weights else None
    if "background" in changes:
        changes = {**_that_goes_with(changes["background"], options), **changes}
    if not words.keys().isdisjoint(NAMING):
        changes = {**_name_output(options.output, words), **changes}
    changed = replace(options, **changes)
    if not {*NAMING, *MAKING}.isdisjoint(words):
        _check_output(changed)
    return changed


def _read(options: RenderOptions, words: Mapping[str, Any]) -> dict[str, Any]:
    given = {name: value for name, value in words.items() if name not in NAMING}
    for name in {"audio", "missing"} & given.keys():
        given[name] = given[name] or None
    if "crf" in given:
        given["crf"] = _read_crf(given["crf"])
    if given.get("audio") not in (None, NO_AUDIO, str(options.audio)):
        raise InputError(f"sound {given['audio']!r}; here it is the motion's own, or none")
    return {name: ENTRIES[name].read(value) for name, value in given.items()}


def _read_crf(text: str) -> int | None:
    try:
        return read_whole(text) if text else None
    except ValueError:
        raise InputError(f"crf {text!r}; write a whole number, or nothing") from None


def _that_goes_with(background: str, options: RenderOptions) -> dict[str, Any]:
    """Give up what another background cannot have."""
    given_up: dict[str, Any] = {}
    if options.size == "background" and not isinstance(parse_background(background), Path):
        given_up["size"] = "driver"
    if background == "transparent":
        given_up |= {"match_colours": False, "compare": False}
    return given_up


def _name_output(output: Path, words: Mapping[str, Any]) -> dict[str, Any]:
    suffix = words.get("format", output.suffix)
    if suffix not in (*FORMATS, output.suffix):
        raise InputError(f"format {suffix!r}; supported are {', '.join(FORMATS)}")
    # a name, and no path: the page writes nowhere but beside what was chosen
    named = {"output": output.with_name(clean_name(f"{words.get('name', output.stem)}{suffix}"))}
    if suffix == output.suffix:
        return named
    return {**named, "codec": None, "pix_fmt": None, "crf": None}  # each container has its own


def _check_output(options: RenderOptions) -> None:
    """Raise InputError for an output that cannot be written, or not be so good."""
    try:
        read_format(options)
    except OutputError as error:
        raise InputError(str(error)) from error
