"""`mt run`."""

from __future__ import annotations

from typing import Any

import click

from motion_transfer.cli.progress import choose_listener
from motion_transfer.cli.sections import SectionCommand, SectionOption, run_options
from motion_transfer.errors import InputError


@click.command(cls=SectionCommand)
@run_options
@click.option(
    "-q", "--quiet", is_flag=True, cls=SectionOption, section="Output", help="Say only errors."
)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    cls=SectionOption,
    section="Output",
    help="Print events as JSON lines.",
)
def run(
    garments: tuple[str, ...],
    garment_parts: tuple[str, ...],
    quiet: bool,
    as_json: bool,
    **words: Any,
) -> None:
    """Render the person of a photo in the motion of a driver.

    The IUV of a photo or a video that comes without it is estimated. A run that was stopped, in
    whatever way, goes on where it was when it is started again.

    \b
    mt run --source photo.png --driver iuv_frames/ -o out.mp4
    mt run --source photo.png --driver dance.mp4 --background photo --compare -o out.mp4
    mt run --source me.png --driver me_IUV.png --garment dress.png \\
           --garment-parts torso,upper-legs --background photo -o dressed.png
    """
    from motion_transfer.render.options import options_from_words
    from motion_transfer.render.run import run as render

    pairs = pair_garments(garments, garment_parts)
    options = options_from_words({**words, "garments": pairs})
    render(options, choose_listener(quiet=quiet, as_json=as_json))


def pair_garments(garments: tuple[str, ...], parts: tuple[str, ...]) -> list[dict[str, str]]:
    """`PHOTO[,IUV]` and their parts, matched by order. Raises: InputError if one has no partner."""
    if len(garments) != len(parts):
        raise InputError(
            f"{len(garments)} --garment but {len(parts)} --garment-parts; give one for each"
        )
    return [
        dict(zip(("photo", "iuv"), garment.split(",", 1), strict=False)) | {"parts": words}
        for garment, words in zip(garments, parts, strict=True)
    ]
