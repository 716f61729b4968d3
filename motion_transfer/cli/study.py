"""`mt eval study`: people are asked which of two methods' results is better."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import FILE, WordsCommand, described_options, section
from motion_transfer.cli.progress import CountBar
from motion_transfer.cli.serving import serve_page
from motion_transfer.cli.terminal import note, tell
from motion_transfer.evaluation.options import OUTPUT
from motion_transfer.evaluation.study.options import ScoreOptions, StudyOptions
from motion_transfer.extras import require_extra
from motion_transfer.option import list_options, options_from_words

output_option = section(OUTPUT)
serve_option = section("Serving")


@click.command(cls=WordsCommand, short_help="Ask people which of two methods' results is better.")
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
    serve_page(server.link, server.run, open_browser=open_browser)
