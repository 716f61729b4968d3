"""`mt source`: a person kept in one file, for later runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import (
    FILE,
    CommandGroup,
    SectionCommand,
    described_options,
    pair_words,
    section,
)
from motion_transfer.cli.progress import choose_listener
from motion_transfer.cli.terminal import tell
from motion_transfer.option import options_from_words
from motion_transfer.render.options import KeepOptions

output_option = section("Output")


@click.group(cls=CommandGroup)
def source() -> None:
    """Keep a person in one file: encode once, render often, also on another machine.

    \b
    mt source save me.mtsource --source me.jpg
    mt run --source me.mtsource --driver dance.mp4 -o out.mp4
    mt inspect me.mtsource
    """


@source.command(cls=SectionCommand)
@click.argument("output", metavar="FILE.mtsource", type=FILE)
@described_options(KeepOptions)
@output_option("-q", "--quiet", is_flag=True, help="Say only errors.")
def save(
    output: Path,
    garments: tuple[str, ...],
    garment_parts: tuple[str, ...],
    quiet: bool,
    **words: Any,
) -> None:
    """Look at the photos of a person, once, and keep what a run needs of them in FILE.mtsource.

    Wherever a run asks for a source, the file may stand in the photos' place, and the same pixels
    come out. It holds the photo (the first, if there are several), for --background photo and
    --compare: give it to nobody who is not to see that.

    \b
    mt source save me.mtsource --source me.jpg
    mt source save me.mtsource --source front.jpg --source back.jpg
    mt source save dressed.mtsource --source me.mtsource --garment dress.png \\
           --garment-parts torso,upper-legs
    mt source save me.mtsource --source me.jpg --weights mine.safetensors --force
    """
    from motion_transfer.render.keep import keep_source

    pairs = pair_words(garments, garment_parts, "garment", "parts")
    options = options_from_words(KeepOptions, {**words, "garments": pairs})
    keep_source(options, output, choose_listener(quiet=quiet, as_json=False))
    if not quiet:
        tell(f"wrote {output}: {output.stat().st_size / 1e6:.1f} MB")
