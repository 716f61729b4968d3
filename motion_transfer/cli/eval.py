"""`mt eval`: an evaluation, or a table of earlier ones."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import (
    FILE,
    WordsGroup,
    described_options,
    section,
)
from motion_transfer.cli.people import prepare_body_model
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.study import study
from motion_transfer.cli.terminal import note
from motion_transfer.evaluation.options import (
    DEEPFASHION,
    FREE_PEOPLE,
    OUTPUT,
    PAIRS,
    PEOPLE,
    EvaluationOptions,
)
from motion_transfer.option import options_from_words

pairs_option = section(PAIRS)
output_option = section(OUTPUT)
compare_option = section("Earlier results")


@click.group("eval", cls=WordsGroup, invoke_without_command=True, subcommand_metavar="[study ...]")
@described_options(EvaluationOptions, required=False)
@pairs_option(
    "--list-pairs",
    is_flag=True,
    help="Only print the pairs of deepfashion as such a CSV; needs no IUV yet.",
)
@output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
@output_option("--json", "as_json", is_flag=True, help="Print results.json, not the table.")
@compare_option(
    "--compare",
    type=FILE,
    multiple=True,
    metavar="FILE...",
    help="Only print a table of earlier results; refused where protocols differ.",
)
@click.pass_context
def eval_(
    context: click.Context,
    compare: tuple[Path, ...],
    list_pairs: bool,
    quiet: bool,
    as_json: bool,
    **words: Any,
) -> None:
    """Score renderers, and other methods' pictures, on the same pairs.

    Every source is rendered in its target's pose and compared with the real target: SSIM, PSNR,
    l1, a perceptual distance, each for the whole picture and for the person alone; the same
    distance of what the source hides and of the enlarged head; lattices; faces; LPIPS and FID with
    weights that you give. A number that not all pairs have says of how many it is.

    \b
    mt eval --pairs pairs.csv --renderer texture -o draft/
    mt eval --pairs pairs.csv --images photos/ --weights a.safetensors b.safetensors \\
            --results CBI/ DSC/ -o photos_scores/
    mt eval --clips fashion/ --weights a.safetensors -o videos/
    mt eval --protocol people --weights a.safetensors --renderer texture -o people/
    mt eval --protocol free-people --assets makehuman/ --weights a.safetensors -o free/
    mt eval --protocol deepfashion --images In-shop/ --weights a.safetensors \\
            --lpips-weights alexnet.pth --results DSC/ -o table1/
    mt eval --compare table1/results.json later/results.json

    `mt eval study` asks people instead.
    """
    if context.invoked_subcommand is not None:
        if any(value not in (None, False, ()) for value in context.params.values()):
            raise click.UsageError("Options of `mt eval` mean nothing to `mt eval study`.")
        return
    if compare:
        from motion_transfer.evaluation.report import compare as compare_results

        click.echo(compare_results(compare))
    elif list_pairs:
        _list_pairs(words)
    else:
        _evaluate(words, quiet=quiet, as_json=as_json)


def _list_pairs(words: dict[str, Any]) -> None:
    if words["protocol"] != DEEPFASHION or words["images"] is None:
        raise click.UsageError(f"--list-pairs needs --protocol {DEEPFASHION} and --images DIR")
    from motion_transfer.evaluation.deepfashion import list_table1_pairs

    folder, listed = Path(words["images"]), words["pairs"]
    text = list_table1_pairs(folder, Path(listed) if listed else None, words["limit"])
    click.echo(text, nl=False)


def _evaluate(words: dict[str, Any], *, quiet: bool, as_json: bool) -> None:
    if words["output"] is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    options = options_from_words(EvaluationOptions, words)
    from motion_transfer.evaluation.evaluate import evaluate
    from motion_transfer.evaluation.report import describe_results

    if options.protocol in (PEOPLE, FREE_PEOPLE):
        prepare_body_model(quiet, options.protocol_assets)
    with (
        CountBar("looking at the pairs", unit="picture", quiet=quiet) as pictures,
        CountBar("scoring", unit="pair", quiet=quiet) as pairs,
    ):
        results = evaluate(
            options,
            notice=partial(note, quiet=quiet),
            checked=pictures.advance,
            done=pairs.advance,
        )
    if as_json:
        click.echo((options.output / "results.json").read_text(encoding="utf-8"), nl=False)
    elif not quiet:
        click.echo(describe_results(results))
        click.echo(f"wrote {options.output}: results.json, scores.csv, sheet.png")


eval_.add_command(study)
