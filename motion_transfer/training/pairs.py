"""Pairs of pictures of one person: the source to learn from or render, the target to reach.

Lists are CSV files as Siarohin et al. (2019) and others after them give for DeepFashion In-shop: a
header `from,to`, then file names relative to the folder of photos. `source,target` means the same.
"""

from __future__ import annotations

import csv
import hashlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Protocol

from motion_transfer.cores import core_count
from motion_transfer.errors import InputError
from motion_transfer.media.files import read_bytes
from motion_transfer.media.iuv.formats import ChannelOrder
from motion_transfer.training.pictures import PhotoFile, Picture

HEADERS = (("from", "to"), ("source", "target"))
PROBLEMS_SHOWN = 10

Row = tuple[int, str, str]
"""A line of a pair list: its number in the file (1 is the header) and the two names."""

Done = Callable[[int, int], None]
"""Called with how many more are done, and of how many in all."""


def ignore_done(_count: int, _total: int) -> None:
    """Hear of progress and do nothing."""


@dataclass(frozen=True)
class Pair:
    """Two pictures of one person.

    Attributes:
        group: Pairs of one group are not independent of each other (one source, one clip).
        frame: The target's number in its clip, for clips.
    """

    source: Picture
    target: Picture
    group: str
    frame: int | None = None

    @property
    def name(self) -> str:
        """`SOURCE__TARGET`, fit for a file name: without folders' slashes and file endings."""
        return f"{flat_stem(self.source.name)}__{flat_stem(self.target.name)}"


class Pairs(Protocol):
    """Pairs by number: a list, or people who are made when they are asked for.

    Attributes:
        endless: There are more than any run takes, and none is taken twice.
    """

    @property
    def endless(self) -> bool: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> Pair: ...


@dataclass(frozen=True)
class PairList:
    """Pairs that were checked.

    Attributes:
        name: What people call them.
        digest: The SHA-256 that changes whenever a pair, its order, or a pixel of it changes.
        dropped: A line for each problem whose pairs were left out.
    """

    name: str
    pairs: Sequence[Pair]
    digest: str
    dropped: tuple[str, ...] = ()
    endless = False

    def __len__(self) -> int:
        return len(self.pairs)

    def __getitem__(self, index: int) -> Pair:
        return self.pairs[index]

    def __iter__(self) -> Iterator[Pair]:
        return iter(self.pairs)


def flat_stem(name: str) -> str:
    """Shorten a picture's name: no ending, folders joined by `-`; `7/0.png` becomes `7-0`."""
    return "-".join(PurePosixPath(name).with_suffix("").parts)


def read_pair_list(path: Path) -> tuple[list[Row], list[str]]:
    """Read the rows of a pair list, and what is wrong with others, a line for each.

    Raises: InputError if the file cannot be read, or its header names neither `from,to` nor
        `source,target`.
    """
    try:
        text = read_bytes(path, "pair list").decode("utf-8-sig")  # Excel writes a byte order mark
    except UnicodeDecodeError as error:
        raise InputError(f"pair list {path} is not text: {error.reason}") from error
    reader = csv.reader(text.splitlines())
    header = [word.strip() for word in next(reader, [])]
    # others may stand there as well, such as the row numbers that pandas writes
    columns = next((pair for pair in HEADERS if set(pair) <= set(header)), None)
    if columns is None:
        raise InputError(
            f"pair list {path}, line 1: columns are {', '.join(header) or 'none'}; expected from,to"
            " or source,target"
        )
    first, second = (header.index(column) for column in columns)
    rows: list[Row] = []
    problems = []
    for cells in reader:
        if not any(cell.strip() for cell in cells):
            continue
        cells += [""] * (len(header) - len(cells))  # short rows lack their last cells
        names = cells[first].strip(), cells[second].strip()
        if all(names):
            rows.append((reader.line_num, *names))
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
    done: Done = ignore_done,
) -> PairList:
    """Open the pairs of a list, after every photo and IUV it names was checked.

    Args:
        images: The folder that the names are relative to; None: the list's own.
        limit: Only the first so many pairs.
        thorough: Decode every file; else only see that it is there (the digest is then of names
            and sizes in bytes).
        skip_broken: Leave pairs with a problem out instead of raising.
        done: Called with how many more pictures of how many were checked.
    Raises: InputError listing what is wrong, all at once; or if no pair is left.
    """
    rows, problems = read_pair_list(path)
    folder = images or path.parent
    if not folder.is_dir():
        raise InputError(f"folder of photos {folder} does not exist")
    entries = []
    for line, *names in rows[:limit]:
        source, target = (PhotoFile(name, folder / name, iuv_order) for name in names)
        entries.append((f"line {line}", Pair(source, target, group=source.name)))
    check = _digest_pixels if thorough else _digest_sizes
    return check_pairs(
        path.name, entries, problems, check=check, skip_broken=skip_broken, done=done
    )


def _digest_pixels(picture: Picture) -> str:
    return picture.load().digest()


def _digest_sizes(picture: Picture) -> str:
    """The sizes in bytes of a photo that is there, and of its IUV. Raises: InputError."""
    assert isinstance(picture, PhotoFile)
    if not picture.path.is_file():
        raise InputError(f"photo {picture.path} does not exist")
    return ",".join(str(path.stat().st_size) for path in (picture.path, picture.iuv_path))


def check_pairs(
    name: str,
    entries: Sequence[tuple[str, Pair]],
    problems: Sequence[str] = (),
    *,
    check: Callable[[Picture], str] = _digest_pixels,
    skip_broken: bool,
    done: Done = ignore_done,
) -> PairList:
    """Keep the pairs whose pictures are all right; each picture is checked once.

    Args:
        entries: Where each pair was asked for, and the pair.
        problems: What is wrong already, a line for each.
        check: Gives a picture's digest or raises InputError.
    Raises: InputError as `open_pairs` does.
    """
    places: dict[str, list[str]] = defaultdict(list)
    pictures: dict[str, Picture] = {}
    for where, pair in entries:
        for picture in (pair.source, pair.target):
            pictures[picture.name] = picture
            places[picture.name].append(where)
    answers = _check_pictures(pictures, check, done)
    broken = {key: str(found) for key, found in answers.items() if isinstance(found, InputError)}
    owners: dict[str, str] = {}
    for each in pictures:  # results could not tell those apart whose short names are the same
        owner = owners.setdefault(flat_stem(each), each)
        if owner != each:
            broken[each] = f"{each} and {owner} are both {flat_stem(each)} for short; rename one"
    lines = [*problems]
    for picture_name, reason in broken.items():
        where = places[picture_name]
        more = f" (and {len(where) - 1} more)" if len(where) > 1 else ""
        lines.append(f"{where[0]}{more}: {reason}")
    if lines and not skip_broken:
        raise InputError(*list_problems(name, lines))
    kept, content = [], hashlib.sha256()
    for _, pair in entries:
        names = pair.source.name, pair.target.name
        if broken.keys().isdisjoint(names):
            kept.append(pair)
            for picture_name in names:
                content.update(f"{picture_name}\0{answers[picture_name]}\n".encode())
    if not kept:
        raise InputError(*list_problems(f"{name} holds no pair that can be used", lines))
    return PairList(name, kept, content.hexdigest(), tuple(lines))


def list_problems(what: str, problems: Sequence[str]) -> list[str]:
    """Write the lines of a message: the first problems, and how many more there are."""
    if not problems:
        return [what]
    count = f"{len(problems)} problem{'s' if len(problems) > 1 else ''}"
    lines = [f"{what}: {count}", *(f"  {line}" for line in problems[:PROBLEMS_SHOWN])]
    if len(problems) > PROBLEMS_SHOWN:
        lines.append(f"  and {len(problems) - PROBLEMS_SHOWN} more")
    return [*lines, "mend them, or leave their pairs out with --skip-broken"]


def _check_pictures(
    pictures: Mapping[str, Picture], check: Callable[[Picture], str], done: Done
) -> dict[str, InputError | str]:
    """For each picture's name: what is wrong with it, or its digest."""

    def try_one(picture: Picture) -> InputError | str:
        try:
            return check(picture)
        except InputError as error:
            return error

    with ThreadPoolExecutor(core_count()) as pool:
        try:
            answers: dict[str, InputError | str] = {}
            for name, answer in zip(pictures, pool.map(try_one, pictures.values()), strict=True):
                answers[name] = answer
                done(1, len(pictures))
            return answers
        except BaseException:
            pool.shutdown(cancel_futures=True)  # whoever stops it need not wait for all the rest
            raise
