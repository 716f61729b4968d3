"""Numbered frames, files of a folder or photos of a dump: their order, and what is missing."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from motion_transfer.errors import InputError

LISTED_GAPS = 5
"""How many missing numbers, or names, a message spells out; a line holds no more."""

MOST_GAPS = 1_000_000
"""How many missing numbers are filled: nine hours of frames. More are no numbers of frames."""


@dataclass(frozen=True)
class Numbering:
    """What the frames of a sequence are by the numbers in its names.

    Attributes:
        order: For each frame the index of the name that it shows.
        gaps: The numbers that are missing.
        held: The frames in their places, which show what the frame before them does.
    """

    order: Sequence[int]
    gaps: tuple[int, ...] = ()
    held: frozenset[int] = frozenset()


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """Make a sort key that puts frame_9 before frame_10."""
    return [(0, int(s)) if s.isdecimal() else (1, s) for s in re.findall(r"\d+|\D+", name)]


def list_files(folder: Path) -> list[Path]:
    """List what a folder shows, in natural order of the names."""
    seen = (file for file in folder.iterdir() if not file.name.startswith("."))
    return sorted(seen, key=lambda file: natural_key(file.name))


def describe_rest(
    folder: Path, frames: Sequence[Path], beside: Collection[Path] = ()
) -> tuple[str, ...]:
    """Say what lies in a folder and is not read; nothing where there is nothing else.

    Args:
        frames: What is read, in order.
        beside: What belongs to that, and is no news.
    Returns: One sentence, or none.
    """
    known = {*frames, *beside}
    rest = [f"{item.name}{'/' * item.is_dir()}" for item in list_files(folder) if item not in known]
    if not rest:
        return ()
    read = frames[0].name if len(frames) == 1 else f"{frames[0].name} to {frames[-1].name}"
    more = f" and {len(rest) - LISTED_GAPS} more" if len(rest) > LISTED_GAPS else ""
    return (f"of {folder}, {read} is read, and not {', '.join(rest[:LISTED_GAPS])}{more}",)


def number_frames(names: Sequence[str], what: str) -> Numbering:
    """Put names in natural order, and the one before into each missing number's place.

    Numbers count only where the names differ in nothing else.

    Args:
        what: What the names are of, for messages.
    Raises: InputError if more numbers are missing than can be filled.
    """
    order = sorted(range(len(names)), key=lambda index: natural_key(names[index]))
    pattern = re.compile(r"(.*?)(\d+)(\D*)$")
    matches = [pattern.match(names[index]) for index in order]
    # of two files nobody can tell a gap from their step
    if not all(matches) or len({(m[1], m[3]) for m in matches if m}) != 1 or len(order) < 3:
        return Numbering(order)
    numbers = [int(m[2]) for m in matches if m]
    # every fifth frame of a video was exported: its step is 5, and nothing is missing
    step = Counter(b - a for a, b in pairwise(numbers)).most_common(1)[0][0]
    if step <= 0:
        return Numbering(order)
    missing = [range(a + step, b, step) for a, b in pairwise(numbers)]
    if (numbers[-1] - numbers[0]) // step - len(order) > MOST_GAPS:
        raise InputError(
            f"{what}: more than {MOST_GAPS:,} numbers are missing among those of its frames; number"
            " them consecutively"
        )
    filled, held = order[:1], set()
    for between, index in zip(missing, order[1:], strict=True):
        held.update(range(len(filled), len(filled) + len(between)))
        filled += [filled[-1]] * len(between) + [index]
    return Numbering(filled, tuple(n for between in missing for n in between), frozenset(held))


def list_gaps(gaps: tuple[int, ...]) -> str:
    """Tell missing numbers in words, the first few of them one by one."""
    listed = ", ".join(map(str, gaps[:LISTED_GAPS])) + (", ..." if len(gaps) > LISTED_GAPS else "")
    return f"{len(gaps)} missing frame{'s' if len(gaps) > 1 else ''} ({listed})"
