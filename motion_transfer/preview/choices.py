"""What can be chosen on the page: what comes with the program, and what was dropped."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.extras import missing_packages
from motion_transfer.option import SCENES
from motion_transfer.render.inputs import find_source_iuv, iuv_names
from motion_transfer.render.options import Garment, RenderOptions, parse_parts

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


class Choices:
    """Photos, motions and backgrounds, each known by its place in its list, which only grows.

    Its methods may be called from several threads.

    Attributes:
        photos: Sources and garments.
        examples: The places of those photos that come with the program.
    """

    def __init__(self, options: RenderOptions, *, is_empty: bool) -> None:
        """Begin with what comes with the program, and with what the options name.

        Args:
            is_empty: Whether the options' source only stands in for one that nobody has chosen.
        """
        own = [] if is_empty else [Choice(path, path.name, iuv) for path, iuv in options.sources]
        examples = example_people()
        self.examples = range(len(own), len(own) + len(examples))
        garments = [Choice(each.photo, each.photo.name, each.iuv) for each in options.garments]
        self.photos = [*own, *examples, *garments]
        self.motions = built_in_motions()
        self._backgrounds = [str(path)] if (path := options.background_file) else []
        self._growing = threading.Lock()

    def know_photo(self, path: Path) -> int:
        """Take a file as a source or garment to choose; returns its number."""
        with self._growing:
            self.photos.append(Choice(path, path.name))
            return len(self.photos) - 1

    def know_motion(self, path: Path) -> int:
        """Take a file, a folder or a motion's name as one to choose; returns its number."""
        if path.suffix.lower() == ".bvh" and not str(path).startswith("people:"):
            path = Path(f"people:{path}")
        with self._growing:
            for number, motion in enumerate(self.motions):
                if motion.path == path:
                    return number
            self.motions.append(Choice(path, path.name))
            return len(self.motions) - 1

    def know_background(self, path: Path) -> str:
        """Take a file as a background to choose; returns how it is called as an option."""
        with self._growing:
            if str(path) not in self._backgrounds:
                self._backgrounds.append(str(path))
        return str(path)

    def photo(self, number: int) -> Choice:
        """Find a photo. Raises: InputError if there is none of this number."""
        return _find(self.photos, number, "source")

    def motion(self, number: int) -> Choice:
        """Find a motion. Raises: InputError if there is none of this number."""
        return _find(self.motions, number, "motion")

    def join_motions(self, numbers: Sequence[int]) -> int:
        """Find the motion that these make: one, or the folder of frames that were sent together.

        Raises: InputError if there is none of one of these numbers, or no number.
        """
        if not numbers:
            raise InputError("no motion; choose one of those that are there")
        found = [self.motion(number) for number in numbers]
        return numbers[0] if len(numbers) == 1 else self.know_motion(found[0].path.parent)

    def backgrounds(self, *, driver: bool, photo: bool) -> list[str]:
        """List the backgrounds that can be chosen; colours can be any.

        Args:
            driver: Whether the driver has pictures, to be seen behind.
            photo: Whether there is a source.
        """
        missing = {word for word, there in (("driver", driver), ("photo", photo)) if not there}
        shown = [word for word in SCENES if word not in missing]
        return ["white", "black", *shown, *self._backgrounds]

    def sources(self, numbers: Sequence[int]) -> dict[int, Choice]:
        """Find photos to draw, by their numbers, each with its IUV if one was named with any.

        Raises: InputError for one that does not exist, or lacks IUV where another has it.
        """
        known = self._without_iuv(numbers)
        if not known:
            raise InputError("no source; choose one of those that are there")
        if not any(each.iuv for each in known.values()):
            return known
        named = {
            number: replace(each, iuv=each.iuv or find_source_iuv(each.path))
            for number, each in known.items()
        }
        for each in named.values():
            if each.iuv is None:
                raise InputError(
                    "the IUV of one source was named, and there is none of another; drop that of"
                    f" {each.path.name} together with it, called STEM_IUV.png, or start again"
                    " without --source-iuv"
                )
        return named

    def garments(self, chosen: Sequence[tuple[int, str]]) -> list[tuple[int, Garment]]:
        """Find parts of photos to wear: each photo's number, and its parts or groups of them.

        Raises: InputError for a photo or a part that does not exist.
        """
        photos = self._without_iuv([number for number, _ in chosen])
        return [
            (number, Garment(photo=photo.path, parts=parse_parts(parts), iuv=photo.iuv))
            for number, parts in chosen
            if (photo := photos.get(number)) is not None
        ]

    def _without_iuv(self, numbers: Iterable[int]) -> dict[int, Choice]:
        """Find photos; IUV that was dropped along with one of them is none."""
        known = {number: self.photo(number) for number in numbers}
        iuv = {name for each in known.values() for name in iuv_names(each.path)}
        return {number: each for number, each in known.items() if each.path not in iuv}


def _find(choices: Sequence[Choice], number: int, what: str) -> Choice:
    if not 0 <= number < len(choices):
        raise InputError(f"there is no {what} {number}; choose one of those that are there")
    return choices[number]


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
