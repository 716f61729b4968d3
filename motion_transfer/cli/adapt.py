"""`mt adapt`: weights that have learned one person."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import (
    FILE,
    SectionCommand,
    described_options,
    events_option,
    section,
)
from motion_transfer.cli.progress import choose_listener
from motion_transfer.cli.terminal import tell
from motion_transfer.option import options_from_words
from motion_transfer.render.options import AdaptOptions

output_option = section("Output")


@click.command(cls=SectionCommand)
@described_options(AdaptOptions)
@output_option("-o", "--output", type=FILE, required=True, help="A new .safetensors file.")
@output_option("-q", "--quiet", is_flag=True, help="Say only errors.")
@events_option()
def adapt(
    output: Path,
    quiet: bool,
    as_json: bool,
    **words: Any,
) -> None:
    """Let the network learn one person from their own photos, in a few minutes.

    What it writes is a checkpoint for --weights. It is at its best with the same photos as source.
    `mt run --adapt` does the same on its way. What was learned once is kept in the cache.

    \b
    mt adapt --source me.jpg -o me.safetensors
    mt adapt --source front.jpg --source back.jpg -o me.safetensors
    mt run --source front.jpg --source back.jpg --weights me.safetensors \\
           --driver dance.mp4 -o out.mp4
    """
    from motion_transfer.render.adapted import write_adapted

    options = options_from_words(AdaptOptions, words)
    write_adapted(options, output, choose_listener(quiet=quiet, as_json=as_json))
    if not quiet and not as_json:
        tell(f"wrote {output}: {output.stat().st_size / 1e6:.1f} MB")
