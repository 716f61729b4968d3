"""Which of several people: in one frame, and through a clip."""

from __future__ import annotations

from collections.abc import Sequence

from motion_transfer.errors import InputError
from motion_transfer.estimate.interface import Box, PersonEstimate

EVERYBODY = "all"
SIMILAR = 4.0
"""Somebody whose box has more than so many times the area, or less, is somebody else."""


def parse_person(choice: str) -> tuple[int, ...]:
    """The index or box in a choice other than `largest`. Raises: InputError."""
    try:
        numbers = tuple(int(number) for number in choice.split(","))
    except ValueError:
        numbers = ()
    box = len(numbers) == 4 and numbers[0] < numbers[2] and numbers[1] < numbers[3]
    if not box and not (len(numbers) == 1 and numbers[0] >= 0):
        raise InputError(
            f"person {choice!r}; write largest, an index from the left (0 first), or a box"
            " x0,y0,x1,y1 in pixels"
        )
    return numbers


def choose_box(boxes: Sequence[Box], pixels: Sequence[int], choice: str, where: str) -> int:
    """Which of the people: `largest`, an index from the left, or the most overlapped by a box.

    Args:
        boxes: one or more; pixels: how many each of them has.
    Raises: InputError if the index is too high, or the box holds nobody.
    """
    everyone = range(len(boxes))
    if choice == "largest":
        return max(everyone, key=lambda i: pixels[i])
    numbers = parse_person(choice)
    if len(numbers) == 1:
        if numbers[0] >= len(boxes):
            raise InputError(
                f"{where}: person {numbers[0]} asked for, but only {len(boxes)} found"
                f" (they count from 0, from the left)"
            )
        return sorted(everyone, key=lambda i: boxes[i].left + boxes[i].right)[numbers[0]]
    wanted = Box(*numbers)
    best = max(everyone, key=lambda i: wanted.overlap(boxes[i]))
    if wanted.overlap(boxes[best]) == 0:
        listed = "; ".join(f"{b.left},{b.top},{b.right},{b.bottom}" for b in boxes)
        raise InputError(f"{where}: nobody in the box {choice}; people are at {listed}")
    return best


class Follower:
    """One person of a clip: chosen where somebody is first seen, then kept by its track.

    In later shots it is chosen anew; whom the choice does not find there, the largest replaces.

    Args:
        choice: as `choose_box`'s, or `all`.
    Raises: InputError for a choice that is none.
    """

    def __init__(self, choice: str) -> None:
        if choice not in (EVERYBODY, "largest"):
            parse_person(choice)
        self._choice = choice
        self._first_shot = True
        self._last: PersonEstimate | None = None

    def start_shot(self) -> None:
        """Whoever comes next has nothing to do with the last frame."""
        self._first_shot = self._first_shot and self._last is None
        self._last = None

    def pick(self, people: Sequence[PersonEstimate], where: str) -> list[PersonEstimate]:
        """The chosen of a frame's people: everybody, one, or nobody.

        Raises: InputError if the choice means nobody where people are first seen.
        """
        seen = [person for person in people if person.iuv[..., 0].any()]
        if self._choice == EVERYBODY or not seen:
            return seen
        found = self._choose(seen, where) if self._last is None else self._again(seen, self._last)
        self._last = found or self._last
        return [found] if found else []

    def _choose(self, seen: list[PersonEstimate], where: str) -> PersonEstimate:
        boxes = [person.box for person in seen]
        pixels = [int((person.iuv[..., 0] > 0).sum()) for person in seen]
        try:
            return seen[choose_box(boxes, pixels, self._choice, where)]
        except InputError:
            if self._first_shot:
                raise
            return seen[choose_box(boxes, pixels, "largest", where)]

    @staticmethod
    def _again(seen: list[PersonEstimate], last: PersonEstimate) -> PersonEstimate | None:
        """The same person: by its track; lost and found, by its place; alone, by its size."""
        for person in seen:
            if person.track == last.track:
                return person
        best = max(seen, key=lambda person: person.box.overlap(last.box))
        if best.box.overlap(last.box) > 0:
            return best
        growth = best.box.width * best.box.height / max(1, last.box.width * last.box.height)
        return best if len(seen) == 1 and 1 / SIMILAR < growth < SIMILAR else None
