"""The methods that are compared: a renderer of ours with some weights, or pictures of another's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.evaluation.results_folder import ResultsFolder
from motion_transfer.media.work import digest_of
from motion_transfer.render.compose import make_background, paste
from motion_transfer.render.outline import clearance_of
from motion_transfer.render.person import Person, occupancy
from motion_transfer.render.renderer import Renderer
from motion_transfer.render.source import Source, unfold
from motion_transfer.render.window import plan_window
from motion_transfer.training.pairs import Pair
from motion_transfer.training.pictures import PersonPicture
from nhrr_core.iuv import ALL_PARTS

Image = UInt8[np.ndarray, "H W 3"]
Draw = Callable[[Pair, PersonPicture], Image]

TEXTURE_TEXELS = 256


class OpenedSource:
    """A source that several candidates draw: unfolded once for each size of texture."""

    def __init__(self, picture: PersonPicture) -> None:
        self.picture = picture
        self._photo = picture.as_photo()
        self._prepared: dict[int, Source] = {}

    def prepare(self, texels: int) -> Source:
        """What renderers start from, with a texture of `texels` x `texels`."""
        if texels not in self._prepared:
            photo, iuv = self._photo, self.picture.iuv
            texture = unfold(photo, iuv, ALL_PARTS, texels)
            clearance = clearance_of(photo, iuv, ALL_PARTS)
            self._prepared[texels] = Source(photo, iuv, photo.path, *texture, clearance=clearance)
        return self._prepared[texels]


class Candidate(Protocol):
    """A method under test.

    Attributes:
        label: its name in tables.
        takes_turns: it keeps the whole machine busy, so calls wait for each other.
    """

    label: str
    takes_turns: bool

    def describe(self) -> dict[str, Any]:
        """What it is, for the results file."""
        ...

    def open_source(self, source: OpenedSource, /) -> Draw:
        """Take in a source; what comes back draws it in a target's pose, as large as the target
        or of its aspect."""
        ...


class RenderedCandidate:
    """What `mt run` would draw of the source in the target's pose and frame."""

    def __init__(
        self, label: str, *, texture_size: int, takes_turns: bool, background: str
    ) -> None:
        self.label = label
        self.takes_turns = takes_turns
        self._texture_size = texture_size
        self._background = background

    def describe(self) -> dict[str, Any]:
        raise NotImplementedError

    def open_renderer(self, source: Source) -> Renderer:
        """The renderer of one source."""
        raise NotImplementedError

    def open_source(self, source: OpenedSource) -> Draw:
        prepared = source.prepare(self._texture_size)
        renderer = self.open_renderer(prepared)

        def draw(_pair: Pair, target: PersonPicture) -> Image:
            size = (target.iuv.shape[0], target.iuv.shape[1])
            frame = make_background(self._background, size, prepared, in_place=False)
            x, y, width, height = cv2.boundingRect(occupancy(target.iuv))
            person = Person(x, y, x + width, y + height, pixels=0, regions=())
            window = plan_window([person])
            crop = window.cut(target.iuv, renderer.working_size(window.side))
            paste(frame, renderer.render(crop[None])[0], window)
            return frame

        return draw


class TextureCandidate(RenderedCandidate):
    """The renderer without a network: the baseline that every network should beat."""

    def __init__(self, background: str) -> None:
        super().__init__(
            "texture", texture_size=TEXTURE_TEXELS, takes_turns=False, background=background
        )

    def describe(self) -> dict[str, Any]:
        return {"label": self.label, "kind": "renderer", "renderer": "texture"}

    def open_renderer(self, source: Source) -> Renderer:
        from motion_transfer.render.texture_renderer import TextureRenderer, tabulate_texture

        return TextureRenderer(tabulate_texture(source))


class WeightsCandidate(RenderedCandidate):
    """The network with one checkpoint. Raises: WeightsError."""

    def __init__(self, path: Path, background: str) -> None:
        from motion_transfer.render.neural_renderer import PreparedNetwork
        from motion_transfer.weights.checkpoint import load_checkpoint
        from motion_transfer.weights.shipped import find_weights

        path = find_weights(path)
        self._model = load_checkpoint(path)
        self._network = PreparedNetwork(self._model, compile=False)
        self._path = path
        super().__init__(
            path.stem,
            texture_size=self._model.config.finest_texture,
            takes_turns=True,
            background=background,
        )

    def describe(self) -> dict[str, Any]:
        return {
            "label": self.label,
            "kind": "weights",
            "renderer": "nhrr",
            "file": self._path.name,
            "sha256": digest_of(self._path),
            "configuration": self._model.config.to_dict(),
        }

    def open_renderer(self, source: Source) -> Renderer:
        from motion_transfer.render.neural_renderer import NeuralRenderer, encode_source

        return NeuralRenderer(self._network, encode_source(self._model, source))


class FolderCandidate:
    """Pictures that another method made."""

    takes_turns = False

    def __init__(self, folder: ResultsFolder) -> None:
        self.label = folder.path.name
        self._folder = folder

    def describe(self) -> dict[str, Any]:
        return {
            "label": self.label,
            "kind": "results",
            "folder": self._folder.path.name,
            "names": self._folder.pattern,
        }

    def open_source(self, _source: OpenedSource) -> Draw:
        return lambda pair, _target: self._folder.read(pair)


class TargetCandidate:
    """The real frames: what a perfect method would score, and how much real clips flicker."""

    label = "real"
    takes_turns = False

    def describe(self) -> dict[str, Any]:
        return {"label": self.label, "kind": "target"}

    def open_source(self, _source: OpenedSource) -> Draw:
        return lambda _pair, target: target.rgb


def make_labels_unique(candidates: Sequence[Candidate], origins: Sequence[Path]) -> None:
    """Name candidates of equal label by their folders too.

    Raises: InputError if the same file or folder was given twice.
    """
    if len({path.resolve() for path in origins}) < len(origins):
        twice = next(p for p in origins if [q.resolve() for q in origins].count(p.resolve()) > 1)
        raise InputError(f"{twice} is given twice")
    labels = [candidate.label for candidate in candidates]
    for candidate, origin in zip(candidates, origins, strict=True):
        if labels.count(candidate.label) > 1:
            candidate.label = f"{origin.resolve().parent.name}/{candidate.label}"
