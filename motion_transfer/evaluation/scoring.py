"""Every candidate's picture of every pair, scored."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Self, TypeVar

from motion_transfer.errors import RenderError
from motion_transfer.evaluation.candidates import Candidate, OpenedSource
from motion_transfer.evaluation.framing import Framing, PairPictures
from motion_transfer.evaluation.measures import Features, Measures
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.training.pairs import Pair, PairList

T = TypeVar("T")


@dataclass(frozen=True)
class PairScores:
    """The numbers of one pair.

    Attributes:
        scores: For each candidate in order: its numbers by column; NaN where there is none.
        features: For each measure of sets: what it keeps of the target, then of each result.
    """

    pair: Pair
    scores: list[dict[str, float]]
    features: list[list[Features]]


class StoppedError(Exception):
    """A worker gives up because the evaluation is being stopped."""


class Scorer:
    """Renders and scores pairs with several threads; a context, as it owns them.

    Networks take turns on one thread of their own: torch keeps a team of threads for each thread
    that calls it, and teams that wait for work take the cores from the one that has some.

    Args:
        save: A folder for every result, `LABEL/SOURCE__TARGET.png`.
    """

    def __init__(
        self,
        candidates: Sequence[Candidate],
        measures: Measures,
        framing: Framing,
        *,
        workers: int,
        save: Path | None = None,
    ) -> None:
        self._candidates = candidates
        self._measures = measures
        self._framing = framing
        self._save = save
        self._turns = ThreadPoolExecutor(1, thread_name_prefix="network")
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="pairs")
        self._stop = threading.Event()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._stop.set()
        for pool in (self._pool, self._turns):
            pool.shutdown(wait=True, cancel_futures=True)

    def score(
        self, pairs: PairList, done: Callable[[int], None] = lambda _count: None
    ) -> list[PairScores]:
        """Score all pairs, in their order whatever the number of threads.

        Args:
            done: Called with how many more pairs are finished.
        Raises: RenderError naming candidate and pair; InputError for a file that broke meanwhile.
        """
        runs = [
            list(run) for _, run in groupby(pairs, key=lambda pair: (pair.group, pair.source.name))
        ]
        parts = self._pool.map(lambda run: self._score_run(run, done), runs)
        return [entry for part in parts for entry in part]

    def pictures(self, pairs: Sequence[Pair]) -> list[PairPictures]:
        """Draw some pairs again, the same as were scored; each source is prepared once."""
        runs: dict[str, list[int]] = {}
        for index, pair in enumerate(pairs):
            runs.setdefault(pair.source.name, []).append(index)
        drawn: dict[int, PairPictures] = {}
        for run in runs.values():
            drawn |= zip(run, self._draw_run([pairs[index] for index in run]), strict=True)
        return [drawn[index] for index in range(len(pairs))]

    def _score_run(self, run: list[Pair], done: Callable[[int], None]) -> list[PairScores]:
        """Score pairs with one source, which is prepared once."""
        scored: list[PairScores] = []
        before: PairPictures | None = None
        for pair, shown in zip(run, self._draw_run(run), strict=True):
            # the moments of a clip lie apart: only two frames in a row flicker
            frame = scored[-1].pair.frame if scored else None
            follows = frame is not None and pair.frame == frame + 1
            scores = self._measure(shown, before if follows else None)
            images = [shown.target.rgb, *shown.results]
            features = [
                self._turn(measure.takes_turns, partial(measure.features, images))
                for measure in self._measures.sets
            ]
            scored.append(PairScores(pair, scores, features))
            before = shown
            self._keep(pair, shown)
            done(1)
        return scored

    def _measure(self, shown: PairPictures, before: PairPictures | None) -> list[dict[str, float]]:
        scores: list[dict[str, float]] = [{} for _ in shown.results]
        for measure in self._measures.pairs:
            names = [column.name for column in measure.columns]
            found = self._turn(measure.takes_turns, partial(measure.measure, shown, before))
            for own, numbers in zip(scores, found, strict=True):
                own.update(zip(names, numbers, strict=True))
        return scores

    def _draw_run(self, run: list[Pair]) -> Iterator[PairPictures]:
        source = OpenedSource(run[0].source.load())
        artists = [
            self._attempt(candidate, run[0], partial(candidate.open_source, source))
            for candidate in self._candidates
        ]
        photo, iuv = source.picture.rgb, source.picture.iuv
        shown = self._framing.fit(photo), self._framing.fit_iuv(iuv)
        for pair in run:
            if self._stop.is_set():
                raise StoppedError
            target = pair.target.load()
            results = [
                self._framing.fit(self._attempt(candidate, pair, partial(draw, pair, target)))
                for candidate, draw in zip(self._candidates, artists, strict=True)
            ]
            yield PairPictures(*shown, self._framing.fit_target(target), results)

    def _attempt(self, candidate: Candidate, pair: Pair, call: Callable[[], T]) -> T:
        try:
            return self._turn(candidate.takes_turns, call)
        except (RuntimeError, MemoryError) as error:  # what torch raises, out of memory too
            raise RenderError(f"{candidate.label} failed on {pair.name}: {error}") from error

    def _turn(self, takes_turns: bool, call: Callable[[], T]) -> T:
        return self._turns.submit(call).result() if takes_turns else call()

    def _keep(self, pair: Pair, pictures: PairPictures) -> None:
        if self._save is None:
            return
        with explain_disk_errors(self._save):
            for candidate, result in zip(self._candidates, pictures.results, strict=True):
                folder = self._save / candidate.label.replace("/", "-")
                folder.mkdir(parents=True, exist_ok=True)
                write_png(folder / f"{pair.name}.png", result)
