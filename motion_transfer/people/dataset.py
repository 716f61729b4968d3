"""People by number, and pairs of photos of them for training, made as they are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from motion_transfer.errors import InputError
from motion_transfer.people.figure.body import load_body_model, one_thread
from motion_transfer.people.figure.camera import Framing
from motion_transfer.people.free.assets import check_share, load_assets
from motion_transfer.people.free.person import FreePerson, sample_free_person
from motion_transfer.people.person import DressedPerson, Person, sample_person
from motion_transfer.people.photo import PersonPhoto, Shot, sample_shot, take_photo
from motion_transfer.people.picture.iuv_noise import IuvNoise

Split = Literal["train", "held-out"]
SPLITS: tuple[str, ...] = get_args(Split)
"""Two streams of people that never meet, whatever the seed."""


def check_numbering(seed: int, split: str) -> None:
    """Raise InputError for a seed or a split by which no people are numbered."""
    if split not in SPLITS:
        raise InputError(f"split {split!r}; supported are {', '.join(SPLITS)}")
    if seed < 0:
        raise InputError(f"seed is {seed}; it must be 0 or more")


class PeopleStream:
    """People by number: the same seed, split and number always give the same bytes.

    Args:
        size: (width, height) of the photos in px.
        noise: Faults of DensePose to put into the IUV; None: exact.
        noisy_share: The share of the photos that get them.
        framing: What the photos show of the body; None: mixed.
        assets: Folder of MakeHuman's assets, which free people wear; None: there are none of them.
        free_share: Of free people among all, 0 to 1; None: a half where there are assets.
    Raises: InputError for assets that cannot be used, or a share without them.
    """

    def __init__(
        self,
        *,
        seed: int = 0,
        split: Split = "train",
        size: tuple[int, int] = (256, 256),
        noise: IuvNoise | None = None,
        noisy_share: float = 1.0,
        framing: Framing | None = None,
        assets: Path | None = None,
        free_share: float | None = None,
    ) -> None:
        check_numbering(seed, split)
        self._free_share = check_share(free_share, assets)
        self._assets = load_assets(assets) if assets else None
        self.size = size
        self._entropy = (seed, SPLITS.index(split))
        self._held_out = split == "held-out"
        self._noise, self._noisy_share = noise, noisy_share
        self._framing: Framing | None = framing
        self.model = load_body_model()

    def person(self, number: int) -> Person | FreePerson:
        """Sample who has that number."""
        if self._assets:
            # a stream of its own: whoever is no free person is who would have been without assets
            free = np.random.default_rng((*self._entropy, number, 0, 1))
            if free.random() < self._free_share:
                return sample_free_person(free, self._assets, held_out=self._held_out)
        return sample_person(self._random(number, 0))

    def shot(self, number: int, view: int) -> Shot:
        """Sample how that person is photographed for the given time (0 first)."""
        return sample_shot(self._random(number, 1 + view), framing=self._framing)

    def dress(self, number: int) -> DressedPerson:
        """Build the geometry of that person."""
        with one_thread():
            return DressedPerson(self.person(number), self.model)

    def take(self, dressed: DressedPerson, shot: Shot) -> PersonPhoto:
        """Take a photo of a dressed person."""
        # a stream of its own, so that the share decides about nothing but who gets noise
        noisy = np.random.default_rng((shot.seed, 1)).random() < self._noisy_share
        noise = self._noise if noisy else None
        with one_thread():
            return take_photo(dressed, shot, self.size, noise)

    def _random(self, number: int, purpose: int) -> np.random.Generator:
        return np.random.default_rng((*self._entropy, number, purpose))


class PeopleDataset(Dataset):
    """Pairs (source, target): one person, two poses, made without touching the disk.

    Indexable, so that samplers, several workers and resumed runs see the same pairs.

    Args:
        length: The number of pairs; each has a person of its own.
        **settings: Those of `PeopleStream`.
    """

    def __init__(self, length: int, **settings) -> None:
        if length < 1:
            raise InputError(f"length is {length}; a data set needs at least 1 pair")
        self._length = length
        self._settings = settings
        self._stream: PeopleStream | None = None

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: int) -> dict[str, Tensor]:
        """Make one pair.

        Returns: For `source` and `target` each: `_image` float 3 x H x W in [-1, 1], `_iuv` uint8
            3 x H x W (I, U, V), `_alpha` float 1 x H x W in [0, 1].
        Raises: IndexError beyond the length.
        """
        if not 0 <= index < self._length:
            raise IndexError(index)
        if self._stream is None:  # made where it is used: the body model does not travel to workers
            self._stream = PeopleStream(**self._settings)
        dressed = self._stream.dress(index)
        pair: dict[str, Tensor] = {}
        for view, role in enumerate(("source", "target")):
            photo = self._stream.take(dressed, self._stream.shot(index, view))
            rgb, iuv = (torch.from_numpy(im).permute(2, 0, 1) for im in (photo.rgb, photo.iuv))
            pair[f"{role}_image"] = rgb.float() / 127.5 - 1
            pair[f"{role}_iuv"] = iuv.contiguous()
            pair[f"{role}_alpha"] = torch.from_numpy(photo.alpha)[None].float() / 255
        return pair
