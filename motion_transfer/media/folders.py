"""Folders of numbered files: their order, and the numbers that are missing."""

from __future__ import annotations

import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

LISTED_GAPS = 5
"""How many missing numbers a message spells out; a line holds no more."""


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """Make a sort key that puts frame_9 before frame_10."""
    return [(0, int(s)) if s.isdigit() else (1, s) for s in re.findall(r"\d+|\D+", name)]


def list_files(folder: Path) -> list[Path]:
    """List what a folder shows, in natural order of the names."""
    seen = (file for file in folder.iterdir() if not file.name.startswith("."))
    return sorted(seen, key=lambda file: natural_key(file.name))


def fill_gaps(files: list[Path]) -> tuple[list[Path], tuple[int, ...]]:
    """Put the file before it in each missing number's place, and tell those numbers.

    Numbers count only where the names differ in nothing else.
    """
    pattern = re.compile(r"(.*?)(\d+)(\D*)$")
    matches = [pattern.match(file.name) for file in files]
    # of two files nobody can tell a gap from their step
    if not all(matches) or len({(m[1], m[3]) for m in matches if m}) != 1 or len(files) < 3:
        return files, ()
    numbers = [int(m[2]) for m in matches if m]
    # every fifth frame of a video was exported: its step is 5, and nothing is missing
    step = Counter(b - a for a, b in pairwise(numbers)).most_common(1)[0][0]
    if step <= 0:
        return files, ()
    held, gaps = [files[0]], []
    for (before, number), file in zip(pairwise(numbers), files[1:], strict=True):
        between = range(before + step, number, step)
        gaps += between
        held += [held[-1]] * len(between) + [file]
    return held, tuple(gaps)


def list_gaps(gaps: tuple[int, ...]) -> str:
    """Tell missing numbers in words, the first few of them one by one."""
    listed = ", ".join(map(str, gaps[:LISTED_GAPS])) + (", ..." if len(gaps) > LISTED_GAPS else "")
    return f"{len(gaps)} missing frame{'s' if len(gaps) > 1 else ''} ({listed})"
