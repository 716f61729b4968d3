"""Every candidate's picture of every pair, scored."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Self, TypeVar

import numpy as np
from jaxtyping import Float, UInt8

from motion_transfer.errors import RenderError
from motion_transfer.evaluation.candidates import Candidate, OpenedSource
from motion_transfer.evaluation.choice import Measures
from motion_transfer.evaluation.framing import Framing, TargetFrame
from motion_transfer.evaluation.measures import Scores
from motion_transfer.media.image import write_png
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.training.pairs import Pair, PairSource
from motion_transfer.training.pictures import PersonPicture

Image = UInt8[np.ndarray, "H W 3"]
T = TypeVar("T")


@dataclass(frozen=True)
class PairPictures:
    """One pair as it is compared: everything at the framing's size."""

    source: Image
    target: TargetFrame
    results: list[Image]


@dataclass(frozen=True)
class PairScores:
    """The numbers of one pair, for each candidate in order.

    Attributes:
        features: FID's vectors, the target's first, where FID is measured.
    """

    pair: Pair
    scores: list[Scores]
    features: list[Float[np.ndarray, " D"]]


class StoppedError(Exception):
    """A worker gives up because the evaluation is being stopped."""


class Scorer:
    """Renders and scores pairs with several threads; a context, as it owns them.

    Networks take turns on one thread of their own: torch keeps a team of threads for each thread
    that calls it, and teams that wait for work take the cores from the one that has some.

    Args:
        save: a folder for every result, `LABEL/SOURCE__TARGET.png`.
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
        self, pairs: PairSource, done: Callable[[int], None] = lambda _count: None
    ) -> list[PairScores]:
        """Score all pairs, in their order whatever the number of threads.

        Args:
            done: called with how many more pairs are finished.
        Raises: RenderError naming candidate and pair; InputError for a file that broke meanwhile.
        """
        runs = [
            list(run) for _, run in groupby(pairs, key=lambda pair: (pair.group, pair.source.name))
        ]
        scored: list[PairScores] = []
        for part in self._pool.map(lambda run: self._score_run(run, done), runs):
            scored += part
        return scored

    def pictures(self, pairs: Sequence[Pair]) -> list[PairPictures]:
        """Some pairs' pictures, the same as were scored; each source is prepared once."""
        runs: dict[str, list[int]] = {}
        for index, pair in enumerate(pairs):
            runs.setdefault(pair.source.name, []).append(index)
        drawn: dict[int, PairPictures] = {}
        for run in runs.values():
            found = self._draw_run([pairs[index] for index in run])
            drawn |= zip(run, found, strict=True)
        return [drawn[index] for index in range(len(pairs))]

    def _score_run(self, run: list[Pair], done: Callable[[int], None]) -> list[PairScores]:
        """Pairs with one source, which is prepared once."""
        scored = []
        before: tuple[Pair, PairPictures] | None = None
        for pair, pictures in zip(run, self._draw_run(run), strict=True):
            scores: list[Scores] = [{} for _ in self._candidates]
            for measure in self._measures.each:
                found = self._turn(
                    measure.takes_turns,
                    lambda m=measure, p=pictures: m.measure(p.results, p.target),
                )
                _merge(scores, found)
            if self._measures.flicker is not None and before is not None:
                last, shown = before
                if last.frame is not None and pair.frame == last.frame + 1:
                    _merge(
                        scores,
                        self._measures.flicker.measure(
                            shown.results, shown.target, pictures.results, pictures.target
                        ),
                    )
            scored.append(PairScores(pair, scores, self._features(pictures)))
            before = pair, pictures
            self._keep(pair, pictures)
            done(1)
        return scored

    def _features(self, pictures: PairPictures) -> list[Float[np.ndarray, " D"]]:
        fid = self._measures.fid
        if fid is None:
            return []
        images = [pictures.target.rgb, *pictures.results]
        return self._turn(fid.takes_turns, lambda: fid.features(images))

    def _draw_run(self, run: list[Pair]) -> Iterator[PairPictures]:
        source = OpenedSource(run[0].source.load())
        artists = [
            self._attempt(candidate, run[0], lambda c=candidate: c.open_source(source))
            for candidate in self._candidates
        ]
        shown = self._framing.fit(source.picture.rgb)
        for pair in run:
            if self._stop.is_set():
                raise StoppedError
            target: PersonPicture = pair.target.load()
            results = [
                self._framing.fit(
                    self._attempt(candidate, pair, lambda d=draw, p=pair, t=target: d(p, t))
                )
                for candidate, draw in zip(self._candidates, artists, strict=True)
            ]
            yield PairPictures(shown, self._framing.fit_target(target), results)

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


def _merge(scores: list[Scores], more: list[Scores]) -> None:
    for own, added in zip(scores, more, strict=True):
        own.update(added)
