"""What a study found, as a folder: a page to look at, the same as JSON; and as a table."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError
from motion_transfer.evaluation.study.answers import find_key, list_answers, read_all
from motion_transfer.evaluation.study.items import Say
from motion_transfer.evaluation.study.key import QUESTIONS, RESULTS_FOLDER, read_key
from motion_transfer.evaluation.study.options import ScoreOptions
from motion_transfer.evaluation.study.scoring import Scores, score_answers
from motion_transfer.evaluation.study.statistics import Share
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.version import __version__

RESULTS_FILE, PAGE_FILE = "results.json", "index.html"
RESULTS_FORMAT = "mt-study-results-1"


def write_scores(options: ScoreOptions, notice: Say = lambda _words: None) -> tuple[Scores, Path]:
    """Score answers and write the folder of results, whose path is returned as well.

    Args:
        notice: Told of answers that are left out.
    Raises: InputError with a line for each file that cannot be counted, unless these may be left
        out; OutputError.
    """
    answers = list_answers(options.score)
    key_file = options.key or find_key(answers[0])
    key = read_key(key_file)
    output = options.output or key_file.absolute().parent / RESULTS_FOLDER
    check_destination(
        output,
        force=options.force,
        belongs=lambda item: item.name in (RESULTS_FILE, PAGE_FILE),
        content="results of a study",
    )
    readers, problems = read_all(answers, key)
    if problems and not options.skip_broken:
        raise InputError(*problems, "mend them, or leave them out with --skip-broken")
    if not readers:
        raise InputError(*problems, "no answers are left to count")
    for line in problems:
        notice(f"left out: {line}")
    scores = score_answers(readers, key)
    with work_folder(output) as folder:
        finished = folder / "finished"
        finished.mkdir()
        (finished / RESULTS_FILE).write_text(to_json(scores), encoding="utf-8")
        (finished / PAGE_FILE).write_text(_page(scores), encoding="utf-8")
        publish(finished, output)
    return scores, output


def to_json(scores: Scores) -> str:
    """Write all that was found as JSON."""
    facts = asdict(scores)
    for crossing in facts["crossings"]:
        crossing["counts"] = [
            {"realism": realism, "identity": identity, "items": count}
            for (realism, identity), count in crossing["counts"].items()
        ]
    content = {"format": RESULTS_FORMAT, "made_with": {"motion-transfer": __version__}, **facts}
    return json.dumps(content, indent=1) + "\n"


def table(scores: Scores) -> str:
    """Draw preferences, then agreement, as a table for a terminal."""
    head = ["", "preferred", "votes", "share", "Wilson 95 %", "other readers 95 %", "items"]
    rows = [head]
    for each in scores.preferences:
        rows.append(
            [
                each.question,
                f"{each.method} to {each.other}",
                f"{each.votes.count}/{each.votes.total}",
                percent(each.votes.value),
                interval((each.votes.low, each.votes.high)),
                interval(each.readers_interval),
                f"{each.items_won}:{each.items_lost}"
                + (f" ({each.items_tied} tied)" if each.items_tied else ""),
            ]
        )
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    for each in scores.agreements:
        lines.append(
            f"{each.question}: readers agree in {percent(each.observed)} (chance 50 %), alpha"
            f" {decimal(each.alpha)}; with themselves in {share(each.repeated)};"
            f" left chosen in {percent(each.left.value)}"
        )
    return "\n".join(lines)


def percent(value: float | None) -> str:
    """Write a share in percent."""
    return "-" if value is None else f"{value:.1%}".replace("%", " %")


def decimal(value: float | None) -> str:
    """Write a coefficient."""
    return "-" if value is None else f"{value:.2f}"


def share(value: Share | None) -> str:
    """Write a share and of how many it is."""
    return "-" if value is None else f"{percent(value.value)} of {value.total}"


def interval(ends: tuple[float, float] | None) -> str:
    """Write an interval of shares."""
    return "-" if ends is None else f"{100 * ends[0]:.1f} - {100 * ends[1]:.1f}"


def _page(scores: Scores) -> str:
    from jinja2 import Environment

    template = (
        files("motion_transfer.evaluation.study").joinpath("results.html.j2").read_text("utf-8")
    )
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    filters: dict[str, Any] = {"percent": percent, "decimal": decimal, "interval": interval}
    environment.filters.update(filters | {"share": share})
    return environment.from_string(template).render(
        scores=scores, words=QUESTIONS, version=__version__
    )
