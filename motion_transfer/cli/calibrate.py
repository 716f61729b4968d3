"""`mt calibrate`: weights that can be computed in 8 bits."""

from __future__ import annotations

from pathlib import Path

import click

from motion_transfer.cli.options import FILE, SectionCommand, section
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.terminal import tell

PEOPLE = 24  # ranges hardly grow after a dozen

people_option = section("People")
output_option = section("Output")


@click.command(cls=SectionCommand)
@click.argument("weights", type=FILE)
@people_option(
    "--count", type=click.IntRange(1), default=PEOPLE, show_default=True, help="People to draw."
)
@people_option(
    "--assets",
    type=FILE,
    metavar="DIR",
    help="Folder of MakeHuman's assets, which half of them wear; else MT_ASSETS, if it is set.",
)
@output_option("-o", "--output", type=FILE, help="Else the ranges are added to WEIGHTS itself.")
@output_option("-q", "--quiet", is_flag=True, help="Say only errors.")
def calibrate(
    weights: Path, count: int, assets: Path | None, output: Path | None, quiet: bool
) -> None:
    """Let the network of a checkpoint be computed in 8 bits.

    That needs to know of which ranges its numbers are. They are measured on synthetic people and
    stand in the checkpoint afterwards, whose tensors stay as they are. `mt run` then takes 8 bits
    where the machine is fast at them. Compare before you ship:

    \b
    mt calibrate mine.safetensors
    mt eval --protocol people --limit 50 --weights mine.safetensors --precision bf16 -o bf16
    mt eval --protocol people --limit 50 --weights mine.safetensors --precision int8 -o int8
    mt eval --compare bf16/results.json int8/results.json
    """
    from motion_transfer.evaluation.calibration import calibrate as measure
    from motion_transfer.people import find_assets
    from motion_transfer.weights import find_weights

    path = find_weights(weights)
    final = output or path
    with CountBar("drawing people", unit="person", quiet=quiet, total=count) as bar:
        measure(path, final, count=count, assets=find_assets(assets), done=bar.advance)
    if not quiet:
        tell(f"wrote {final}, with the ranges of its network's numbers")
