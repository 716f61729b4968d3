"""A person kept for later: the source of a run, unfolded and encoded, in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.kept_source import save_source
from motion_transfer.drawing.renderers import DEFAULT_RENDERER, DRAFT, RENDERERS
from motion_transfer.errors import OutputError
from motion_transfer.events import Listener, Notice, ignore
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.unchanged import Inputs
from motion_transfer.render.content import picture_facts
from motion_transfer.render.inputs import model_files, photo_files
from motion_transfer.render.options import KEPT_SUFFIX, KeepOptions, SourceOptions, is_kept
from motion_transfer.render.source import check_photos, read_sources
from nhrr_core.parts import PART_NAMES


def keep_source(options: KeepOptions, output: Path, listener: Listener = ignore) -> None:
    """Read a source and write it as one file, which any run takes as its source.

    Textures are kept in the size that the weights want, and in the one that drafts want.

    Args:
        output: Ends in .mtsource.
    Raises: InputError and its kinds, with nothing written.
    """
    if not is_kept(output):
        raise OutputError(f"{output}: a kept source ends in {KEPT_SUFFIX}; name it so")
    check_destination(output, force=options.force)
    check_photos(options)
    row = RENDERERS[DEFAULT_RENDERER]
    inputs = Inputs([*photo_files(options), *model_files(options), *row.files(options.weights)])
    recipe = row.recipe(options.weights)
    sizes = (recipe.texture_size, RENDERERS[DRAFT].recipe(None).texture_size)
    sources = read_sources(options, tuple(dict.fromkeys(sizes)), listener)
    for note in sources[0].notes:
        listener(Notice(note))
    known = recipe.appearance_of(sources[0])
    assert isinstance(known, FeatureMap)
    facts = {"made of": _tell_pictures(options), "weights": recipe.facts()}
    with work_folder(output) as folder:
        written = folder / output.name
        save_source(written, sources, {recipe.content: known}, facts)
        inputs.check()
        publish(written, output)


def _tell_pictures(options: SourceOptions) -> list[dict[str, Any]]:
    """Tell which files a source was made of: names without folders, and digests."""
    told = [{"file": path.name, **facts} for path, facts in picture_facts(options)]
    first = len(options.source)
    for entry, garment in zip(told[first:], options.garments, strict=True):
        entry["parts"] = [PART_NAMES[part] for part in garment.parts]
    return told
