"""What can be chosen on the page without a path: people and motions that come with the program."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from motion_transfer.extras import missing_packages

DEMO = Path(str(files("motion_transfer.demo")))
FIRST_PERSON = DEMO / "source.png"
FIRST_MOTION = DEMO / "driver.mkv"
"""What moves before anybody has chosen a motion: short, and there at once."""


@dataclass(frozen=True)
class Choice:
    """Something to choose.

    Attributes:
        path: As an option takes it.
        name: For the page.
        iuv: Of a photo, where it was named apart.
    """

    path: Path
    name: str
    iuv: Path | None = None


def example_people() -> list[Choice]:
    """List the people that come with the program, none of whom has to be estimated."""
    return [Choice(FIRST_PERSON, "Example person")]


def built_in_motions() -> list[Choice]:
    """List the motions that come with the program, and those that the extra `people` draws."""
    ready = [Choice(FIRST_MOTION, "Dance")]
    if missing_packages("people"):
        return ready
    from motion_transfer.people import MOTIONS

    names = {name: name.replace("-", " ").capitalize() for name in MOTIONS}
    names["dance"] = "Dance, finer"  # the same as the one that is ready, in more and larger frames
    return [*ready, *(Choice(Path(f"people:{name}"), words) for name, words in names.items())]
