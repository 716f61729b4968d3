"""The paper's Table 1, for those who hold DeepFashion In-shop: its pairs and its numbers.

Which 176 pairs the paper's are is not published; what else it leaves open, and what is done about
it, is `UNSTATED` and goes into results files.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path, PurePosixPath

from motion_transfer.errors import InputError
from motion_transfer.evaluation.in_shop import choose_held_out, find_photos, outfit_of, spell_names
from motion_transfer.evaluation.report import Published
from motion_transfer.media.iuv.formats import ChannelOrder, list_iuv_names
from motion_transfer.training.pairs import (
    Done,
    Pair,
    PairList,
    check_pairs,
    ignore_done,
    read_pair_list,
)
from motion_transfer.training.pictures import PhotoFile

PAIRS_COUNT = 176  # the paper, Sec. 4.2
SEED = 2020

TABLE_1 = Published(
    source="Sarkar et al., ECCV 2020, Table 1",
    remark=(
        "176 pairs, and the other methods' results, from the authors of CBI; SSIM and LPIPS by an"
        " implementation that the paper does not name"
    ),
    better={"ssim": "higher", "lpips": "lower"},
    scores={
        "CBI": {"ssim": 0.766, "lpips": 0.178},
        "DSC": {"ssim": 0.750, "lpips": 0.214},
        "VUnet": {"ssim": 0.739, "lpips": 0.202},
        "DPT": {"ssim": 0.759, "lpips": 0.206},
        "NHRR": {"ssim": 0.768, "lpips": 0.164},
        "GT": {"ssim": 1.0, "lpips": 0.0},
    },
)

LISTED = (
    "the paper's 176 pairs came from the authors of CBI and are not published; here those of the"
    " list that was given"
)
DRAWN = (
    "the paper's 176 pairs came from the authors of CBI and are not published; here others: of each"
    " outfit (item and number) one pair of two views but `flat`, outfits and pairs in the order of"
    f" the SHA-256 of `{SEED} NAME...`; outfits: "
)
UNSTATED = {
    "size": "the paper does not say at what size; here at `resolution`",
    "crop": "the paper does not say whether photos are cut to 176 x 256; here all of it",
    "background": "the paper does not say what lies behind the person; here as `background` says",
    "iuv": "the paper does not say which DensePose; here what lies beside each photo",
    "ssim": "the paper does not say which window, channels and range; here as `metrics` says",
    "lpips": "the paper does not say which network and version; here as `metrics` says",
    "results": "the paper's results of other methods are not published; here the folders given",
}
"""What decides numbers and the paper does not say, with what holds instead; `pairs` comes to it."""


@dataclass(frozen=True)
class ChosenPairs:
    """Pairs by name, before any file was opened.

    Attributes:
        title: What people call them.
        rule: How they were chosen, in words.
        rows: Where each was asked for, source, target.
        problems: A line for each that cannot be had.
    """

    title: str
    rule: str
    rows: Sequence[tuple[str, str, str]]
    problems: Sequence[str] = ()


def choose_pairs(
    folder: Path, photos: Mapping[str, PurePosixPath], listed: Path | None, limit: int | None
) -> ChosenPairs:
    """Take the pairs of a list, or draw some, the same for the same names each time.

    Args:
        photos: What `find_photos` found in the folder.
        limit: Only the first so many pairs; None: all of the list, or 176.
    Raises: InputError for a list that is none, or if there are too few pairs to draw.
    """
    if listed is not None:
        rows, missing = [], []
        by_path = {str(path): name for name, path in photos.items()}
        written, problems = read_pair_list(listed)
        for line, *files in written[:limit]:
            names = [by_path.get(file, spell_names(file.rpartition(".")[0])) for file in files]
            lacking = [file for file, name in zip(files, names, strict=True) if name not in photos]
            missing += [f"line {line}: {file} is not in {folder}" for file in lacking]
            if not lacking:
                rows.append((f"line {line}", *names))
        return ChosenPairs(listed.name, LISTED, rows, [*problems, *missing])
    names, among = choose_held_out(folder, photos)
    count = limit or PAIRS_COUNT
    drawn = draw_pairs(names)
    if len(drawn) < count:
        fewer = f"; ask for fewer with --limit {len(drawn)}" if drawn else ""
        raise InputError(
            f"{folder} has {len(drawn)} outfits with two photos among {among}, {count} are needed"
            f" for as many pairs{fewer}"
        )
    rows = [(source, source, target) for source, target in drawn[:count]]
    return ChosenPairs(f"DeepFashion In-shop (drawn from {among})", DRAWN + among, rows)


def draw_pairs(names: Collection[str]) -> list[tuple[str, str]]:
    """Draw a pair (source, target) of every outfit that two photos show, in the order of hashes.

    Hashes, not a generator: a photo more or less changes the pairs of its own outfit alone.
    """

    def rank(words: Sequence[str]) -> str:
        return hashlib.sha256(" ".join([str(SEED), *words]).encode()).hexdigest()

    outfits: dict[str, list[str]] = defaultdict(list)
    for name in sorted(names):
        if not name.endswith("flat"):  # clothes laid out, without a person
            outfits[outfit_of(name)].append(name)
    return [
        min(permutations(outfits[outfit], 2), key=rank)
        for outfit in sorted(outfits, key=lambda outfit: rank([outfit]))
        if len(outfits[outfit]) > 1
    ]


def open_table1_pairs(
    folder: Path,
    listed: Path | None = None,
    *,
    iuv_order: ChannelOrder | None = None,
    limit: int | None = None,
    skip_broken: bool = False,
    done: Done = ignore_done,
) -> tuple[PairList, dict[str, str]]:
    """Open the pairs of Table 1 as far as they can be had, and tell every choice that was made.

    Args:
        folder: Of the benchmark, or of its flattened photos; IUV is beside each that is needed.
        listed: A list of pairs, its names spelled either way; None: pairs are drawn.
        limit, skip_broken, done: As `motion_transfer.training.pairs.open_pairs` has them.
    Raises: InputError listing what is wrong, all at once.
    """
    photos = find_photos(folder)
    chosen = choose_pairs(folder, photos, listed, limit)

    def photo(name: str) -> PhotoFile:
        return PhotoFile(f"{name}.jpg", folder / photos[name], iuv_order)

    entries = [
        (where, Pair(photo(source), photo(target), group=outfit_of(source)))
        for where, source, target in chosen.rows
    ]
    try:
        pairs = check_pairs(
            chosen.title, entries, chosen.problems, skip_broken=skip_broken, done=done
        )
    except InputError as error:
        needed = {folder / photos[name] for _, *names in chosen.rows for name in names}
        lacking = [path for path in needed if not any(map(Path.exists, list_iuv_names(path)))]
        if not lacking:
            raise
        raise InputError(
            *error.lines,
            f"{len(lacking)} of {len(needed)} photos lack IUV, which does not come with the"
            " benchmark: make it with DensePose, or `mt iuv PHOTO -o STEM_IUV.png`; --list-pairs"
            " tells of which photos",
        ) from error
    return pairs, {"pairs": chosen.rule, **UNSTATED}


def list_table1_pairs(folder: Path, listed: Path | None, limit: int | None) -> str:
    """Write the same pairs as a list, by files relative to the folder; no IUV is needed for it.

    Raises: InputError, as for their opening.
    """
    photos = find_photos(folder)
    chosen = choose_pairs(folder, photos, listed, limit)
    if chosen.problems:
        raise InputError(*chosen.problems)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["from", "to"])
    writer.writerows([photos[source], photos[target]] for _, source, target in chosen.rows)
    return text.getvalue()
