"""The options of a study, each described once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.option import REQUIRED, option

ASKING = "What is asked"
OUTPUT = "Output"
SCORING = "Scoring answers"
MOST_PAIRS = 300  # more than an hour: nobody looks as carefully at the last ones


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """Which methods are compared, of what, and how much of it each reader sees.

    Attributes:
        results: Folders, or `NAME=FOLDER`.
    """

    results: tuple[str, ...] = ()
    sources: Path | None = option(
        "--sources",
        ASKING,
        "Folder of the sources' photos, shown beside each pair; without it, only realism is asked.",
        kind="path",
        metavar="DIR",
    )
    base: str | None = option(
        "--base", ASKING, "Compare this method with each other one; default: all with all."
    )
    per_reader: int = option(
        "--per-reader",
        ASKING,
        "Pairs a reader is shown, chosen at random for each; default 40, about ten minutes.",
        kind="integer",
        default=40,
    )
    repeats: int = option(
        "--repeats",
        ASKING,
        "Pairs shown once more with their sides swapped; default 4.",
        kind="integer",
        default=4,
    )
    output: Path = option(
        "-o --output",
        OUTPUT,
        "Folder for page/ (to send) and key.json (to keep); results/ with --score.",
        kind="path",
        default=REQUIRED,
    )
    force: bool = option(
        "--force", OUTPUT, "Replace earlier output; never answers.", kind="flag", default=False
    )

    def __post_init__(self) -> None:
        if not 1 <= self.per_reader <= MOST_PAIRS:
            raise InputError(f"per-reader is {self.per_reader}; it must lie in 1..{MOST_PAIRS}")
        if self.repeats < 0:
            raise InputError(f"repeats is {self.repeats}; it must be at least 0")


@dataclass(frozen=True, kw_only=True)
class ScoreOptions:
    """Whose answers are counted, and where the results go.

    Attributes:
        output, force: As of `StudyOptions`; by default results/ beside the key.
    """

    score: tuple[Path, ...] = option(
        "--score",
        SCORING,
        "Answers of readers, or folders of them (a study's own: its answers/).",
        kind="paths",
        default=REQUIRED,
        metavar="FILE...",
    )
    key: Path | None = option(
        "--key",
        SCORING,
        "The study's key.json; else it is looked for above the answers.",
        kind="path",
    )
    skip_broken: bool = option(
        "--skip-broken",
        SCORING,
        "Leave out answers that cannot be counted.",
        kind="flag",
        default=False,
    )
    output: Path | None = None
    force: bool = False
