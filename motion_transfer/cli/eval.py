"""`mt eval`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.people import prepare_body_model
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.sections import SectionOption, WordsCommand
from motion_transfer.errors import InputError

FILE = click.Path(path_type=Path)
HELD_OUT_PAIRS = 500


def section(heading: str) -> Any:
    """An option decorator whose options stand under one heading."""
    return partial(click.option, cls=SectionOption, section=heading)


pairs_option = section("Pairs (one of --pairs, --clips and --protocol)")
method_option = section("Methods to compare (any number, of any kind)")
protocol_option = section("Protocol (numbers are comparable only where it is the same)")
output_option = section("Output")
compare_option = section("Earlier results")


@click.command("eval", cls=WordsCommand)
@pairs_option(
    "--pairs",
    type=FILE,
    help="CSV with columns from,to (or source,target): file names of photos of one person.",
)
@pairs_option("--images", type=FILE, help="Folder that the names are relative to; else the CSV's.")
@pairs_option(
    "--clips",
    type=FILE,
    help="Folder of videos, NAME.mp4 with NAME_iuv/ or NAME_IUV.mkv: frames of a clip are paired.",
)
@pairs_option(
    "--protocol",
    "people",
    type=click.Choice(["people"]),
    help="The built-in set: synthetic people on whom nothing is ever trained; 500 unless --limit.",
)
@pairs_option(
    "--moments", type=int, default=8, help="Target moments a clip, two frames each; default 8."
)
@pairs_option("--limit", type=int, help="Only the first so many pairs (or clips).")
@pairs_option(
    "--iuv-order", metavar="ORDER", help="Channels of the IUV files: iuv or vui; else found out."
)
@pairs_option("--skip-broken", is_flag=True, help="Leave out pairs with missing or broken files.")
@method_option(
    "--weights", type=FILE, multiple=True, metavar="FILE...", help="Checkpoints of the network."
)
@method_option("--renderer", metavar="texture", help="The renderer without a network as well.")
@method_option(
    "--results",
    type=FILE,
    multiple=True,
    metavar="FOLDER...",
    help="Pictures that another method made, named SOURCE__TARGET.png or from.jpg___to.jpg.",
)
@protocol_option(
    "--size", default="256x256", metavar="WxH", help="Compare at that size; default 256x256."
)
@protocol_option(
    "--background",
    default="white",
    metavar="COLOUR",
    help="Behind the person: white (default), black, #rrggbb, or photo (the source's).",
)
@protocol_option(
    "--metrics",
    multiple=True,
    metavar="NAME...",
    help="ssim psnr l1 efficientnet-lite0 (these by default), lpips, fid, flicker (with --clips).",
)
@protocol_option(
    "--lpips-weights", type=FILE, help="AlexNet's or VGG-16's of torchvision; adds lpips."
)
@protocol_option("--fid-weights", type=FILE, help="inception-2015-12-05.pt; adds fid.")
@output_option("-o", "--output", type=FILE, help="Folder for results.json, scores.csv, sheet.png.")
@output_option("--save-images", is_flag=True, help="Write every result there as well.")
@output_option("--workers", type=int, help="Threads; default: one for each core.")
@output_option("--force", is_flag=True, help="Replace an earlier evaluation.")
@output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
@output_option("--json", "as_json", is_flag=True, help="Print results.json, not the table.")
@compare_option(
    "--compare",
    type=FILE,
    multiple=True,
    metavar="FILE...",
    help="Only print a table of earlier results; refused where protocols differ.",
)
def eval_(compare: tuple[Path, ...], **options: Any) -> None:
    """Score renderers, and other methods' pictures, on the same pairs.

    Every source is rendered in its target's pose and compared with the real target: SSIM, PSNR,
    l1, a perceptual distance, each for the whole picture and for the person alone; LPIPS and FID
    with weights that you give.

    \b
    mt eval --pairs pairs.csv --renderer texture -o draft/
    mt eval --pairs pairs.csv --images photos/ --weights a.safetensors b.safetensors \\
            --results CBI/ DSC/ -o table1/
    mt eval --clips fashion/ --weights a.safetensors -o videos/
    mt eval --protocol people --weights a.safetensors --renderer texture -o people/
    mt eval --compare table1/results.json later/results.json
    """
    if compare:
        from motion_transfer.evaluation.report import compare as compare_results

        click.echo(compare_results(compare))
        return
    if options["output"] is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    if sum(options[name] is not None for name in ("pairs", "clips", "people")) != 1:
        raise click.UsageError("Give one of --pairs, --clips and --protocol.")
    _evaluate(**options)


def _evaluate(*, output: Path, quiet: bool, as_json: bool, **options: Any) -> None:
    from motion_transfer.evaluation.choice import choose_measures
    from motion_transfer.evaluation.evaluate import EvaluationOptions, check_output, evaluate
    from motion_transfer.evaluation.framing import Framing
    from motion_transfer.evaluation.report import table

    width, height = _parse_size(options["size"])
    if options["renderer"] not in (None, "texture"):
        raise InputError(
            f"renderer {options['renderer']!r}; only texture needs naming, the network comes with"
            " --weights"
        )
    settings = EvaluationOptions(
        output=output,
        framing=Framing(width, height, options["background"]),
        weights=options["weights"],
        texture=options["renderer"] == "texture",
        results=options["results"],
        save_images=options["save_images"],
        force=options["force"],
        skip_broken=options["skip_broken"],
        workers=options["workers"],
    )
    check_output(output, force=settings.force)
    has_clips = options["clips"] is not None
    measures = choose_measures(
        [name for words in options["metrics"] for name in words.split(",") if name],
        lpips_weights=options["lpips_weights"],
        fid_weights=options["fid_weights"],
        has_clips=has_clips,
    )
    with CountBar("looking at the pairs", unit="picture", quiet=quiet) as bar:
        pairs = _open_pairs(options, bar.advance, quiet)

    def note(words: str) -> None:
        if not quiet:
            click.echo(f"mt: note: {words}", err=True)

    for line in pairs.dropped:
        note(f"left out: {line}")
    with CountBar("scoring", unit="pair", quiet=quiet) as bar:
        results = evaluate(
            settings, pairs, measures, has_clips=has_clips, notice=note, done=bar.advance
        )
    if as_json:
        click.echo((output / "results.json").read_text(), nl=False)
    elif not quiet:
        protocol = results.protocol
        click.echo(table(results.columns, results.methods))
        click.echo(
            f"{protocol.pairs_count} pairs of {protocol.pairs_name} at {protocol.resolution};"
            f" mean ± standard error, * best\nwrote {output}: results.json, scores.csv, sheet.png"
        )


def _open_pairs(options: dict[str, Any], done: Any, quiet: bool) -> Any:
    from motion_transfer.media.iuv_image import CHANNEL_ORDERS
    from motion_transfer.training.clips import open_clip_pairs
    from motion_transfer.training.pairs import open_pairs
    from motion_transfer.training.streamed import held_out_pairs

    if options["iuv_order"] not in (None, *CHANNEL_ORDERS):
        raise InputError(
            f"channel order {options['iuv_order']!r}; supported are {', '.join(CHANNEL_ORDERS)}"
        )
    for name in ("limit", "moments"):
        if options[name] is not None and options[name] < 1:
            raise InputError(f"{name} is {options[name]}; it must be at least 1")
    common = {name: options[name] for name in ("iuv_order", "limit", "skip_broken")}
    if options["people"] is not None:
        prepare_body_model(quiet)
        return held_out_pairs(options["limit"] or HELD_OUT_PAIRS)
    if options["clips"] is not None:
        return open_clip_pairs(options["clips"], moments=options["moments"], done=done, **common)
    return open_pairs(options["pairs"], options["images"], done=done, **common)


def _parse_size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise InputError(f"size {text!r}; write WIDTHxHEIGHT, such as 256x256")
    return int(width), int(height)
