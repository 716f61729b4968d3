"""`mt demo`."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import click

from motion_transfer.cli.progress import choose_listener


@click.command()
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("demo.mp4"),
    show_default=True,
    help="As in `mt run`.",
)
@click.option(
    "--photo-alone",
    is_flag=True,
    help="A photo of an astronaut, without IUV, waves. Needs `mt models fetch`, once.",
)
@click.option("--compare/--plain", default=True, help="Source, IUV and result, or the result only.")
@click.option("--force", is_flag=True, help="Replace an existing output.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="Print events as JSON lines.")
def demo(
    output: Path, photo_alone: bool, compare: bool, force: bool, quiet: bool, as_json: bool
) -> None:
    """Render a photo and a driver that ship with the program (synthetic, CC0)."""
    from motion_transfer.render.options import RenderOptions
    from motion_transfer.render.run import run

    with as_file(files("motion_transfer.demo")) as folder:
        run(
            RenderOptions(
                source=folder / ("astronaut.jpg" if photo_alone else "source.png"),
                driver=folder / ("wave.mkv" if photo_alone else "driver.mkv"),
                output=output,
                compare=compare,
                force=force,
            ),
            choose_listener(quiet=quiet, as_json=as_json),
        )
