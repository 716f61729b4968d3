"""`mt run`, and `mt demo`, which is a run of what ships with the program."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import (
    FILE,
    SectionCommand,
    described_options,
    events_option,
    pair_words,
    section,
)
from motion_transfer.cli.progress import choose_listener
from motion_transfer.option import options_from_words
from motion_transfer.render.options import RenderOptions

output_option = section("Output")


@click.command(cls=SectionCommand)
@described_options(RenderOptions)
@output_option("-q", "--quiet", is_flag=True, help="Say only errors.")
@events_option()
def run(
    garments: tuple[str, ...],
    garment_parts: tuple[str, ...],
    partners: tuple[str, ...],
    partner_person: tuple[str, ...],
    quiet: bool,
    as_json: bool,
    **words: Any,
) -> None:
    """Render the person of a photo, or of several, in the motion of a driver.

    The IUV of a photo or a video that comes without it is estimated. A run that was stopped, in
    whatever way, goes on where it was when it is started again.

    \b
    mt run --source photo.png --driver iuv_frames/ -o out.mp4
    mt run --source front.jpg --source back.jpg --driver dance.mp4 -o out.mp4
    mt run --source photo.png --driver dance.mp4 --background photo --compare -o out.mp4
    mt run --source photo.png --driver dance.mp4 --background transparent -o out.webm
    mt run --source photo.png --driver dance.mp4 --background street.mp4 --size background \\
           --place 0.5,0.9,1.5 --shadow -o out.mp4
    mt run --source me.png --driver me_IUV.png --garment dress.png \\
           --garment-parts torso,upper-legs --background photo -o dressed.png
    """
    from motion_transfer.render.remote import local_run
    from motion_transfer.render.run import run as render

    words["garments"] = pair_words(garments, garment_parts, "garment", "parts")
    words["partners"] = pair_words(partners, partner_person, "partner", "person")
    listener = choose_listener(quiet=quiet, as_json=as_json)
    with local_run(RenderOptions, words, listener) as (local, listen):
        render(options_from_words(RenderOptions, local), listen)


@click.command()
@click.option(
    "-o",
    "--output",
    type=FILE,
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
@events_option("Other")
def demo(
    output: Path, photo_alone: bool, compare: bool, force: bool, quiet: bool, as_json: bool
) -> None:
    """Render a photo and a driver that ship with the program (synthetic, CC0)."""
    from motion_transfer.render.run import run as render

    with as_file(files("motion_transfer.demo")) as folder:  # also where a package is an archive
        render(
            RenderOptions(
                source=(folder / ("astronaut.jpg" if photo_alone else "source.png"),),
                driver=folder / ("wave.mkv" if photo_alone else "driver.mkv"),
                output=output,
                compare=compare,
                force=force,
            ),
            choose_listener(quiet=quiet, as_json=as_json),
        )
