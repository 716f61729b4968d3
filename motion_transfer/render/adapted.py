"""Weights that have learned the person of a source: made once, and found by content afterwards.

They lie in `adapted` in the program's cache, under a key of all that they were made from.
"""

from __future__ import annotations

import shutil
from dataclasses import asdict, replace
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.devices import find_device
from motion_transfer.drawing.kept_source import load_picture
from motion_transfer.drawing.renderers import DEFAULT_RENDERER, RENDERERS
from motion_transfer.drawing.source import SourcePicture
from motion_transfer.errors import OutputError
from motion_transfer.estimate.models import models_folder
from motion_transfer.events import Listener, ignore
from motion_transfer.extras import require_extra
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.unchanged import Inputs
from motion_transfer.media.work import key_of
from motion_transfer.option import part_of
from motion_transfer.render.content import picture_facts
from motion_transfer.render.inputs import model_files, photo_files
from motion_transfer.render.options import AdaptOptions, RenderOptions, SourceOptions
from motion_transfer.render.source import check_photos
from motion_transfer.render.source_pictures import read_pictures
from motion_transfer.training.adaptation_settings import AdaptationSettings
from motion_transfer.version import __version__
from motion_transfer.weights.checkpoint import (
    digest_weights,
    inspect_checkpoint,
    load_checkpoint,
    save_checkpoint,
)

SUFFIX = ".safetensors"
POSES_EVERY = 3
"""Of the demo's driver, which takes 4 s at 30 frames/s, one frame of so many is a pose to hold."""


def write_adapted(options: AdaptOptions, output: Path, listener: Listener = ignore) -> None:
    """Let weights learn a person, unless they have before, and write them as a checkpoint.

    Raises: InputError and its kinds, with nothing written.
    """
    if output.suffix.lower() != SUFFIX:
        raise OutputError(f"{output}: weights end in {SUFFIX}; name it so")
    check_destination(output, force=options.force)
    given = {} if options.steps is None else {"steps": options.steps}
    person = part_of(options, SourceOptions)
    settings = AdaptationSettings(**given)
    kept = adapt_person(person, options.weights, settings, listener, device=options.device)
    with work_folder(output) as folder:
        written = folder / output.name
        shutil.copyfile(kept, written)
        publish(written, output)


def adapt_run(options: RenderOptions, listener: Listener = ignore) -> RenderOptions:
    """Put weights that know the person in the place of those that a run begins with.

    Returns: The options, with nothing left to adapt.
    Raises: InputError and its kinds.
    """
    # what is learned is the person, and garments are laid over whoever that is
    person = replace(part_of(options, SourceOptions), garments=())
    settings = AdaptationSettings()
    weights = adapt_person(person, options.weights, settings, listener, device=options.device)
    return replace(options, weights=weights, adapt=False)


def adapt_person(
    options: SourceOptions,
    weights: Path | None,
    settings: AdaptationSettings,
    listener: Listener = ignore,
    *,
    device: str | None = None,
) -> Path:
    """Find the weights that have learned a source, or make them, which takes minutes.

    Args:
        weights: Before they learn; None: those that ship.
        device: Where they learn; None: the fastest here.
    Returns: A checkpoint in the cache, whole.
    Raises: InputError and its kinds: a source that cannot be used, or has changed meanwhile;
        missing packages; OutputError if the cache cannot be written.
    """
    check_photos(options)
    (before,) = RENDERERS[DEFAULT_RENDERER].files(weights)
    inputs = Inputs([*photo_files(options), *model_files(options), before])
    facts = {
        "weights": digest_weights(before),
        "person": [of for _, of in picture_facts(options)],
        "choice": [options.person, options.source_iuv_order],
        "settings": asdict(settings),
        "version": __version__,
    }
    final = models_folder().with_name("adapted") / f"{key_of(facts)[:32]}{SUFFIX}"
    if final.is_file():
        return final
    require_extra("adapt")
    learning = find_device(device)
    # now: it takes seconds, and what was learned before needs none of it
    import torch

    from motion_transfer.training.adaptation import adapt_model
    from motion_transfer.training.feature_networks import load_efficientnet_lite0

    judge = load_efficientnet_lite0()
    pictures = _read_person(options, listener)
    model = load_checkpoint(before).to(learning)
    adapted = adapt_model(model, pictures, demo_poses(), settings, judge.to(learning), listener)
    told = inspect_checkpoint(before).notes | {
        "adapted_from": f"{before.stem}, SHA-256 {facts['weights']}",
        "adapted_to": _tell_person(options),
        "adapted_by": f"motion-transfer {__version__}, {settings}",
    }
    with work_folder(final) as folder:
        written = folder / final.name
        # as the weights that ship: what is lost is below the last bit of a picture
        save_checkpoint(written, adapted, notes=told, dtype=torch.float16)
        inputs.check()
        publish(written, final)
    return final


def _read_person(options: SourceOptions, listener: Listener) -> list[SourcePicture]:
    if options.kept is not None:
        return [load_picture(options.kept)]
    return [found.picture for found in read_pictures(options, listener)]


def _tell_person(options: SourceOptions) -> str:
    """Tell what was learned from: names without folders, and digests."""
    return "; ".join(f"{path.name}, SHA-256 {of['sha256']}" for path, of in picture_facts(options))


def demo_poses() -> list[UInt8[np.ndarray, "H W 3"]]:
    """Read poses of somebody who turns; they ship with the program."""
    with as_file(files("motion_transfer.demo")) as folder:
        reader = open_reader(open_stream(folder / "driver.mkv"))
        return list(reader.read(0, reader.stream.frame_count))[::POSES_EVERY]
