"""`mt run`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.progress import choose_listener
from motion_transfer.cli.sections import SectionCommand, SectionOption
from motion_transfer.errors import InputError

FILE = click.Path(path_type=Path)


def section(heading: str) -> Any:
    """An option decorator whose options stand under one heading."""
    return partial(click.option, cls=SectionOption, section=heading)


source_option = section("Source")
driver_option = section("Driver")
garment_option = section("Garment transfer")
render_option = section("Rendering")
output_option = section("Output")


@click.command(cls=SectionCommand)
@source_option("--source", type=FILE, required=True, help="Photo of the person.")
@source_option(
    "--source-iuv", type=FILE, help="Its IUV; else STEM_IUV.png or STEM_iuv.png beside it."
)
@source_option(
    "--person",
    default="largest",
    metavar="WHO",
    help="largest (default), an index from the left (0 first), or a box x0,y0,x1,y1 in pixels.",
)
@source_option(
    "--source-iuv-order", metavar="ORDER", help="As --iuv-order, for source and garments."
)
@driver_option(
    "--driver",
    type=FILE,
    required=True,
    help="Folder of IUV images, one IUV image, lossless IUV video, .npy, .npz, detectron2's"
    " results.pkl, or people:MOTION (such as people:walk,frames=60; see `mt people drive -h`).",
)
@driver_option(
    "--driver-person", default="largest", metavar="WHO", help="Whom to follow; as --person."
)
@driver_option(
    "--iuv-order",
    metavar="ORDER",
    help="Channels of the file's RGB: iuv, or vui as Caffe2's DensePose has it; else found out.",
)
@driver_option(
    "--missing",
    metavar="WHAT",
    help="Frames that show nobody, and numbers missing in a folder: hold (repeat the frame"
    " before), background, or fail. Default: background for the former, fail for the latter.",
)
@driver_option("--frames", metavar="A:B", help="Only these frames, counted from 0, B excluded.")
@garment_option(
    "--garment",
    "garments",
    multiple=True,
    metavar="PHOTO[,IUV]",
    help="Take parts from this photo; may be repeated, each with its --garment-parts.",
)
@garment_option(
    "--garment-parts",
    multiple=True,
    metavar="PARTS",
    help="Such as torso,upper-legs; `mt info parts` lists the names.",
)
@render_option(
    "--renderer",
    metavar="NAME",
    help="texture (a draft, no weights; default) or nhrr (the network; default with --weights).",
)
@render_option("--weights", type=FILE, help="Checkpoint for nhrr, safetensors.")
@render_option(
    "--background",
    default="white",
    metavar="COLOUR",
    help="white (default), black, #rrggbb, or photo (the source's, without the person).",
)
@render_option("--workers", type=int, help="Threads; default: one for each core.")
@render_option(
    "--compile/--no-compile",
    "compile_network",
    default=None,
    help="Compile the network first; default: for drivers of 300 frames and more.",
)
@output_option(
    "-o",
    "--output",
    type=FILE,
    required=True,
    help=".mp4 .mov .mkv .webm .gif, .png for one frame, or a folder of PNG.",
)
@output_option(
    "--fps", metavar="RATE", help="Such as 25 or 30000/1001; default: the driver's, or 30."
)
@output_option("--codec", metavar="NAME", help="h264, h265, vp9, av1, ffv1; default by container.")
@output_option("--crf", type=int, help="Quality, lower is better; default by codec, 18 for h264.")
@output_option(
    "--size",
    default="driver",
    metavar="driver|crop|even",
    help="The driver's frame (default), the square around the person, or the frame made even.",
)
@output_option("--compare", is_flag=True, help="Source, IUV and result side by side.")
@output_option("--sheet", type=FILE, help="Write a contact sheet (PNG) there as well.")
@output_option("--force", is_flag=True, help="Replace an existing output.")
@output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
@output_option("--json", "as_json", is_flag=True, help="Print events as JSON lines.")
def run(
    garments: tuple[str, ...],
    garment_parts: tuple[str, ...],
    frames: str | None,
    fps: str | None,
    compile_network: bool | None,
    quiet: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Render the person of a photo in the motion of a driver.

    \b
    mt run --source photo.png --driver iuv_frames/ -o out.mp4
    mt run --source photo.png --driver dance.mkv --background photo --compare -o out.mp4
    mt run --source me.png --driver me_IUV.png --garment dress.png \\
           --garment-parts torso,upper-legs --background photo -o dressed.png
    """
    from motion_transfer.render.options import RenderOptions, parse_frames, parse_rate
    from motion_transfer.render.run import run as render

    render(
        RenderOptions(
            frames=parse_frames(frames) if frames else (None, None),
            frame_rate=parse_rate(fps) if fps else None,
            garments=_pair_garments(garments, garment_parts),
            compile=compile_network,
            **options,
        ),
        choose_listener(quiet=quiet, as_json=as_json),
    )


def _pair_garments(garments: tuple[str, ...], parts: tuple[str, ...]) -> tuple[Any, ...]:
    from motion_transfer.render.options import Garment, parse_parts

    if len(garments) != len(parts):
        raise InputError(
            f"{len(garments)} --garment but {len(parts)} --garment-parts; give one for each"
        )
    pairs = []
    for garment, words in zip(garments, parts, strict=True):
        photo, _, iuv = garment.partition(",")
        pairs.append(
            Garment(photo=Path(photo), iuv=Path(iuv) if iuv else None, parts=parse_parts(words))
        )
    return tuple(pairs)
