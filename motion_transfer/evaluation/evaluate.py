"""One evaluation from options to a finished folder and its sheet: what `mt eval` calls."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from motion_transfer.devices import find_device, name_device
from motion_transfer.errors import InputError, OutputError
from motion_transfer.evaluation.candidates import ResultsFolder, open_candidates
from motion_transfer.evaluation.deepfashion import TABLE_1, open_table1_pairs
from motion_transfer.evaluation.framing import Image, PairPictures
from motion_transfer.evaluation.measures import Column, Measures, choose_measures
from motion_transfer.evaluation.options import (
    DEEPFASHION,
    FREE_PEOPLE,
    PEOPLE,
    EvaluationOptions,
)
from motion_transfer.evaluation.report import (
    RESULTS_FILE,
    Protocol,
    Results,
    scores_csv,
    summarise_methods,
)
from motion_transfer.evaluation.scoring import PairScores, Scorer
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.training.clips import open_clip_pairs
from motion_transfer.training.pairs import (
    Done,
    Pair,
    PairList,
    flat_stem,
    ignore_done,
    list_problems,
    open_pairs,
)
from motion_transfer.training.sources import held_out_pairs
from motion_transfer.version import __version__

ROWS_EACH = 3
CELL_PX, GAP_PX = 256, 4
LINE_PX, TEXT_SCALE = 22, 0.45  # a line's height, and OpenCV's font in it, chosen by eye
NAME_LENGTH = 22  # characters of it that fit a cell beside `median: `
SCORES_FILE, SHEET_FILE, IMAGES_FOLDER = "scores.csv", "sheet.png", "images"
HELD_OUT_PAIRS = 500  # the pairs of docs/quality.md; more take longer and say no more
SHEET_ORDER = ("efficientnet-lite0", "lpips", "ssim", "psnr", "l1")
"""Numbers that say how a picture looks, the one that says most first."""


def evaluate(
    options: EvaluationOptions,
    *,
    notice: Callable[[str], None] = lambda _words: None,
    checked: Done = ignore_done,
    done: Done = ignore_done,
) -> Results:
    """Score every candidate on the same pairs and write the folder.

    Whatever happens, nothing half-written stays behind and an earlier folder is untouched.

    Args:
        notice: Told of pairs that were left out.
        checked: Called with how many more pictures of how many were looked at before.
        done: Called with how many more pairs of how many are finished.
    Raises: InputError, OutputError before scoring where it can be known; RenderError.
    """
    check_output(options.output, force=options.force)
    made_with = _made_with(options.device)
    measures = choose_measures(
        options.metrics,
        weights={"lpips": options.lpips_weights, "fid": options.fid_weights},
        has_clips=options.clips is not None,
    )
    published = TABLE_1 if options.protocol == DEEPFASHION else None
    pairs, choices = open_pairs_of(options, checked)
    for line in pairs.dropped:
        notice(f"left out: {line}")
    if published is not None:
        _note_departures(options, measures, notice)
    folders = [ResultsFolder(path, pairs) for path in options.results]
    pairs = _check_results(folders, pairs, options, notice)
    candidates = open_candidates(options, folders)
    with work_folder(options.output) as folder:
        finished = folder / "finished"
        finished.mkdir()
        save = finished / IMAGES_FOLDER if options.save_images else None
        with Scorer(
            candidates, measures, options.framing, workers=options.worker_count, save=save
        ) as scorer:
            scored = scorer.score(pairs, lambda count: done(count, len(pairs)))
            protocol = Protocol.of(options.framing, pairs, measures, choices)
            methods = summarise_methods(candidates, measures, scored)
            results = Results(protocol, measures.columns, methods, published)
            _write_sheet(finished / SHEET_FILE, scorer, results, scored)
        (finished / RESULTS_FILE).write_text(results.to_json(made_with), encoding="utf-8")
        columns = [column for measure in measures.pairs for column in measure.columns]
        labels = [candidate.label for candidate in candidates]
        (finished / SCORES_FILE).write_text(scores_csv(scored, columns, labels), encoding="utf-8")
        publish(finished, options.output)
    return results


def check_output(path: Path, *, force: bool) -> None:
    """Refuse a folder before any work is done.

    Raises: OutputError if it exists and `force` is off, if it holds something else than an earlier
        evaluation, or if it cannot be written.
    """
    ours = {RESULTS_FILE, SCORES_FILE, SHEET_FILE, IMAGES_FOLDER}
    if not (force and path.is_dir()):
        check_destination(path, force=False)
    elif {item.name for item in path.iterdir()} - ours:
        # --force is for evaluations: a thesis is not to be lost by a mistyped name
        raise OutputError(
            f"{path} holds other things than an evaluation, and is not replaced even with --force;"
            " choose another name"
        )


def open_pairs_of(options: EvaluationOptions, checked: Done) -> tuple[PairList, Mapping[str, str]]:
    """Open the pairs that the options name, each looked at; tell what their protocol left open.

    Raises: InputError listing problems.
    """
    if options.protocol in (PEOPLE, FREE_PEOPLE):
        return held_out_pairs(options.limit or HELD_OUT_PAIRS, options.protocol_assets), {}
    common: dict[str, Any] = {
        "iuv_order": options.iuv_order,
        "limit": options.limit,
        "skip_broken": options.skip_broken,
        "done": checked,
    }
    if options.protocol == DEEPFASHION:
        assert options.images is not None
        return open_table1_pairs(options.images, options.pairs, **common)
    if options.clips is not None:
        return open_clip_pairs(options.clips, moments=options.moments, **common), {}
    assert options.pairs is not None
    return open_pairs(options.pairs, options.images, **common), {}


def _note_departures(
    options: EvaluationOptions, measures: Measures, notice: Callable[[str], None]
) -> None:
    """Tell where this run plainly is not the paper's; results files tell the rest."""
    if options.pairs is None:
        notice(
            "the paper's 176 pairs are not published: these are drawn from the folder; give others"
            " with --pairs"
        )
    for name in TABLE_1.better.keys() - {column.name for column in measures.columns}:
        lacks_weights = name == "lpips" and options.lpips_weights is None
        reason = "it needs --lpips-weights FILE" if lacks_weights else "--metrics leaves it out"
        notice(f"{name}, which the paper's table has, is not measured: {reason}")


def _check_results(
    folders: Sequence[ResultsFolder],
    pairs: PairList,
    options: EvaluationOptions,
    notice: Callable[[str], None],
) -> PairList:
    """Keep the pairs for which every folder has a usable picture: all methods get the same."""

    def find(pair: Pair) -> list[str]:
        found = [folder.find_problem(pair, options.framing) for folder in folders]
        return [problem for problem in found if problem]

    with ThreadPoolExecutor(options.worker_count) as pool:
        problems = list(pool.map(find, pairs))
    lines = [line for found in problems for line in found]
    if not lines:
        return pairs
    what = "results do not cover the pairs"
    if not options.skip_broken:
        raise InputError(*list_problems(what, lines))
    kept = [pair for pair, found in zip(pairs, problems, strict=True) if not found]
    if not kept:
        raise InputError(*list_problems(f"{what}, none of them", lines))
    notice(f"{len(kept)} of {len(pairs)} pairs are left, as results are missing: {lines[0]}, ...")
    # other pairs are another protocol, whose numbers are not compared with the whole list's
    digest = f"{pairs.digest} of which {','.join(pair.name for pair in kept)}"
    return PairList(pairs.name, kept, hashlib.sha256(digest.encode()).hexdigest())


def _write_sheet(
    path: Path, scorer: Scorer, results: Results, scored: Sequence[PairScores]
) -> None:
    """Draw pairs chosen by the first candidate's number that says most about looks."""
    columns = {column.name: column for column in results.columns}
    column = next((columns[name] for name in SHEET_ORDER if name in columns), results.columns[0])
    values = [entry.scores[0].get(column.name, math.nan) for entry in scored]
    chosen = [(word, scored[index]) for word, index in choose_rows(values, column.better)]
    drawn = scorer.pictures([entry.pair for _, entry in chosen])
    labels = [method.label for method in results.methods]
    write_png(path, draw_sheet(labels, column, chosen, drawn))


def _made_with(device: str | None) -> dict[str, str]:
    name = name_device(find_device(device))
    return {"motion-transfer": __version__, "torch": torch.__version__, "device": name}


def choose_rows(values: Sequence[float], better: str) -> list[tuple[str, int]]:
    """Choose the pairs to show, as (`worst`, `median` or `best`, index); each at most once.

    Pairs without a number (NaN) are not shown; where none has one, their own order counts.
    """
    known = [index for index, value in enumerate(values) if not np.isnan(value)]
    order = sorted(known, key=lambda index: values[index], reverse=better == "lower")
    order = order or list(range(len(values)))
    count = len(order)
    if count <= 3 * ROWS_EACH:
        third = -(-count // 3)
        words = ["worst"] * third + ["median"] * (count - 2 * third) + ["best"] * third
        return list(zip(words[:count], order, strict=True))
    starts = {"worst": 0, "median": (count - ROWS_EACH) // 2, "best": count - ROWS_EACH}
    return [
        (word, order[start + row]) for word, start in starts.items() for row in range(ROWS_EACH)
    ]


def draw_sheet(
    labels: Sequence[str],
    column: Column,
    chosen: Sequence[tuple[str, PairScores]],
    drawn: Sequence[PairPictures],
) -> Image:
    """Draw a heading over each column, then the chosen pairs, each under a line of its numbers."""
    parts = [_line(["source", "target", *labels])]
    for (word, entry), shown in zip(chosen, drawn, strict=True):
        numbers = [scores.get(column.name, math.nan) for scores in entry.scores]
        told = [f"{column.name} {number:.{column.decimals}f}" for number in numbers]
        source, target = _tail(entry.pair.source.name), _tail(entry.pair.target.name)
        parts.append(_line([f"{word}: {source}", target, *told]))
        pictures = (shown.source, shown.target.rgb, *shown.results)
        parts.append(_join([_thumbnail(picture) for picture in pictures]))
    return np.vstack(parts)


def _tail(name: str) -> str:
    """The end of a picture's name, which tells more than its beginning."""
    stem = flat_stem(name)
    return stem if len(stem) <= NAME_LENGTH else ".." + stem[-NAME_LENGTH:]


def _thumbnail(picture: Image) -> Image:
    scale = CELL_PX / max(picture.shape[:2])
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    if size != picture.shape[1::-1]:
        kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST  # shows the pixels as they are
        picture = cv2.resize(picture, size, interpolation=kind)
    cell = np.full((picture.shape[0], CELL_PX, 3), 255, np.uint8)
    left = (CELL_PX - picture.shape[1]) // 2
    cell[:, left : left + picture.shape[1]] = picture
    return cell


def _join(cells: Sequence[Image]) -> Image:
    gap = np.full((cells[0].shape[0], GAP_PX, 3), 255, np.uint8)
    return np.hstack([piece for cell in cells for piece in (cell, gap)])


def _line(words: Sequence[str]) -> Image:
    """A strip of text, a word over each column; what is too long is cut."""
    cells = []
    for word in words:
        cell = np.full((LINE_PX, CELL_PX, 3), 255, np.uint8)
        text = word.encode("ascii", "replace").decode()  # the font has no more
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(cell, text, (4, LINE_PX - 7), font, TEXT_SCALE, (0, 0, 0), 1, cv2.LINE_AA)
        cells.append(cell)
    return _join(cells)
