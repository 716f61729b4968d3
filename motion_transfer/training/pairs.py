"""Pairs of pictures of one person: the source to learn from or render, the target to reach.

Lists are CSV files as Siarohin et al. (2019) and others after them give for DeepFashion In-shop: a
header `from,to`, then file names relative to the folder of photos. `source,target` means the same.
"""

from __future__ import annotations

import csv
import hashlib
import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Protocol, overload

from motion_transfer.errors import InputError
from motion_transfer.media.image import read_bytes
from motion_transfer.media.iuv_image import ChannelOrder
from motion_transfer.training.pictures import PhotoFile, Picture

HEADERS = (("from", "to"), ("source", "target"))
PROBLEMS_SHOWN = 10


@dataclass(frozen=True)
class Pair:
    """Two pictures of one person.

    Attributes:
        group: pairs of one group are not independent of each other (one source, one clip).
        frame: the target's number in its clip, for clips.
    """

    source: Picture
    target: Picture
    group: str
    frame: int | None = None

    @property
    def name(self) -> str:
        """`SOURCE__TARGET`, fit for a file name: without folders' slashes and file endings."""
        return f"{flat_stem(self.source.name)}__{flat_stem(self.target.name)}"


class PairSource(Protocol):
    """What evaluation asks of a set of pairs: a list, a folder of clips, or pairs that are made.

    Attributes:
        name: what people call it.
        digest: SHA-256 that changes whenever a pair, its order, or a pixel of it changes.
    """

    @property
    def name(self) -> str: ...
    @property
    def digest(self) -> str: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Pair]: ...


class PairList(Sequence[Pair]):
    """Pairs that were checked.

    Attributes:
        dropped: a line for each problem whose pairs were left out.
    """

    def __init__(
        self, name: str, pairs: Sequence[Pair], digest: str, dropped: Sequence[str] = ()
    ) -> None:
        self.name = name
        self.digest = digest
        self.dropped = tuple(dropped)
        self._pairs = tuple(pairs)

    def __len__(self) -> int:
        return len(self._pairs)

    @overload
    def __getitem__(self, index: int) -> Pair: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Pair, ...]: ...
    def __getitem__(self, index: int | slice) -> Pair | tuple[Pair, ...]:
        return self._pairs[index]

    def __iter__(self) -> Iterator[Pair]:
        return iter(self._pairs)


@dataclass(frozen=True)
class Row:
    """A line of a pair list: its number in the file (1 is the header) and the two names."""

    line: int
    source: str
    target: str


@dataclass(frozen=True)
class Entry:
    """A pair, and where it was asked for."""

    where: str
    pair: Pair


def flat_stem(name: str) -> str:
    """A picture's name without its ending, folders joined by `-`: `7/0.png` becomes `7-0`."""
    return "-".join(PurePosixPath(name).with_suffix("").parts)


def read_pair_list(path: Path) -> tuple[list[Row], list[str]]:
    """The rows of a pair list, and what is wrong with others, a line for each.

    Raises: InputError if the file cannot be read, or its header names neither `from,to` nor
        `source,target`.
    """
    try:
        text = read_bytes(path, "pair list").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"pair list {path} is not text: {error.reason}") from error
    reader = csv.reader(text.splitlines())
    header = [word.strip() for word in next(reader, [])]
    columns = next((pair for pair in HEADERS if set(pair) <= set(header)), None)
    if columns is None:
        raise InputError(
            f"pair list {path}, line 1: columns are {', '.join(header) or 'none'}; expected from,to"
            " or source,target"
        )
    first, second = (header.index(column) for column in columns)
    rows, problems = [], []
    for cells in reader:
        if not any(cell.strip() for cell in cells):
            continue
        cells += [""] * (len(header) - len(cells))
        names = cells[first].strip(), cells[second].strip()
        if all(names):
            rows.append(Row(reader.line_num, *names))
        else:
            empty = columns[names.index("")]
            problems.append(f"line {reader.line_num}: `{empty}` is empty")
    return rows, problems


def open_pairs(
    path: Path,
    images: Path | None = None,
    *,
    iuv_order: ChannelOrder | None = None,
    limit: int | None = None,
    thorough: bool = True,
    skip_broken: bool = False,
    done: Callable[[int, int], None] = lambda _count, _total: None,
) -> PairList:
    """The pairs of a list, after every photo and IUV it names was looked at.

    Args:
        images: the folder that the names are relative to; None: the list's own.
        limit: only the first so many pairs.
        thorough: decode every file; else only see that it is there (the digest is then of names
            and sizes in bytes).
        skip_broken: leave pairs with a problem out instead of raising.
        done: called with how many more pictures of how many were looked at.
    Raises: InputError listing what is wrong, all at once; or if no pair is left.
    """
    rows, problems = read_pair_list(path)
    folder = images or path.parent
    if not folder.is_dir():
        raise InputError(f"folder of photos {folder} does not exist")
    entries = []
    for row in rows[:limit]:
        source, target = (
            PhotoFile(name, folder / name, iuv_order) for name in (row.source, row.target)
        )
        entries.append(Entry(f"line {row.line}", Pair(source, target, group=row.source)))
    look = _fingerprint if thorough else _glance
    return check_pairs(path.name, entries, problems, look=look, skip_broken=skip_broken, done=done)


def check_pairs(
    name: str,
    entries: Sequence[Entry],
    problems: Sequence[str] = (),
    *,
    look: Callable[[Picture], str] | None = None,
    skip_broken: bool,
    done: Callable[[int, int], None] = lambda _count, _total: None,
) -> PairList:
    """The pairs whose pictures are all right; each picture is looked at once.

    Args:
        problems: what is wrong already, a line for each.
        look: gives a picture's digest or raises InputError; None: load it.
    Raises: InputError as `open_pairs`.
    """
    places: dict[str, list[str]] = defaultdict(list)
    pictures: dict[str, Picture] = {}
    for entry in entries:
        for picture in (entry.pair.source, entry.pair.target):
            pictures[picture.name] = picture
            places[picture.name].append(entry.where)
    broken, digests = _look_at(pictures, look or _fingerprint, done)
    broken |= _find_clashes(pictures)
    lines = [*problems]
    for picture_name, reason in broken.items():
        where = places[picture_name]
        more = f" (and {len(where) - 1} more)" if len(where) > 1 else ""
        lines.append(f"{where[0]}{more}: {reason}")
    if lines and not skip_broken:
        raise InputError(list_problems(name, lines))
    kept = [
        entry.pair
        for entry in entries
        if entry.pair.source.name not in broken and entry.pair.target.name not in broken
    ]
    if not kept:
        raise InputError(list_problems(f"{name} holds no pair that can be used", lines))
    content = hashlib.sha256()
    for pair in kept:
        for picture in (pair.source, pair.target):
            content.update(f"{picture.name}\0{digests[picture.name]}\n".encode())
    return PairList(name, kept, content.hexdigest(), lines)


def list_problems(what: str, problems: Sequence[str]) -> str:
    """A message with the first problems, a line for each, and how many more there are."""
    if not problems:
        return what
    count = f"{len(problems)} problem{'s' if len(problems) > 1 else ''}"
    lines = [f"{what}: {count}", *(f"  {line}" for line in problems[:PROBLEMS_SHOWN])]
    if len(problems) > PROBLEMS_SHOWN:
        lines.append(f"  and {len(problems) - PROBLEMS_SHOWN} more")
    return "\n".join([*lines, "mend them, or leave their pairs out with --skip-broken"])


def _look_at(
    pictures: Mapping[str, Picture],
    look: Callable[[Picture], str],
    done: Callable[[int, int], None],
) -> tuple[dict[str, str], dict[str, str]]:
    """For each picture's name: what is wrong with it, or its digest."""
    broken: dict[str, str] = {}
    digests: dict[str, str] = {}

    def try_one(picture: Picture) -> InputError | str:
        try:
            return look(picture)
        except InputError as error:
            return error

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        try:
            found = pool.map(try_one, pictures.values())
            for picture_name, answer in zip(pictures, found, strict=True):
                if isinstance(answer, InputError):
                    broken[picture_name] = str(answer)
                else:
                    digests[picture_name] = answer
                done(1, len(pictures))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return broken, digests


def _find_clashes(pictures: Mapping[str, Picture]) -> dict[str, str]:
    """What is wrong with pictures that results could not tell apart by name."""
    owners: dict[str, str] = {}
    clashes = {}
    for name in pictures:
        owner = owners.setdefault(flat_stem(name), name)
        if owner != name:
            clashes[name] = f"{name} and {owner} are both {flat_stem(name)} for short; rename one"
    return clashes


def _fingerprint(picture: Picture) -> str:
    return picture.load().digest()


def _glance(picture: Picture) -> str:
    """Names and sizes in bytes, of a photo that is there. Raises: InputError."""
    assert isinstance(picture, PhotoFile)
    if not picture.path.is_file():
        raise InputError(f"photo {picture.path} does not exist")
    sizes = [path.stat().st_size for path in (picture.path, picture.iuv_path)]
    return ",".join(map(str, sizes))
