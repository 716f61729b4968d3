"""`mt iuv`: IUV estimated, converted, and repaired."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import FILE, CommandGroup, SectionCommand, add_options, section
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.terminal import counted, note, tell
from motion_transfer.estimate.opening import ESTIMATORS
from motion_transfer.option import parse_frames, parse_rate

input_option = section("Input")
estimate_option = section("Estimator")
repair_option = section("Repair")
output_option = section("Output")

INPUT_OPTIONS = [
    input_option(
        "--iuv-order", metavar="ORDER", help="Channels of the file's RGB, iuv or vui; else found."
    ),
    input_option(
        "--missing",
        default="fail",
        metavar="fail|hold|background",
        help="Numbers missing in a folder or dump: stop (default), hold the one before, or nobody.",
    ),
]
OUTPUT_OPTIONS = [
    output_option(
        "-o",
        "--output",
        type=FILE,
        required=True,
        help="A folder for PNG, .mkv (FFV1, lossless), .npy, or .png for one frame.",
    ),
    output_option(
        "--order",
        "output_order",
        default="vui",
        metavar="ORDER",
        help="Channels to write: vui (default, as Caffe2's DensePose) or iuv; arrays are I, U, V.",
    ),
    output_option("--fps", metavar="RATE", help="Of an .mkv; default: the input's, or 30."),
    output_option("--force", is_flag=True, help="Replace an existing output."),
    output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors."),
]


class IuvGroup(CommandGroup):
    """A group whose command `estimate` needs not be named: `mt iuv me.jpg`."""

    default = "estimate"

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        names = (*self.commands, *self.get_help_option_names(ctx))
        if args and args[0] not in names:  # click would take a file for an unknown command
            args = [self.default, *args]
        return super().parse_args(ctx, args)


@click.group(cls=IuvGroup)
def iuv() -> None:
    """IUV from raw pictures; convert IUV between formats, and repair it.

    Without a command it is `estimate`, whose options `mt iuv estimate -h` lists.

    \b
    mt iuv me.jpg -o me_IUV.png
    mt iuv dance.mp4 -o dance.mkv
    mt iuv convert results.pkl -o dance_iuv/
    mt iuv repair dance_iuv/ -o steady.mkv --fill-gaps interpolate --speckle 20 --smooth
    """


@iuv.command(cls=SectionCommand)
@click.argument("source", metavar="PHOTO|VIDEO|DIR", type=FILE)
@estimate_option(
    "--estimator",
    default="blazepose",
    metavar="|".join(ESTIMATORS),
    help="blazepose (default; needs `mt models fetch`, once), blazepose-heavy (nearer, slower;"
    " `mt models fetch --heavy`), or densepose, with its --model.",
)
@estimate_option(
    "--model",
    type=FILE,
    metavar="FILE",
    help="DensePose, TorchScript or .onnx. A TorchScript file is a program: it is run.",
)
@input_option(
    "--person",
    default="all",
    metavar="WHO",
    help="all (default), largest, an index from the left (0 first), or a box x0,y0,x1,y1.",
)
@input_option(
    "--missing",
    default="background",
    metavar="hold|background|fail",
    help="Frames in which nobody is found: repeat the frame before, background (default), or stop.",
)
@input_option(
    "--frames", default=":", metavar="A:B", help="Only these frames, counted from 0, B excluded."
)
@output_option(
    "--alpha",
    is_flag=True,
    help="Write the people's alpha, too: me_IUV.png and me_alpha.png, dance.mkv and"
    " dance_alpha.mkv.",
)
@add_options(OUTPUT_OPTIONS)
def estimate(output: Path, fps: str | None, frames: str, quiet: bool, **options: Any) -> None:
    """Find the people of raw pictures and write their IUV.

    Photos are turned upright as their EXIF says, videos as their rotation flag says. A video's
    frame rate is kept; a varying one becomes its mean. A folder of pictures is taken as the frames
    of a clip. People are followed until the shot changes.

    \b
    mt iuv me.jpg -o me_IUV.png
    mt iuv dance.mp4 -o dance.mkv --person largest --frames 0:300
    mt iuv dance.mp4 -o dance_iuv/ --estimator densepose --model densepose.pt
    mt iuv me.jpg -o me_IUV.png --alpha
    """
    from motion_transfer.estimate.run import EstimateOptions, estimate_iuv
    from motion_transfer.media.iuv.writing import name_alpha
    from motion_transfer.render.plan import list_stretches

    settings = EstimateOptions(
        output=output, frame_rate=_rate(fps), frames=parse_frames(frames), **options
    )
    with CountBar("finding people", unit="frame", quiet=quiet) as bar:
        report = estimate_iuv(settings, bar.advance)
    seen, notes = report.summary, list(report.notes)
    start = settings.frames[0] or 0
    if seen.empty:
        shown = {"hold": "the frame before", "background": "background only"}[settings.missing]
        empty = [(start + first, start + end) for first, end in seen.empty]
        times = list_stretches(empty, start, report.frame_rate)
        notes.append(f"nobody found in {counted(seen.empty_count, 'frame')}, {shown}: {times}")
    cuts = sum(shot > start for shot in seen.shots)
    shots = f", {cuts + 1} shots" if cuts else ""
    people = f", up to {seen.most_people} people" if seen.most_people > 1 else ""
    written = f"{output} and {name_alpha(output)}" if settings.alpha else output
    _report(quiet, notes, f"wrote {written}: {counted(seen.frame_count, 'frame')}{shots}{people}")


@iuv.command(cls=SectionCommand)
@click.argument("source", metavar="IN", type=FILE)
@add_options([*INPUT_OPTIONS, *OUTPUT_OPTIONS])
def convert(output: Path, fps: str | None, quiet: bool, **options: Any) -> None:
    """Rewrite IUV in another form, without loss.

    IN is a folder of IUV images or arrays, one IUV image, a lossless video, a .npy or .npz stack,
    quantised results (3 x H x W), global UV (floats, H x W x 2, NaN background), or a detectron2
    dump (apply_net.py dump; nothing in it is executed).

    \b
    mt iuv convert results.pkl -o dance_iuv/
    mt iuv convert dance_iuv/ -o dance.mkv --fps 25
    mt iuv convert caffe2_iuv/ -o rgb_iuv/ --order iuv
    """
    from motion_transfer.media.iuv.convert import ConvertOptions, convert_iuv

    settings = ConvertOptions(output=output, frame_rate=_rate(fps), **options)
    with CountBar("converting", unit="frame", quiet=quiet) as bar:
        written, notes = convert_iuv(settings, bar.advance)
    _report(quiet, notes, f"wrote {output}: {counted(written.frame_count, 'frame')}")


@iuv.command(cls=SectionCommand)
@click.argument("source", metavar="IN", type=FILE)
@repair_option(
    "--fill-gaps",
    metavar="hold|interpolate",
    help="Fill frames without anybody: repeat the frame before, or move its parts on.",
)
@repair_option(
    "--speckle",
    type=int,
    default=0,
    metavar="N",
    help="Remove regions of one part, and holes, of fewer than N pixels.",
)
@repair_option("--smooth", is_flag=True, help="Steady part borders, and U and V within parts.")
@add_options([*INPUT_OPTIONS, *OUTPUT_OPTIONS])
def repair(output: Path, fps: str | None, quiet: bool, **options: Any) -> None:
    """Fill gaps, remove speckles, and steady a driver; any length.

    IUV that was resized with interpolation is mended without being asked: pixels whose part is
    found nowhere near, blends of those around them, take the nearest other pixel.

    Flicker is reported before and after: the share of the body's pixels whose part comes and goes
    within one frame, and how far U and V are from the mean of their neighbours in time.

    \b
    mt iuv repair dance_iuv/ -o steady.mkv --fill-gaps interpolate --speckle 20 --smooth
    mt iuv repair resized_iuv/ -o mended_iuv/
    """
    from motion_transfer.repair.run import RepairOptions, repair_iuv

    settings = RepairOptions(output=output, frame_rate=_rate(fps), **options)
    with CountBar("repairing", unit="frame", quiet=quiet) as bar:
        report = repair_iuv(settings, bar.advance)
    old, new = report.before, report.after
    _report(
        quiet,
        report.notes,
        f"wrote {output}: {counted(new.frame_count, 'frame')}; empty frames {old.empty_frames} ->"
        f" {new.empty_frames}, part flicker {old.parts:.2%} -> {new.parts:.2%}, UV flicker"
        f" {old.uv:.2f} -> {new.uv:.2f} of 255",
    )


def _rate(fps: str | None) -> Fraction | None:
    return parse_rate(fps) if fps else None


def _report(quiet: bool, notes: Iterable[str], result: str) -> None:
    if not quiet:
        for words in notes:
            note(words)
        tell(result)
