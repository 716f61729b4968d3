"""A folder of pictures that another method made for the same pairs, however it named them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path, PurePosixPath

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.evaluation.framing import Framing
from motion_transfer.media.image import read_photo
from motion_transfer.training.pairs import Pair, flat_stem

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".bmp")


def _stems(pair: Pair) -> tuple[str, str]:
    return flat_stem(pair.source.name), flat_stem(pair.target.name)


def _files(pair: Pair) -> tuple[str, str]:
    source, target = (PurePosixPath(picture.name) for picture in (pair.source, pair.target))
    return source.name, target.name


PATTERNS: dict[str, Callable[[Pair], str]] = {
    "SOURCE__TARGET": lambda pair: "__".join(_stems(pair)),
    "SOURCE___TARGET": lambda pair: "___".join(_stems(pair)),
    "SOURCE___TARGET_vis": lambda pair: "___".join(_stems(pair)) + "_vis",
    "SOURCE_2_TARGET": lambda pair: "_2_".join(_stems(pair)),
    "SOURCE_2_TARGET_vis": lambda pair: "_2_".join(_stems(pair)) + "_vis",
    "SOURCE.jpg___TARGET.jpg": lambda pair: "___".join(_files(pair)),
    "SOURCE.jpg___TARGET.jpg_vis": lambda pair: "___".join(_files(pair)) + "_vis",
}
"""File names without their ending. This program's own first; then those of the published code of
Siarohin et al., Zhu et al. (PATN) and Ren et al. (GFLA). Where a name held folders, `-` joins them;
the last two keep the ending of each picture in the pair list."""


class ResultsFolder:
    """Finds each pair's picture; the naming is the pattern that finds most.

    Attributes:
        pattern: that naming, of `PATTERNS`.

    Raises: InputError if the folder is missing, or none of its pictures has a pair's name.
    """

    def __init__(self, path: Path, pairs: Iterable[Pair]) -> None:
        if not path.is_dir():
            raise InputError(f"results {path} is not a folder")
        self.path = path
        self._files = {
            file.name.removesuffix(file.suffix): file
            for file in sorted(path.iterdir())
            if file.suffix.lower() in PICTURE_SUFFIXES
        }
        pairs = list(pairs)
        found = {
            name: sum(rule(pair) in self._files for pair in pairs)
            for name, rule in PATTERNS.items()
        }
        self.pattern = max(found, key=lambda name: found[name])
        self._rule = PATTERNS[self.pattern]
        if not found[self.pattern]:
            raise InputError(
                f"results {path}: none of its {len(self._files)} pictures belongs to a pair; the"
                f" first should be called {self._rule(pairs[0])}.png"
            )

    def find_problem(self, pair: Pair, framing: Framing) -> str | None:
        """What is wrong with a pair's picture, if anything is."""
        if self._rule(pair) not in self._files:
            return f"{self.path}/{self._rule(pair)}.png does not exist"
        try:
            picture = self.read(pair)
            height, width = pair.target.load().rgb.shape[:2]
            framing.check_aspect(
                (picture.shape[1], picture.shape[0]),
                (width, height),
                f"result {self._files[self._rule(pair)]}",
            )
        except InputError as error:
            return str(error)
        return None

    def read(self, pair: Pair) -> UInt8[np.ndarray, "H W 3"]:
        """The picture of a pair. Raises: InputError."""
        return read_photo(self._files[self._rule(pair)], "result").rgb
