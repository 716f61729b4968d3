"""`mt eval`: an evaluation, or a table of earlier ones; `mt eval study`: people are asked."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Collection
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import (
    FILE,
    WordsCommand,
    WordsGroup,
    described_options,
    section,
)
from motion_transfer.cli.people import prepare_body_model
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.terminal import note, tell
from motion_transfer.evaluation.options import (
    DEEPFASHION,
    FREE_PEOPLE,
    OUTPUT,
    PAIRS,
    PEOPLE,
    EvaluationOptions,
)
from motion_transfer.evaluation.study.options import ScoreOptions, StudyOptions
from motion_transfer.extras import require_extra
from motion_transfer.option import list_options, options_from_words

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
        return
    if list_pairs:
        if words["protocol"] != DEEPFASHION or words["images"] is None:
            raise click.UsageError(f"--list-pairs needs --protocol {DEEPFASHION} and --images DIR")
        from motion_transfer.evaluation.deepfashion import list_table1_pairs

        folder, listed = Path(words["images"]), words["pairs"]
        text = list_table1_pairs(folder, Path(listed) if listed else None, words["limit"])
        click.echo(text, nl=False)
        return
    if words["output"] is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    options = options_from_words(EvaluationOptions, words)
    from motion_transfer.evaluation.evaluate import evaluate
    from motion_transfer.evaluation.report import table, table_beside

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
        protocol = results.protocol
        click.echo(table(results.columns, results.methods, protocol.pairs_count))
        click.echo(
            f"{protocol.pairs_count} pairs of {protocol.pairs_name} at {protocol.resolution};"
            " mean ± standard error, * best"
        )
        if results.published is not None:
            beside = table_beside(
                results.published, results.columns, results.methods, protocol.pairs_count
            )
            click.echo(
                f"\n{beside}\n{results.published.remark}\n"
                "what the paper leaves open, and what holds here: protocol.choices in results.json"
            )
        click.echo(f"wrote {options.output}: results.json, scores.csv, sheet.png")


serve_option = section("Serving")


@eval_.command(cls=WordsCommand)
@click.argument("results", nargs=-1)
@described_options(StudyOptions, required=False)
@output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
@described_options(ScoreOptions, required=False)
@serve_option(
    "--serve", type=FILE, metavar="STUDY", help="Show a study's page here; answers go to answers/."
)
@serve_option("--port", type=int, default=0, help="Default: any that is free.")
@serve_option("--no-open", is_flag=True, help="Print the link, and open no browser.")
def study(
    results: tuple[str, ...],
    serve: Path | None,
    port: int,
    no_open: bool,
    quiet: bool,
    **words: Any,
) -> None:
    """Ask people which of two methods' results is better, as the paper's user study does.

    RESULTS are folders of pictures or videos under common names, one for each method and named
    after it (NAME=FOLDER renames it), or what `mt eval --save-images` wrote. The page is a folder
    to send; it needs no server, and tells nobody which method made what.

    \b
    mt eval study CBI/ ours/ --sources photos/ -o study/
    mt eval study table1/ DSC=downloads/dsc/ --base lite --sources photos/ -o study/
    mt eval study --score study/answers/*.json
    mt eval study --serve study/
    """
    if sum(map(bool, (results, words["score"], serve))) != 1:
        raise click.UsageError("Give one of RESULTS, --score ANSWERS and --serve STUDY.")
    if serve is not None:
        _take_words({}, words)
        _serve_study(serve, port, open_browser=not no_open)
    elif words["score"]:
        _score_study(words, quiet=quiet)
    else:
        _make_study(results, words, quiet=quiet)


def _take_words(own: Collection[str], words: dict[str, Any]) -> dict[str, Any]:
    """Take an action's own words. Raises: UsageError for those that mean nothing to it."""
    for name, value in words.items():
        if name not in own and value not in (None, ()):
            flag = name.replace("_", "-")
            raise click.UsageError(f"--{flag} means nothing to this use of `mt eval study`.")
    return {name: words[name] for name in own}


def _make_study(results: tuple[str, ...], words: dict[str, Any], *, quiet: bool) -> None:
    own = _take_words([entry.name for entry in list_options(StudyOptions)], words)
    if own["output"] is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    options = replace(options_from_words(StudyOptions, own), results=results)
    from motion_transfer.evaluation.study.making import make_study

    with CountBar("writing views", unit="file", quiet=quiet) as bar:
        key = make_study(options, notice=partial(note, quiet=quiet), done=bar.advance)
    if not quiet:
        shown = f"{key.asked} of {len(key.comparisons)} pairs, {key.repeats} of them twice"
        tell(f"wrote {options.output}: a reader is shown {shown}; send page/, keep key.json")


def _score_study(words: dict[str, Any], *, quiet: bool) -> None:
    names = [entry.name for entry in list_options(ScoreOptions)]
    own = _take_words([*names, "output", "force"], words)
    where, force = own.pop("output"), own.pop("force")
    options = replace(
        options_from_words(ScoreOptions, own),
        output=None if where is None else Path(where),
        force=bool(force),
    )
    from motion_transfer.evaluation.study.results import table, write_scores

    scores, output = write_scores(options, partial(note, quiet=quiet))
    if not quiet:
        click.echo(table(scores))
        readers = f"{len(scores.readers)} reader{'s' if len(scores.readers) > 1 else ''}"
        tell(f"{readers}; wrote {output}: index.html, results.json")


def _serve_study(folder: Path, port: int, *, open_browser: bool) -> None:
    require_extra("preview")
    from motion_transfer.preview.study import open_study_server

    server = open_study_server(folder, port)
    tell(server.link)
    sys.stdout.flush()  # whoever reads it from a pipe waits for it
    if open_browser:
        click.launch(server.link)
    with contextlib.suppress(KeyboardInterrupt):  # the way to end it
        server.run()
