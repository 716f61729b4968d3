"""Pairs of synthetic people who are made when they are asked for, without end."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import version
from typing import overload

from motion_transfer.people.dataset import PeopleStream, Split
from motion_transfer.people.extra import require_people
from motion_transfer.people.person import DressedPerson
from motion_transfer.people.picture.iuv_noise import IuvNoise
from motion_transfer.training.pairs import Pair, PairList
from motion_transfer.training.pictures import PersonPicture
from motion_transfer.version import __version__

ENOUGH = 2**31
HELD_OUT_SEED, HELD_OUT_SIZE = 2020, (256, 256)
DRAWN_BY = ("anny", "warp-lang", "numpy", "opencv-contrib-python-headless")
"""Packages whose versions decide, with ours, what people look like."""


@dataclass(frozen=True, kw_only=True)
class StreamedPairs(Sequence[Pair]):
    """Pair n shows person n, first as source, then as target. Raises: InputError without the extra.

    Attributes:
        endless: more pairs than any run takes.
    """

    seed: int
    size: tuple[int, int]
    noise: float
    split: Split = "train"
    endless: bool = True

    def __post_init__(self) -> None:
        require_people()

    def __len__(self) -> int:
        return ENOUGH

    @overload
    def __getitem__(self, index: int) -> Pair: ...
    @overload
    def __getitem__(self, index: slice) -> list[Pair]: ...
    def __getitem__(self, index: int | slice) -> Pair | list[Pair]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(ENOUGH))]
        if not 0 <= index < ENOUGH:
            raise IndexError(index)
        source, target = (StreamedPhoto(self, index, view) for view in (0, 1))
        return Pair(source, target, group=str(index))


def held_out_pairs(count: int) -> PairList:
    """The built-in set for evaluation: people of the split that training never draws from.

    Its digest stands for the pixels without drawing them: everything follows from the seed, the
    count and the versions of what draws.
    Raises: InputError without the extra.
    """
    people = StreamedPairs(
        seed=HELD_OUT_SEED, size=HELD_OUT_SIZE, noise=0.0, split="held-out", endless=False
    )
    made_of = [HELD_OUT_SEED, HELD_OUT_SIZE, count, __version__, *map(version, DRAWN_BY)]
    digest = hashlib.sha256(repr(made_of).encode()).hexdigest()
    return PairList("people (held-out)", people[:count], digest)


@dataclass(frozen=True)
class StreamedPhoto:
    """One photo of one of them."""

    people: StreamedPairs
    number: int
    view: int

    @property
    def name(self) -> str:
        return f"{self.number:06d}/{self.view}.png"

    def load(self) -> PersonPicture:
        """Take it; the same bytes each time."""
        stream = _stream(self.people)
        photo = stream.take(_dress(self.people, self.number), stream.shot(self.number, self.view))
        return PersonPicture(self.name, photo.rgb, photo.iuv, photo.alpha)


@cache
def _stream(people: StreamedPairs) -> PeopleStream:
    """Made where it is used: the body model does not travel to other processes."""
    noise = IuvNoise.densepose() if people.noise else None
    return PeopleStream(
        seed=people.seed,
        split=people.split,
        size=people.size,
        noise=noise,
        noisy_share=people.noise,
    )


@lru_cache(maxsize=8)  # both photos of a pair, in each of several threads
def _dress(people: StreamedPairs, number: int) -> DressedPerson:
    return _stream(people).dress(number)
