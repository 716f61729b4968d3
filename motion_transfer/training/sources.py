"""Where pairs come from: people, a list of photos, clips, or one person's photos."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.extras import require_extra
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, VIDEO_SUFFIXES
from motion_transfer.people import (
    AlbumOptions,
    DressedPerson,
    IuvNoise,
    PeopleStream,
    Split,
    check_share,
    find_assets,
    load_assets,
    write_album,
)
from motion_transfer.training.clips import IUV_ENDINGS, ClipFrame, list_files, open_clip_pairs
from motion_transfer.training.config import TrainConfig
from motion_transfer.training.pairs import (
    Done,
    Pair,
    PairList,
    Pairs,
    check_pairs,
    list_problems,
    open_pairs,
)
from motion_transfer.training.pictures import PersonPicture, PhotoFile
from motion_transfer.training.settings import PEOPLE, DataSettings
from motion_transfer.version import __version__, package_version

NOT_PHOTOS = (*IUV_ENDINGS, "_alpha")
SOURCES_EACH = 4
"""How many other photos of a person each photo is the target of."""

ENOUGH = 2**31  # more pairs than any run takes
FREE_SHARE = DataSettings.free_share
HELD_OUT_SEED, HELD_OUT_SIZE = 2020, (256, 256)
DRAWN_BY = ("anny", "warp-lang", "numpy", "opencv-contrib-python-headless")
"""Packages whose versions decide, with ours, what people look like."""


@dataclass(frozen=True)
class TrainingData:
    """Pairs, and what they are.

    Attributes:
        description: Words that are stored with the weights.
        digest: Changes whenever a pair does; a run goes on only with what it began with.
        dropped: A line for each problem whose pairs were left out.
    """

    pairs: Pairs
    description: str
    digest: str
    dropped: tuple[str, ...] = ()


def open_training_data(
    config: TrainConfig, run: Path, *, photographed: Done, checked: Done
) -> TrainingData:
    """Find out what `data.source` names, and check all of it.

    Args:
        run: The run's folder, which keeps synthetic people unless the settings say otherwise.
        photographed, checked: Called with how many more people, or pictures, are done, of how many.
    Raises: InputError listing missing IUV, missing members of pairs and broken files, all at once;
        or missing alpha, where the model learns it.
    """
    data = _open_source(config, run, photographed, checked)
    if config.model.alpha and not data.pairs.endless:  # people always have one
        pairs = (data.pairs[number] for number in range(len(data.pairs)))
        lacking = [
            f"{name}: no alpha, neither its own nor STEM_alpha.png"
            for name, target in {pair.target.name: pair.target for pair in pairs}.items()
            if isinstance(target, ClipFrame)
            or (isinstance(target, PhotoFile) and not target.has_alpha)
        ]
        if lacking:
            raise InputError(
                *list_problems("a model with alpha learns it from the data", lacking),
                "or train without alpha: --set model.alpha=false",
            )
    return data


def _open_source(config: TrainConfig, run: Path, photographed: Done, checked: Done) -> TrainingData:
    settings = config.data
    if settings.source == PEOPLE:
        return _open_people(settings, run, config.run.seed, photographed, checked)
    path = Path(settings.source)
    common = {"skip_broken": settings.skip_broken, "done": checked}
    if path.is_file():
        images = Path(settings.images) if settings.images else None
        return _describe(open_pairs(path, images, **common), f"photos listed in {path.name}")
    if not path.is_dir():
        raise InputError(
            f"data {path} does not exist; give {PEOPLE}, a CSV of pairs, or a folder of photos or"
            " clips"
        )
    if (path / "pairs.csv").is_file():
        return _describe(open_pairs(path / "pairs.csv", **common), f"photos in {path.name}")
    if list_files(path, VIDEO_SUFFIXES, NOT_PHOTOS):
        pairs = open_clip_pairs(path, moments=settings.moments, **common)
        return _describe(pairs, f"clips in {path.name}")
    return _describe(_pair_photos(path, **common), f"photos of one person in {path.name}")


def _describe(pairs: PairList, words: str) -> TrainingData:
    return TrainingData(pairs, f"{len(pairs)} pairs: {words}", pairs.digest, pairs.dropped)


def _pair_photos(folder: Path, *, skip_broken: bool, done: Done) -> PairList:
    """Each photo of a folder as a target of others, spread evenly over it."""
    names = [file.name for file in list_files(folder, PHOTO_SUFFIXES, NOT_PHOTOS)]
    if len(names) < 2:
        raise InputError(
            f"data {folder} holds {len(names)} photos; a pair needs two, each with STEM_IUV.png"
            " beside it"
        )
    photos = [PhotoFile(name, folder / name) for name in names]
    others = len(names) - 1
    # a set, as of few photos the same step comes several times
    steps = sorted({1 + others * each // SOURCES_EACH for each in range(SOURCES_EACH)})
    entries = [
        (target.name, Pair(photos[(place + step) % len(photos)], target, group=target.name))
        for place, target in enumerate(photos)
        for step in steps
    ]
    return check_pairs(folder.name, entries, skip_broken=skip_broken, done=done)


def _open_people(
    settings: DataSettings, run: Path, seed: int, photographed: Done, checked: Done
) -> TrainingData:
    size = (settings.size_px, settings.size_px)
    assets = find_assets(settings.assets)
    # the default share says nothing where there are no assets, any other one is a slip
    share = None if settings.free_share == FREE_SHARE else settings.free_share
    share = check_share(share, assets)
    among = f", {share:.0%} of them in photographed clothes" if assets else ""
    if settings.people == 0:
        pairs = StreamedPairs(
            seed=seed, size=size, noise=settings.noise, assets=assets, free_share=share
        )
        return TrainingData(pairs, f"ever new synthetic people{among}", pairs.digest)
    folder = Path(settings.people_cache) if settings.people_cache else run / "people"
    options = AlbumOptions(
        out=folder,
        count=settings.people,
        views=settings.views,
        seed=settings.people_seed,
        size=size,
        noise=settings.noise,
        assets=assets,
        free_share=share if assets else None,
    )
    write_album(options, lambda count: photographed(count, settings.people))
    pairs = open_pairs(folder / "pairs.csv", thorough=False, done=checked)
    found = len({Path(pair.source.name).parent for pair in pairs})
    if found != settings.people:  # an album is only ever added to
        raise InputError(
            f"{folder} holds {found} people, but {settings.people} are asked for; train on all of"
            f" them with --people {found}, or name another --people-cache"
        )
    words = f"{settings.people} synthetic people, {settings.views} photos each{among}"
    return _describe(pairs, words)


def held_out_pairs(count: int, assets: Path | None = None) -> PairList:
    """Make a built-in set for evaluation: people of the split that training never draws from.

    Its digest stands for the pixels without drawing them: everything follows from the seed, the
    count, the versions of what draws, and the assets.

    Args:
        assets: Whose free people the set consists of; None: it is of painted ones.
    Raises: InputError without the extra, or for assets that cannot be used.
    """
    people = StreamedPairs(
        seed=HELD_OUT_SEED,
        size=HELD_OUT_SIZE,
        noise=0.0,
        split="held-out",
        assets=assets,
        free_share=1.0 if assets else 0.0,
    )
    made_of = [HELD_OUT_SEED, HELD_OUT_SIZE, count, __version__, *map(package_version, DRAWN_BY)]
    if assets:
        made_of.append(load_assets(assets).digest)
    digest = hashlib.sha256(repr(made_of).encode()).hexdigest()
    name = "free people" if assets else "people"
    return PairList(f"{name} (held-out)", [people[number] for number in range(count)], digest)


@dataclass(frozen=True, kw_only=True)
class StreamedPairs:
    """Pairs of synthetic people who are made when they are asked for, without end.

    Pair n shows person n, first as source, then as target. Raises: InputError without the extra.

    Attributes:
        size: (width, height) in px.
        noise: The share of the photos whose IUV has the faults of DensePose's.
        assets: Folder of MakeHuman's, which free people wear.
        free_share: Of free people among all.
    """

    seed: int
    size: tuple[int, int]
    noise: float
    split: Split = "train"
    endless: bool = True
    assets: Path | None = field(default=None, repr=False)
    free_share: float = field(default=0.0, repr=False)

    def __post_init__(self) -> None:
        require_extra("people")
        if self.assets:
            load_assets(self.assets)  # what is wrong with them is said before anything is drawn

    @property
    def digest(self) -> str:
        """What decides the pairs; without assets as it was before there were any."""
        if self.assets is None:
            return repr(self)
        return f"{self!r}, {self.free_share} of {load_assets(self.assets).digest}"

    def __len__(self) -> int:
        return ENOUGH

    def __getitem__(self, index: int) -> Pair:
        source, target = (StreamedPhoto(self, index, view) for view in (0, 1))
        return Pair(source, target, group=str(index))


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
        assets=people.assets,
        free_share=people.free_share if people.assets else None,
    )


@lru_cache(maxsize=8)  # both photos of a pair, in each of several threads
def _dress(people: StreamedPairs, number: int) -> DressedPerson:
    return _stream(people).dress(number)
