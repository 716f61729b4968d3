"""Keys of content: two runs with the same key draw the same bytes, on one machine."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError
from motion_transfer.estimate.opening import estimator_facts
from motion_transfer.media.formats import OutputFormat
from motion_transfer.media.work import digest_of, key_of
from motion_transfer.render.beside import find_iuv_beside
from motion_transfer.render.option import list_options
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.plan import Chunk, DriverPlan
from motion_transfer.render.recipe import Recipe
from motion_transfer.version import __version__

LIBRARIES = ("torch", "numpy", "opencv-contrib-python-headless", "av", "pillow", "scipy")
SAID_OTHERWISE = {
    *("source", "source_iuv", "garments", "weights"),  # by the files' content
    *("driver", "driver_person", "iuv_order", "missing", "window"),  # by the plan
    *("frames", "frame_rate"),  # likewise
    *("driver_kind", "estimator", "estimator_model", "fit_body"),  # by the source and the plan
    *("renderer", "compile", "codec", "crf"),  # by the recipe and the format
    *("output", "force", "restart", "workers"),  # never change what is drawn
    *("sheet", "audio"),  # made when everything is drawn
}


def digest_file(path: Path, what: str) -> str:
    """SHA-256 of a file. Raises: InputError naming what the file was wanted for."""
    try:
        return digest_of(path)
    except FileNotFoundError:
        raise InputError(f"{what} {path} does not exist") from None
    except OSError as error:
        raise InputError(f"{what} {path} cannot be read: {error.strerror}") from error


def digest_weights(options: RenderOptions) -> str:
    """SHA-256 of the checkpoint that draws; empty for a renderer without. Raises: InputError."""
    weights = options.weights_file
    return digest_file(weights, "weights") if weights else ""


def source_key(options: RenderOptions, recipe: Recipe) -> str:
    """Of everything that decides a source's appearance. Raises: InputError for a missing file."""
    files = [("source", options.source, options.source_iuv)]
    files += [("garment", garment.photo, garment.iuv) for garment in options.garments]
    content = []
    for what, photo, given in files:
        iuv = given or find_iuv_beside(photo)
        content.append(digest_file(photo, what))
        content.append(digest_file(iuv, what) if iuv else _estimator_facts(options))
    return key_of(
        {
            "content": content,
            "parts": [garment.parts for garment in options.garments],
            "person": options.person,
            "order": options.source_iuv_order,
            "renderer": [recipe.name, recipe.weights_digest],
        }
    )


def run_key(
    options: RenderOptions,
    *,
    source: str,
    recipe: Recipe,
    output_format: OutputFormat,
    plan: DriverPlan,
    in_place: bool,
) -> str:
    """Of everything that decides the bytes of a run's frames, but for the driver's frames."""
    drawn = {
        entry.name: getattr(options, entry.name)
        for entry in list_options(RenderOptions)
        if entry.name not in SAID_OTHERWISE
    }
    return key_of(
        {
            "source": source,
            "options": drawn,
            "in place": in_place,
            "thumbnails": options.sheet is not None,
            "renderer": [recipe.name, recipe.weights_digest, recipe.compile],
            "format": [asdict(output_format), options.output.suffix.lower()],
            "shots": [asdict(shot) for shot in plan.shots],
            "rate": plan.frame_rate,
            "device": _device(),
            "versions": [__version__, *(version(name) for name in LIBRARIES)],
        }
    )


def chunk_key(run: str, plan: DriverPlan, chunk: Chunk) -> str:
    """Of one chunk: its run, its driver frames, and who is followed in them."""
    frames = plan.frames[chunk.start : chunk.stop]
    return key_of(
        {"run": run, "start": chunk.start, "frames": [[f.digest, str(f.person)] for f in frames]}
    )


def driver_key(options: RenderOptions) -> str:
    """Of what decides the IUV of a driver that is raw pictures. Raises: InputError."""
    fitted = {"fit": _fit_facts(options)} if options.fit_body else {}
    return key_of(
        {
            "driver": digest_file(options.driver, "driver"),
            "person": options.driver_person,
            "frames": options.frames,
            **fitted,
            **_estimator_facts(options),
        }
    )


def _fit_facts(options: RenderOptions) -> dict[str, Any]:
    """What decides whose proportions a driver gets."""
    iuv = options.source_iuv or find_iuv_beside(options.source)
    return {
        "source": digest_file(options.source, "source"),
        "iuv": digest_file(iuv, "source") if iuv else None,
        "order": options.source_iuv_order,
        "person": options.person,
    }


def _estimator_facts(options: RenderOptions) -> dict[str, Any]:
    return estimator_facts(options.estimator, options.estimator_model)


def _device() -> list[str]:
    import torch

    if torch.cuda.is_available():
        return [torch.cuda.get_device_name()]
    return [platform.machine(), torch.backends.cpu.get_cpu_capability()]
