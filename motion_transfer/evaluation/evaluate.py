"""One evaluation from options to a finished folder: what `mt eval` calls."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import torch

from motion_transfer.errors import InputError, OutputError
from motion_transfer.evaluation.candidates import (
    Candidate,
    FolderCandidate,
    TargetCandidate,
    TextureCandidate,
    WeightsCandidate,
    make_labels_unique,
)
from motion_transfer.evaluation.choice import Measures
from motion_transfer.evaluation.framing import MASK_RULE, RESIZE_FILTER, Framing
from motion_transfer.evaluation.protocol import Protocol, package_versions
from motion_transfer.evaluation.report import Method, Results, scores_csv
from motion_transfer.evaluation.results_folder import ResultsFolder
from motion_transfer.evaluation.scoring import PairScores, Scorer
from motion_transfer.evaluation.sheet import SheetRow, choose_rows, draw_sheet
from motion_transfer.evaluation.summary import Summary, summarise
from motion_transfer.media.image import write_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.training.pairs import Pair, PairList, PairSource, list_problems
from motion_transfer.version import __version__

RESULTS_FILE, SCORES_FILE, SHEET_FILE, IMAGES_FOLDER = (
    "results.json",
    "scores.csv",
    "sheet.png",
    "images",
)
SHEET_ORDER = ("efficientnet-lite0", "lpips", "ssim", "psnr", "l1")

DEFAULT_FRAMING = Framing()

Done = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class EvaluationOptions:
    """What to compare, and where to write it.

    Attributes:
        output: folder for `results.json`, `scores.csv`, `sheet.png`.
        weights: checkpoints; texture: the renderer without a network as well.
        results: folders of pictures that other methods made.
        save_images: write every result to `images/LABEL/SOURCE__TARGET.png`.
        force: replace the folder of an earlier evaluation.
        skip_broken: leave out pairs for which a results folder has no usable picture.
        workers: threads; None: one for each core. Never changes a number.
    """

    output: Path
    framing: Framing = DEFAULT_FRAMING
    weights: tuple[Path, ...] = ()
    texture: bool = False
    results: tuple[Path, ...] = ()
    save_images: bool = False
    force: bool = False
    skip_broken: bool = False
    workers: int | None = None

    def __post_init__(self) -> None:
        if not (self.weights or self.texture or self.results):
            raise InputError(
                "nothing to evaluate; give --weights FILE, --renderer texture or --results FOLDER"
            )
        if self.workers is not None and self.workers < 1:
            raise InputError(f"workers is {self.workers}; it must be at least 1")

    @property
    def worker_count(self) -> int:
        return self.workers or len(os.sched_getaffinity(0))


def evaluate(
    options: EvaluationOptions,
    pairs: PairSource,
    measures: Measures,
    *,
    has_clips: bool = False,
    notice: Callable[[str], None] = lambda _words: None,
    done: Done = lambda _count, _total: None,
) -> Results:
    """Score every candidate on the same pairs and write the folder.

    Args:
        has_clips: the pairs are frames of clips; the real frames join as a candidate, as real
            clips flicker too.
        notice: told of pairs that were left out.
        done: called with how many more pairs of how many are finished.
    Raises: InputError, OutputError before scoring where it can be known; RenderError. Whatever
        happens nothing half-written stays behind and an earlier folder is untouched.
    """
    check_output(options.output, force=options.force)
    folders = [ResultsFolder(path, pairs) for path in options.results]
    pairs = _check_results(folders, pairs, options, notice)
    candidates = _open_candidates(options, folders)
    if has_clips:
        candidates.append(TargetCandidate())
    with work_folder(options.output) as folder:
        finished = folder / "finished"
        finished.mkdir()
        save = finished / IMAGES_FOLDER if options.save_images else None
        with Scorer(
            candidates, measures, options.framing, workers=options.worker_count, save=save
        ) as scorer:
            scored = scorer.score(pairs, lambda count: done(count, len(pairs)))
            results = Results(
                _protocol(options.framing, pairs, measures),
                measures.columns,
                tuple(_summarise(candidates, measures, scored)),
            )
            _write_sheet(finished / SHEET_FILE, scorer, results, scored)
        (finished / RESULTS_FILE).write_text(results.to_json(_made_with()))
        labels = [candidate.label for candidate in candidates]
        (finished / SCORES_FILE).write_text(scores_csv(scored, measures.columns, labels))
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
        raise OutputError(
            f"{path} holds other things than an evaluation, and is not replaced even with --force;"
            " choose another name"
        )


def _check_results(
    folders: Sequence[ResultsFolder],
    pairs: PairSource,
    options: EvaluationOptions,
    notice: Callable[[str], None],
) -> PairSource:
    """The pairs for which every folder has a usable picture: all methods get the same pairs."""
    if not folders:
        return pairs

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
        raise InputError(list_problems(what, lines))
    kept = [pair for pair, found in zip(pairs, problems, strict=True) if not found]
    if not kept:
        raise InputError(list_problems(f"{what}, none of them", lines))
    notice(f"{len(kept)} of {len(pairs)} pairs are left, as results are missing: {lines[0]}, ...")
    digest = f"{pairs.digest} of which {','.join(pair.name for pair in kept)}"
    return PairList(pairs.name, kept, hashlib.sha256(digest.encode()).hexdigest())


def _open_candidates(
    options: EvaluationOptions, folders: Sequence[ResultsFolder]
) -> list[Candidate]:
    background = options.framing.background
    given: list[Candidate] = [WeightsCandidate(path, background) for path in options.weights]
    given += [FolderCandidate(folder) for folder in folders]
    make_labels_unique(given, [*options.weights, *options.results])
    texture: list[Candidate] = [TextureCandidate(background)] if options.texture else []
    return [*given, *texture]


def _protocol(framing: Framing, pairs: PairSource, measures: Measures) -> Protocol:
    return Protocol(
        resolution=f"{framing.width}x{framing.height}",
        resize_filter=RESIZE_FILTER,
        padding="centred, #{:02x}{:02x}{:02x}".format(*framing.padding),
        background=framing.background_rule,
        mask=MASK_RULE,
        pairs_name=pairs.name,
        pairs_count=len(pairs),
        pairs_sha256=pairs.digest,
        metrics={column.name: column.definition for column in measures.columns},
        packages=package_versions(measures.packages),
    )


def _summarise(
    candidates: Sequence[Candidate], measures: Measures, scored: Sequence[PairScores]
) -> list[Method]:
    groups = [entry.pair.group for entry in scored]
    methods = []
    for number, candidate in enumerate(candidates):
        scores = {}
        for column in measures.columns:
            values = [entry.scores[number].get(column.name, math.nan) for entry in scored]
            scores[column.name] = summarise(values, groups)
        if measures.fid is not None:
            distance = measures.fid.distance(
                [entry.features[number + 1] for entry in scored],
                [entry.features[0] for entry in scored],
            )
            scores["fid"] = Summary(distance, None, None, len(scored))
        methods.append(Method(candidate.label, candidate.describe(), scores))
    return methods


def _write_sheet(
    path: Path, scorer: Scorer, results: Results, scored: Sequence[PairScores]
) -> None:
    """Pairs in the order of the first candidate's number that says most about looks."""
    columns = {column.name: column for column in results.columns}
    column = next((columns[name] for name in SHEET_ORDER if name in columns), results.columns[0])
    values = [entry.scores[0].get(column.name, math.nan) for entry in scored]
    if all(math.isnan(value) for value in values):  # only a number of the whole set was measured
        values = [0.0] * len(scored)
    chosen = [(word, scored[index]) for word, index in choose_rows(values, column.better)]
    drawn = scorer.pictures([entry.pair for _, entry in chosen])
    rows = []
    for (word, entry), pictures in zip(chosen, drawn, strict=True):
        numbers = [scores.get(column.name, math.nan) for scores in entry.scores]
        words = [f"{column.name} {number:.{column.decimals}f}" for number in numbers]
        rows.append(SheetRow(word, entry.pair, pictures, words))
    write_png(path, draw_sheet([method.label for method in results.methods], rows))


def _made_with() -> dict[str, str]:
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu"
    return {"motion-transfer": __version__, "torch": torch.__version__, "device": device}
