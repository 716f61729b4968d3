"""DeepFashion In-shop as those have it who hold it: how its photos are called, and where they lie.

The benchmark calls a photo `img/WOMEN/Dresses/id_00000002/02_1_front.jpg`: an item, an outfit of
it, and a view. Siarohin et al. flattened that to `fasionWOMENDressesid0000000202_1front.jpg` for
their lists, and those after them write `fashion` (and `Blouses_Shirts` with its underscore). All
these are one name here, so that any list fits any folder, and any results fit any list.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from pathlib import Path, PurePosixPath

from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import list_iuv_names
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES
from motion_transfer.media.structured import read_text

_VIEWS = "front|side|back|full|additional|flat"
_NAME = re.compile(
    r"(?:img(?:_highres)?[-/])?(?:fash?ion)?"
    r"(WOMEN|MEN)[-/]?([A-Za-z_]+?)[-/]?"  # WOMEN/Dresses/
    r"id_?(\d{8})[-/_]?(?:id_\d{8}_)?"  # id_00000002/; some copies of img_highres say it twice
    rf"(\d\d)_(\d)_?({_VIEWS})"  # 02_1_front
)
_PARTITION = "list_eval_partition.txt"
_HELD_OUT = ("query", "gallery")  # of the benchmark's partition; the third is train


def spell_names(text: str) -> str:
    """Spell every In-shop photo in a text one way: `fashionWOMENDressesid0000000202_1front`."""

    def flatten(found: re.Match[str]) -> str:
        gender, category, item, outfit, number, view = found.groups()
        return f"fashion{gender}{category.replace('_', '')}id{item}{outfit}_{number}{view}"

    return _NAME.sub(flatten, text)


def find_photos(folder: Path) -> dict[str, PurePosixPath]:
    """Find a folder's In-shop photos, at any depth: where each lies in it, by its one name.

    Of several of one name it is the one with IUV beside it, then the first by path: `img` comes
    before `img_highres`.

    Raises: InputError if there is none.
    """
    found: dict[str, tuple[bool, PurePosixPath]] = {}
    for place, _, files in os.walk(folder, followlinks=True):
        there = set(files)
        for file in files:
            path = Path(place, file)
            # the absolute path, as a folder such as img/WOMEN may be given
            name = _photo_name(path.absolute())
            if name is None:
                continue
            lacks_iuv = there.isdisjoint(iuv.name for iuv in list_iuv_names(path))
            rank = lacks_iuv, PurePosixPath(path.relative_to(folder).as_posix())
            found[name] = min(rank, found.get(name, rank))
    if not found:
        raise InputError(
            f"{folder} holds no photo of DeepFashion In-shop, such as"
            " img/WOMEN/Dresses/id_00000002/02_1_front.jpg or"
            " fashionWOMENDressesid0000000202_1front.jpg; give the benchmark's folder"
        )
    return {name: found[name][1] for name in sorted(found)}


def outfit_of(name: str) -> str:
    """One person in the same clothes."""
    return name.rpartition("_")[0]


def choose_held_out(
    folder: Path, photos: Mapping[str, PurePosixPath]
) -> tuple[Collection[str], str]:
    """Choose the photos that nothing should have learned from, and tell which those are."""
    parents = folder.resolve().parents[:2]  # the folder may be img itself
    for place in (folder, *parents):
        for file in (place / "Eval" / _PARTITION, place / _PARTITION):
            if file.is_file():
                lines = [line.split() for line in read_text(file, "partition").splitlines()]
                # a count, the columns' names, then name, item and status
                held_out = {
                    spell_names(words[0].rpartition(".")[0])
                    for words in lines
                    if len(words) == 3 and words[2] in _HELD_OUT
                }
                if held_out:  # CelebA has a file of this name, too
                    return held_out & photos.keys(), f"query and gallery of {_PARTITION}"
    in_test = [
        name
        for name, path in photos.items()
        if any(part.startswith("test") for part in path.parts[:-1])
    ]
    return (in_test, "those in folders named test...") if in_test else (photos, "all photos")


def _photo_name(path: Path) -> str | None:
    """The one name of a photo's file; None for any other file, its IUV among them."""
    if path.suffix.lower() not in PHOTO_SUFFIXES:
        return None
    stem = path.with_suffix("").as_posix()
    found = _NAME.search(stem)
    return spell_names(found[0]) if found and found.end() == len(stem) else None
