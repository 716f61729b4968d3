"""A study from results to a folder: the page to send, and the key to keep."""

from __future__ import annotations

import json
import os
import random
import secrets
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files
from itertools import combinations
from pathlib import Path

from motion_transfer.cores import core_count
from motion_transfer.errors import InputError
from motion_transfer.evaluation.result_names import PATTERNS, cut_result, find_pattern
from motion_transfer.evaluation.study.items import (
    MethodFolder,
    Say,
    find_sources,
    is_video,
    open_methods,
    shared_items,
)
from motion_transfer.evaluation.study.key import KEY_FILE, PAGE_FOLDER, QUESTIONS, Comparison, Key
from motion_transfer.evaluation.study.options import StudyOptions
from motion_transfer.media.output.bare import copy_for_browsers
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import read_photo, write_png
from motion_transfer.media.publish import check_destination, publish, work_folder

MEDIA_FOLDER, DATA_FILE = "media", "data.js"
NAME_BYTES = 6  # of random names: 2^48, so that no two are alike
SAME_TIME_SECONDS = 946_684_800  # the year 2000: when a file was made tells nothing
LENGTH_SLACK_SECONDS = 0.05  # a frame's time or so; nobody sees such a difference

_random = random.SystemRandom()


def make_study(
    options: StudyOptions,
    *,
    notice: Say = lambda _words: None,
    done: Callable[[int, int], None] = lambda _count, _total: None,
) -> Key:
    """Write the folder of a study.

    Whatever happens, nothing half-written stays behind, and answers are never replaced.

    Args:
        notice: Told of what is left out, and of what readers might notice.
        done: Called with how many more files of how many are ready.
    Raises: InputError, OutputError.
    """
    check_destination(
        options.output,
        force=options.force,
        belongs=lambda item: item.name in (PAGE_FOLDER, KEY_FILE),
        content="a study that nobody has answered",
    )
    methods = open_methods(options.results)
    pairs = choose_pairs([method.label for method in methods], options.base)
    items = shared_items(methods, notice)
    sources = find_sources(options.sources, items) if options.sources else {}
    if not sources:
        notice("without --sources readers are asked about realism only")
    with work_folder(options.output) as folder:
        finished = folder / "finished"
        media = finished / PAGE_FOLDER / MEDIA_FOLDER
        media.mkdir(parents=True)
        blind = _write_media(media, methods, items, sources, notice, done)
        comparisons = draw_comparisons(pairs, items)
        asked = min(options.per_reader, len(comparisons))
        key = Key(
            study=secrets.token_hex(8),
            pairs=[list(pair) for pair in pairs],
            questions=list(QUESTIONS) if sources else ["realism"],
            asked=asked,
            repeats=min(options.repeats, asked // 2),
            comparisons=comparisons,
            files={name: f"{label or 'source'}: {item}" for (label, item), name in blind.items()},
        )
        _write_page(finished / PAGE_FOLDER, key, blind)
        (finished / KEY_FILE).write_text(json.dumps(key.model_dump(), indent=1) + "\n", "utf-8")
        publish(finished, options.output)
    return key


def choose_pairs(labels: Sequence[str], base: str | None) -> list[tuple[str, str]]:
    """Pair methods: all with all, or one with each other one. Raises: InputError."""
    if base is None:
        return list(combinations(labels, 2))
    if base not in labels:
        raise InputError(f"base {base!r} is no method here; there are {', '.join(labels)}")
    return [(base, label) for label in labels if label != base]


def draw_comparisons(
    pairs: Sequence[tuple[str, str]], items: Sequence[str]
) -> dict[str, Comparison]:
    """Draw a comparison of each item by each pair, under random names in random order.

    Each method of a pair is `a` in half of its items: who guesses agrees with others half the time.
    """
    drawn = []
    for first, second in pairs:
        order = _random.sample(items, len(items))
        start = _random.randrange(2)
        for number, item in enumerate(order, start):
            a, b = (first, second) if number % 2 else (second, first)
            drawn.append(Comparison(item=item, a=a, b=b))
    _random.shuffle(drawn)
    return {secrets.token_hex(NAME_BYTES): comparison for comparison in drawn}


SOURCE = ""
"""What stands for a method's label with a source; no method is called that."""


def _write_media(
    folder: Path,
    methods: Sequence[MethodFolder],
    items: Sequence[str],
    sources: dict[str, Path],
    notice: Say,
    done: Callable[[int, int], None],
) -> dict[tuple[str, str], str]:
    """Write all that is shown, by names that say nothing; give the name of each label and item."""
    wanted = {(method.label, item): method.files[item] for method in methods for item in items}
    wanted |= {(SOURCE, item): sources[item] for item in sources}
    endings = {entry: ".mp4" if is_video(path) else ".png" for entry, path in wanted.items()}
    names = {
        entry: f"{MEDIA_FOLDER}/{secrets.token_hex(NAME_BYTES)}{ending}"
        for entry, ending in endings.items()
    }

    def write(entry: tuple[str, str]) -> tuple[tuple[int, int], float]:
        return _write_blind(wanted[entry], folder.parent / names[entry])

    order = _random.sample(list(wanted), len(wanted))
    facts = {}
    with ThreadPoolExecutor(core_count()) as pool:
        for entry, fact in zip(order, pool.map(write, order), strict=True):
            facts[entry] = fact
            done(1, len(order))
    _tell_differences([[facts[m.label, item] for m in methods] for item in items], notice)
    return names


def _write_blind(path: Path, destination: Path) -> tuple[tuple[int, int], float]:
    """Write a picture or video without anything that tells where it is from.

    Of strips, as published code writes them, the result alone is shown.

    Returns: Its size, (width, height) in px, and how long it plays, in seconds.
    Raises: InputError if it cannot be shown.
    """
    if is_video(path):
        video = copy_for_browsers(path, destination)
        return video.size, float(video.duration_seconds)
    if open_pictures(path).frame_count > 1:
        raise InputError(f"{path} is an animation; make a video of it, such as .mp4")
    pattern = find_pattern(path.stem)
    picture = read_photo(path, "picture").on_white()
    picture = cut_result(picture, PATTERNS[pattern] if pattern else 1)
    write_png(destination, picture)
    return (picture.shape[1], picture.shape[0]), 0


def _tell_differences(
    facts: Sequence[Sequence[tuple[tuple[int, int], float]]], notice: Say
) -> None:
    """Say what readers may see of methods beside their pictures."""
    sizes = sum(len({size for size, _ in views}) > 1 for views in facts)
    lengths = [[seconds for _, seconds in views] for views in facts]
    uneven = sum(max(each) - min(each) > LENGTH_SLACK_SECONDS for each in lengths)
    if sizes:
        notice(
            f"sizes differ between methods in {sizes} of {len(facts)} items; all are shown alike"
        )
    if uneven:
        notice(
            f"lengths differ between methods in {uneven} of {len(facts)} videos, which readers see;"
            " the shorter one waits for the longer"
        )


def _write_page(folder: Path, key: Key, blind: dict[tuple[str, str], str]) -> None:
    """Write the page, the same for every study, and what this study shows in it."""
    data = {
        "id": key.study,
        "asked": key.asked,
        "repeats": key.repeats,
        "questions": [{"id": name, "words": QUESTIONS[name]} for name in key.questions],
        "comparisons": [
            {
                "id": name,
                "source": blind.get((SOURCE, each.item)),
                "a": blind[each.a, each.item],
                "b": blind[each.b, each.item],
            }
            for name, each in key.comparisons.items()
        ],
    }
    # a script, as a page that is opened as a file may not fetch one of another kind
    (folder / DATA_FILE).write_text(f"const STUDY = {json.dumps(data, indent=1)};\n", "utf-8")
    for file in (files("motion_transfer.evaluation.study") / "page").iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    for path in (*folder.rglob("*"), folder):
        os.utime(path, (SAME_TIME_SECONDS, SAME_TIME_SECONDS))
