"""The methods that are compared: renderers, folders of other methods' pictures, the real frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol

from motion_transfer.drawing.backgrounds import make_background
from motion_transfer.drawing.canvas import draw_over
from motion_transfer.drawing.engines import ANYTHING, Wish
from motion_transfer.drawing.person import bounding_box
from motion_transfer.drawing.renderers import DEFAULT_RENDERER, RENDERERS
from motion_transfer.drawing.source import Source, SourcePicture, unfold_source
from motion_transfer.drawing.window import plan_window
from motion_transfer.errors import InputError
from motion_transfer.evaluation.framing import Framing, Image
from motion_transfer.evaluation.in_shop import spell_names
from motion_transfer.evaluation.options import EvaluationOptions
from motion_transfer.evaluation.result_names import PATTERNS, cut_result, fill_pattern
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.training.pairs import Pair
from motion_transfer.training.pictures import PersonPicture
from motion_transfer.weights import find_weights

Draw = Callable[[Pair, PersonPicture], Image]
"""Draws one source in a target's pose, as large as the target or of its aspect."""


class OpenedSource:
    """A source that several candidates draw: unfolded once for each size of texture."""

    def __init__(self, picture: PersonPicture) -> None:
        self.picture = picture
        self._prepared: dict[int, Source] = {}

    def prepare(self, texels: int) -> Source:
        """Prepare what renderers start from, with a texture of `texels` x `texels`."""
        if texels not in self._prepared:
            photo = self.picture.as_photo()
            shown = SourcePicture(photo, self.picture.iuv)
            self._prepared[texels] = unfold_source([shown], texels, photo.path)
        return self._prepared[texels]


class Candidate(Protocol):
    """A method under test.

    Attributes:
        label: Its name in tables.
        takes_turns: Whether it keeps the whole machine busy, so that calls wait for each other.
    """

    label: str
    takes_turns: bool

    def describe(self) -> dict[str, Any]:
        """Tell what it is, for the results file."""
        ...

    def open_source(self, source: OpenedSource, /) -> Draw:
        """Take in a source, and give the function that draws it."""
        ...


class RenderedCandidate:
    """What `mt run` would draw of the source in the target's pose and frame.

    Args:
        weights: Of the renderer; None: its default ones, or none.
        background: Behind the person, as `mt run` takes it.
        wish: How its network is to be run, where it has one.
    Raises: InputError for weights that cannot be used.
    """

    def __init__(
        self, renderer: str, weights: Path | None, background: str, wish: Wish = ANYTHING
    ) -> None:
        recipe = RENDERERS[renderer].recipe(weights, wish)
        recipe.make_ready(())  # now: what is wrong with a checkpoint is said before pairs are drawn
        self._recipe = recipe
        self._background = background
        self._kind, self.label = ("weights", weights.stem) if weights else ("renderer", renderer)
        self.takes_turns = recipe.occupies != "nothing"

    def describe(self) -> dict[str, Any]:
        facts = self._recipe.facts()
        return {"label": self.label, "kind": self._kind, "renderer": self._recipe.name, **facts}

    def open_source(self, source: OpenedSource) -> Draw:
        prepared = source.prepare(self._recipe.texture_size)
        renderer = self._recipe.renderer(self._recipe.appearance_of(prepared))

        def draw(_pair: Pair, target: PersonPicture) -> Image:
            size = (target.iuv.shape[0], target.iuv.shape[1])
            background = make_background(self._background, size, prepared, in_place=False)
            window = plan_window([bounding_box(target.iuv)])
            return draw_over(background, renderer, target.iuv, window)

        return draw


class ResultsFolder:
    """Pictures that another method made of the pairs; the naming is the pattern that finds most.

    Attributes:
        pattern: That naming, of `PATTERNS`.
    Raises: InputError if the folder is missing, or none of its pictures has a pair's name.
    """

    takes_turns = False

    def __init__(self, path: Path, pairs: Iterable[Pair]) -> None:
        if not path.is_dir():
            raise InputError(f"results {path} is not a folder")
        self.path, self.label = path, path.name
        self._files = {
            spell_names(file.name.removesuffix(file.suffix)): file
            for file in sorted(path.iterdir())
            if file.suffix.lower() in PHOTO_SUFFIXES
        }
        pairs = list(pairs)
        found = {
            pattern: sum(fill_pattern(pattern, pair) in self._files for pair in pairs)
            for pattern in PATTERNS
        }
        self.pattern = max(found, key=lambda pattern: found[pattern])
        if not found[self.pattern]:
            raise InputError(
                f"results {path}: none of its {len(self._files)} pictures belongs to a pair; the"
                f" first should be called {fill_pattern(self.pattern, pairs[0])}.png"
            )

    def find_problem(self, pair: Pair, framing: Framing) -> str | None:
        """Tell what is wrong with a pair's picture, if anything is."""
        name = fill_pattern(self.pattern, pair)
        if name not in self._files:
            return f"{self.path}/{name}.png does not exist"
        try:
            target = pair.target.load()
            size = self.read(pair, target).shape[1::-1]
            framing.check_aspect(size, target.rgb.shape[1::-1], f"result {self._files[name]}")
        except InputError as error:
            return str(error)
        return None

    def read(self, pair: Pair, target: PersonPicture) -> Image:
        """Read the picture of a pair, the last one where it is a strip. Raises: InputError."""
        picture = read_photo(self._files[fill_pattern(self.pattern, pair)], "result").rgb
        height, width = target.rgb.shape[:2]
        return cut_result(picture, PATTERNS[self.pattern], width / height)

    def describe(self) -> dict[str, Any]:
        return {
            "label": self.label,
            "kind": "results",
            "folder": self.path.name,
            "names": self.pattern,
        }

    def open_source(self, _source: OpenedSource) -> Draw:
        return self.read


class TargetCandidate:
    """The real frames: what a perfect method would score, and how much real clips flicker."""

    label = "real"
    takes_turns = False

    def describe(self) -> dict[str, Any]:
        return {"label": self.label, "kind": "target"}

    def open_source(self, _source: OpenedSource) -> Draw:
        return lambda _pair, target: target.rgb


def open_candidates(
    options: EvaluationOptions, folders: Sequence[ResultsFolder]
) -> list[Candidate]:
    """Open the candidates that options name, the folders among them opened already.

    Raises: InputError for weights that cannot be used, or if something is given twice.
    """
    weights, wish = (
        [find_weights(path) for path in options.weights],
        Wish(precision=options.precision, device=options.device),
    )
    candidates: list[Candidate] = [
        *(RenderedCandidate(DEFAULT_RENDERER, path, options.background, wish) for path in weights),
        *folders,
    ]
    make_labels_unique(candidates, [*weights, *options.results])
    if options.renderer is not None:
        candidates.append(RenderedCandidate(options.renderer, None, options.background))
    if options.clips is not None:  # real clips flicker, too
        candidates.append(TargetCandidate())
    return candidates


def make_labels_unique(candidates: Sequence[Candidate], origins: Sequence[Path]) -> None:
    """Name candidates of equal label by their folders too.

    Raises: InputError if the same file or folder was given twice.
    """
    resolved = [path.resolve() for path in origins]
    for path, own in zip(origins, resolved, strict=True):
        if resolved.count(own) > 1:
            raise InputError(f"{path} is given twice")
    labels = [candidate.label for candidate in candidates]
    for candidate, own in zip(candidates, resolved, strict=True):
        if labels.count(candidate.label) > 1:
            candidate.label = f"{own.parent.name}/{candidate.label}"
