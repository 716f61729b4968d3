"""Where pairs come from: people, a list of photos, clips, or one person's photos."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.media.video import VIDEO_SUFFIXES
from motion_transfer.people.album import AlbumOptions, write_album
from motion_transfer.training.clips import ClipFrame, open_clip_pairs
from motion_transfer.training.config import PEOPLE, DataSettings
from motion_transfer.training.pairs import (
    Entry,
    Pair,
    PairList,
    check_pairs,
    list_problems,
    open_pairs,
)
from motion_transfer.training.pictures import PhotoFile
from motion_transfer.training.streamed import StreamedPairs

PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".bmp")
NOT_PHOTOS = ("_IUV", "_iuv", "_alpha")
SOURCES_EACH = 4
"""How many other photos of a person each photo is the target of."""

Count = Callable[[int, int], None]


@dataclass(frozen=True)
class TrainingData:
    """Pairs, and what they are.

    Attributes:
        description: words that are stored with the weights.
        digest: changes whenever a pair does; a run goes on only with what it began with.
        dropped: a line for each problem whose pairs were left out.
    """

    pairs: Sequence[Pair]
    description: str
    digest: str
    dropped: tuple[str, ...] = ()

    def require_alpha(self) -> None:
        """See that targets have an alpha; those of people always do.

        Raises: InputError listing those that have none.
        """
        targets = {
            pair.target.name: pair.target
            for pair in (() if getattr(self.pairs, "endless", False) else self.pairs)
        }
        lacking = [
            f"{name}: no alpha, neither its own nor STEM_alpha.png"
            for name, target in targets.items()
            if isinstance(target, ClipFrame)
            or (isinstance(target, PhotoFile) and not target.has_alpha)
        ]
        if lacking:
            raise InputError(
                list_problems("a model with alpha learns it from the data", lacking)
                + "\nor train without alpha: --set model.alpha=false"
            )


def open_training_data(
    settings: DataSettings, *, run: Path, seed: int, photographed: Count, looked: Count
) -> TrainingData:
    """Find out what `settings.source` names, and check all of it.

    Args:
        run: the run's folder, which keeps synthetic people unless the settings say otherwise.
        photographed, looked: called with how many more people, or pictures, are done, of how many.
    Raises: InputError listing missing IUV, missing members of pairs and broken files, all at once.
    """
    if settings.source == PEOPLE:
        return _open_people(settings, run, seed, photographed, looked)
    path = Path(settings.source)
    common = {"skip_broken": settings.skip_broken, "done": looked}
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
    if any(file.suffix.lower() in VIDEO_SUFFIXES and _is_picture(file) for file in path.iterdir()):
        pairs = open_clip_pairs(path, moments=settings.moments, **common)
        return _describe(pairs, f"clips in {path.name}")
    return _describe(_pair_photos(path, **common), f"photos of one person in {path.name}")


def _open_people(
    settings: DataSettings, run: Path, seed: int, photographed: Count, looked: Count
) -> TrainingData:
    size = (settings.size_px, settings.size_px)
    if settings.people == 0:
        pairs = StreamedPairs(seed=seed, size=size, noise=settings.noise)
        return TrainingData(pairs, "ever new synthetic people", repr(pairs))
    folder = Path(settings.people_cache) if settings.people_cache else run / "people"
    options = AlbumOptions(
        out=folder,
        count=settings.people,
        views=settings.views,
        seed=settings.people_seed,
        size=size,
        noise=settings.noise,
    )
    write_album(options, lambda count: photographed(count, settings.people))
    pairs = open_pairs(folder / "pairs.csv", thorough=False, done=looked)
    found = len({Path(pair.source.name).parent for pair in pairs})
    if found != settings.people:  # an album is only ever added to
        raise InputError(
            f"{folder} holds {found} people, but {settings.people} are asked for; train on all of"
            f" them with --people {found}, or name another --people-cache"
        )
    return _describe(pairs, f"{settings.people} synthetic people, {settings.views} photos each")


def _describe(pairs: PairList, words: str) -> TrainingData:
    return TrainingData(pairs, f"{len(pairs)} pairs: {words}", pairs.digest, pairs.dropped)


def _pair_photos(folder: Path, *, skip_broken: bool, done: Count) -> PairList:
    """Each photo of a folder as a target of others, spread evenly over it."""
    names = sorted(
        file.name
        for file in folder.iterdir()
        if file.suffix.lower() in PHOTO_SUFFIXES and _is_picture(file)
    )
    if len(names) < 2:
        raise InputError(
            f"data {folder} holds {len(names)} photos; a pair needs two, each with STEM_IUV.png"
            " beside it"
        )
    photos = [PhotoFile(name, folder / name) for name in names]
    steps = sorted(
        {1 + (len(names) - 1) * step // SOURCES_EACH for step in range(SOURCES_EACH)}
        & set(range(1, len(names)))
    )
    entries = [
        Entry(target.name, Pair(photos[(place + step) % len(photos)], target, group=target.name))
        for place, target in enumerate(photos)
        for step in steps
    ]
    return check_pairs(folder.name, entries, skip_broken=skip_broken, done=done)


def _is_picture(file: Path) -> bool:
    return not file.stem.endswith(NOT_PHOTOS) and not file.name.startswith(".")
