"""Keys of content: two runs with the same key draw the same bytes, on one machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.cores import name_processor
from motion_transfer.devices import name_device
from motion_transfer.estimate.opening import estimator_facts
from motion_transfer.media.work import digest_file, key_of
from motion_transfer.option import list_options
from motion_transfer.render.inputs import find_source_iuv, has_own_iuv
from motion_transfer.render.options import (
    EstimatorOptions,
    InputOptions,
    RenderOptions,
    SourceOptions,
)
from motion_transfer.render.plan import Chunk, DriverPlan
from motion_transfer.version import __version__, package_version

if TYPE_CHECKING:
    from motion_transfer.drawing.renderers.interface import Recipe
    from motion_transfer.media.output.formats import OutputFormat

LIBRARIES = (
    *("torch", "openvino", "onnxruntime"),
    *("numpy", "opencv-contrib-python-headless", "av", "pillow", "scipy"),
)
KEYED_ELSEWHERE = {
    *("source", "source_iuv", "garments", "weights", "adapt"),  # by the files' content
    *("driver", "driver_person", "iuv_order", "missing", "window"),  # by the plan
    *("frames", "frame_rate"),  # by the plan
    *("driver_kind", "estimator", "estimator_model", "fit_body", "azimuth"),  # likewise
    *("renderer", "engine", "precision", "device"),  # by the recipe
    *("codec", "crf", "pix_fmt", "alpha"),  # by the format
    *("partners", "background"),  # by the cast, and by the file's content
    *("output", "force", "restart", "workers"),  # never change what is drawn
    *("sheet", "audio", "audio_track"),  # made when everything is drawn
    *("provenance", "credentials_cert", "credentials_key"),  # likewise
}
"""Options that a run's key need not name. All others are in it: a new one cannot be forgotten."""


@dataclass(frozen=True)
class Contents:
    """What the files hold that a run is made from, besides driver and weights.

    Attributes:
        pictures: Of each of the cast, see `picture_facts`.
        background: A word, or the SHA-256 of a file.
    """

    pictures: tuple[list[tuple[Path, dict[str, Any]]], ...]
    background: str


def read_contents(options: RenderOptions) -> Contents:
    """Read what the files hold, once. Raises: InputError for one that is missing."""
    pictures = tuple(picture_facts(member) for member in options.cast)
    return Contents(pictures, _background_facts(options))


def _source_key(
    options: SourceOptions, pictures: list[tuple[Path, dict[str, Any]]], recipe: Recipe
) -> str:
    """Compute the key of a source's appearance."""
    return key_of(
        {
            "content": [facts for _, facts in pictures],
            "parts": [garment.parts for garment in options.garments],
            "legs": options.unseen_legs,
            "person": options.person,
            "order": options.source_iuv_order,
            "renderer": [recipe.name, recipe.content, recipe.execution],
        }
    )


def picture_facts(options: SourceOptions) -> list[tuple[Path, dict[str, Any]]]:
    """List the sources, then the garments, each with what decides what is seen in it.

    Returns: With each path the SHA-256 of its content, `sha256`; and under `iuv` that of its IUV,
        or what estimates it, unless the file says all.
    Raises: InputError for a file that is missing.
    """
    files = [("source", source, iuv) for source, iuv in options.sources]
    files += [("garment", garment.photo, garment.iuv) for garment in options.garments]
    listed = []
    for what, photo, given in files:
        facts: dict[str, Any] = {"sha256": digest_file(photo, what)}
        if iuv := given or find_source_iuv(photo):
            facts["iuv"] = digest_file(iuv, what)
        elif not has_own_iuv(photo):
            facts["iuv"] = _estimator_facts(options)
        listed.append((photo, facts))
    return listed


def run_key(
    options: RenderOptions,
    contents: Contents,
    *,
    recipe: Recipe,
    output_format: OutputFormat,
    plans: Sequence[DriverPlan],
    in_place: bool,
) -> str:
    """Compute the key of a run's frames, all but the driver's own."""
    drawn = {
        entry.name: getattr(options, entry.name)
        for entry in list_options(RenderOptions)
        if entry.name not in KEYED_ELSEWHERE
    }
    return key_of(
        {
            "sources": [
                _source_key(member, pictures, recipe)
                for member, pictures in zip(options.cast, contents.pictures, strict=True)
            ],
            "background": contents.background,
            "options": drawn,
            "in place": in_place,
            "thumbnails": options.sheet is not None,
            "renderer": [recipe.name, recipe.content, recipe.execution],
            "format": [asdict(output_format), options.output.suffix.lower()],
            "shots": [[asdict(shot) for shot in plan.shots] for plan in plans],
            "rate": plans[0].frame_rate,
            "device": describe_machine(recipe.device),
            "versions": [__version__, *(package_version(name) for name in LIBRARIES)],
        }
    )


def chunk_key(run: str, plans: Sequence[DriverPlan], chunk: Chunk) -> str:
    """Compute the key of a chunk: its run, its driver frames, and who is followed in them."""
    frames = [plan.frames[chunk.start : chunk.stop] for plan in plans]
    followed = [[[f.digest, str(f.person)] for f in each] for each in frames]
    return key_of({"run": run, "start": chunk.start, "frames": followed})


def _background_facts(options: RenderOptions) -> str:
    """Tell what is behind: a word, or what a file holds."""
    path = options.background_file
    if path is not None:
        return digest_file(path, "background")
    if options.background == "driver":  # its IUV, which the plan holds, is not all of it
        return digest_file(options.driver, "driver")
    return options.background


def driver_key(options: InputOptions) -> str:
    """Compute the key of the IUV of a driver that is raw pictures. Raises: InputError."""
    changed: dict[str, Any] = {"fit": _fit_facts(options)} if options.fit_body else {}
    if options.azimuth is not None:
        changed["azimuth"] = options.azimuth
    return key_of(
        {
            "driver": digest_file(options.driver, "driver"),
            "person": options.driver_person,
            "frames": options.frames,
            **changed,
            **_estimator_facts(options),
        }
    )


def _fit_facts(options: SourceOptions) -> dict[str, Any]:
    """List what decides whose proportions a driver gets."""
    source, iuv = options.sources[0]
    iuv = iuv or find_source_iuv(source)
    return {
        "source": digest_file(source, "source"),
        "iuv": digest_file(iuv, "source") if iuv else None,
        "order": options.source_iuv_order,
        "person": options.person,
    }


def _estimator_facts(options: EstimatorOptions) -> dict[str, Any]:
    return estimator_facts(options.estimator, options.estimator_model)


def describe_machine(name: str) -> list[str]:
    """Tell of a device what computes: another instruction set may round otherwise."""
    if name.startswith("cuda"):
        return [name_device(name)]
    return [*name_processor()]
