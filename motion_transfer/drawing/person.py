"""The people of a picture: where they are, which is meant, and the same one in the next frame.

An IUV image does not say whose a pixel is. People are taken to be its connected regions; a small
region nearby (a hand behind a bag) joins the person it belongs to. People who touch are one region.

Convention: pixel centres lie at +0.5, x to the right, y down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from motion_transfer.errors import InputError

EVERYBODY = "all"

SIMILAR = 4.0
"""Somebody whose box has more than so many times the area, or less, is somebody else."""

SMALLEST_SHARE = 0.0005  # of the image; a smaller region alone is a speck, not a person
FRAGMENT_SHARE = 0.25  # of the person; a larger region is somebody else
FRAGMENT_REACH = 0.15  # of the person's longer side; further away is somebody else
SINGLE_PARTS = (1, 2, 23, 24)  # torso and head: a person has one of each

COVERS = 128
"""Alpha, 0..255, from which a pixel is the person's."""


@dataclass(frozen=True)
class Box:
    """Whole pixels of a frame: columns left..right, rows top..bottom, the ends not included."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def width(self) -> int:
        return self.right - self.left

    @property
    def height(self) -> int:
        return self.bottom - self.top

    @property
    def area(self) -> int:
        return self.width * self.height

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, to index an array with."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def grown(self, room: int) -> Box:
        """Take so many pixels around it as well, which may lie beyond the frame's far edges."""
        left, top = max(0, self.left - room), max(0, self.top - room)
        return Box(left, top, self.right + room, self.bottom + room)

    def overlap(self, other: Box) -> float:
        """Measure the intersection over union, 0..1."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.bottom, other.bottom) - max(self.top, other.top)
        shared = max(width, 0) * max(height, 0)
        return shared / max(1, self.area + other.area - shared)


@dataclass(frozen=True)
class Person:
    """A person in one IUV image.

    Attributes:
        box: Holds the person.
        pixels: How many of the image's pixels are the person's.
        regions: The connected regions that make the person up, as `find_people` numbers them.
        track: None, as an IUV image alone does not say who somebody is.
    """

    box: Box
    pixels: int
    regions: tuple[int, ...]
    track: int | None = None


@dataclass(frozen=True)
class People:
    """Everybody in one image, largest first, and how many regions it has in all."""

    persons: tuple[Person, ...]
    region_count: int

    def shows_only(self, person: Person) -> bool:
        """Tell whether the image shows nothing but this person, not even specks."""
        return len(person.regions) == self.region_count


def occupancy(iuv: UInt8[np.ndarray, "H W 3"]) -> UInt8[np.ndarray, "H W"]:
    """Mark where anybody is: 1, and 0 on the background."""
    return (iuv[..., 0] > 0).astype(np.uint8)


def bounding_box(iuv: UInt8[np.ndarray, "H W 3"]) -> Box:
    """Find the smallest box around everything that is not background; empty where all of it is."""
    left, top, width, height = cv2.boundingRect(occupancy(iuv))
    return Box(left, top, left + width, top + height)


def disc(radius: float) -> UInt8[np.ndarray, "D D"]:
    """Make a round neighbourhood for growing and shrinking masks, at least one pixel in radius."""
    side = 2 * max(1, round(radius)) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))


def find_people(iuv: UInt8[np.ndarray, "H W 3"]) -> People:
    """Find the people of an image; deterministic, so that it can be repeated instead of stored."""
    return _find_people(iuv)[0]


def take_as_one(iuv: UInt8[np.ndarray, "H W 3"]) -> People:
    """Take an image that is known to show one person at most, in however many pieces."""
    pixels = int(np.count_nonzero(iuv[..., 0]))
    if not pixels:
        return People((), 0)
    return People((Person(bounding_box(iuv), pixels, regions=(1,)),), 1)


def isolate(iuv: UInt8[np.ndarray, "H W 3"], person: Person) -> UInt8[np.ndarray, "H W 3"]:
    """Turn everything of an image but one of its people into background."""
    _, labels = _find_people(iuv)
    return iuv * person_mask(labels, person)[..., None]


def person_mask(labels: np.ndarray, person: Person) -> Bool[np.ndarray, "H W"]:
    """Mark the pixels of one person, given the region that each pixel belongs to."""
    return np.isin(labels, person.regions)


def choose_person(people: People, choice: str, where: str) -> Person:
    """Choose one of the people of an image, see `choose_box`.

    Raises: InputError if there is nobody, the index is too high, or the box holds nobody.
    """
    persons = people.persons
    if not persons:
        raise InputError(f"{where}: no person in it, every pixel is background")
    return persons[choose_box([p.box for p in persons], [p.pixels for p in persons], choice, where)]


def parse_person(choice: str) -> tuple[int, ...]:
    """Read the index or box in a choice other than `largest`. Raises: InputError."""
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
    """Choose one of several people.

    Args:
        boxes: One or more.
        pixels: How many each of them has.
        choice: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px, which
            means the person that it overlaps most.
        where: Names the picture, for messages.
    Returns: The place of the chosen one in `boxes`.
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


class Located(Protocol):
    """Somebody in a frame, found in whatever way.

    Attributes:
        box: Holds the person.
        pixels: How many of the frame's pixels are the person's.
        track: The same number for the same person in all frames of a shot; None where nobody says.
    """

    @property
    def box(self) -> Box: ...
    @property
    def pixels(self) -> int: ...
    @property
    def track(self) -> int | None: ...


Somebody = TypeVar("Somebody", bound=Located)


class Follower(Generic[Somebody]):
    """Follows one person through a clip: chosen where somebody is first seen, then found again.

    In later shots the person is chosen anew; whom the choice does not find there, the largest
    replaces.

    Args:
        choice: As that of `choose_box`, or `all`.
    Raises: InputError for a choice that is none.
    """

    def __init__(self, choice: str) -> None:
        if choice not in (EVERYBODY, "largest"):
            parse_person(choice)
        self._choice = choice
        self._first_shot = True
        self._last: Somebody | None = None

    def start_shot(self) -> None:
        """Forget where the person was: the next frame has nothing to do with the last one."""
        self._first_shot = self._first_shot and self._last is None
        self._last = None

    def pick(self, people: Sequence[Somebody], where: str) -> list[Somebody]:
        """Pick the chosen of a frame's people: everybody, one, or nobody.

        Raises: InputError if the choice means nobody where people are first seen.
        """
        seen = [person for person in people if person.pixels]
        if self._choice == EVERYBODY or not seen:
            return seen
        found = self._choose(seen, where) if self._last is None else find_again(seen, self._last)
        self._last = found or self._last
        return [found] if found else []

    def _choose(self, seen: list[Somebody], where: str) -> Somebody:
        boxes, pixels = [person.box for person in seen], [person.pixels for person in seen]
        try:
            return seen[choose_box(boxes, pixels, self._choice, where)]
        except InputError:
            if self._first_shot:
                raise
            return seen[choose_box(boxes, pixels, "largest", where)]


def find_again(seen: Sequence[Somebody], last: Somebody) -> Somebody | None:
    """Find a person in a later frame: by track; lost and found, by place; alone, by size."""
    for person in seen:
        if person.track is not None and person.track == last.track:
            return person
    best = max(seen, key=lambda person: person.box.overlap(last.box), default=None)
    if best is None or best.box.overlap(last.box) > 0:
        return best
    growth = best.box.area / max(1, last.box.area)
    return best if len(seen) == 1 and 1 / SIMILAR < growth < SIMILAR else None


def _find_people(iuv: UInt8[np.ndarray, "H W 3"]) -> tuple[People, np.ndarray]:
    part = np.ascontiguousarray(iuv[..., 0])
    occupied = cv2.threshold(part, 0, 1, cv2.THRESH_BINARY)[1]
    x, y, width, height = cv2.boundingRect(occupied)
    # regions are numbered in 2 x 2 blocks: from an even pixel on as they would be in the whole
    left, top = x & ~1, y & ~1
    inhabited = np.s_[top : y + height, left : x + width]
    labels = np.zeros(part.shape, np.int32)
    if not width:
        return People((), 0), labels
    few = (height // 2 + 1) * (width // 2 + 1) < 2**16  # 16 bits take a third of the time
    count, labels[inhabited], stats, _ = cv2.connectedComponentsWithStats(
        occupied[inhabited], connectivity=8, ltype=cv2.CV_16U if few else cv2.CV_32S
    )
    stats[:, : cv2.CC_STAT_TOP + 1] += left, top
    # an eye or a finger of 16 pixels must not become somebody, however small the image is
    smallest = max(16, SMALLEST_SHARE * part.size)
    by_size = sorted(range(1, count), key=lambda region: -stats[region, cv2.CC_STAT_AREA])
    persons: list[Person] = []
    for region in by_size:
        x, y, width, height, pixels = (int(value) for value in stats[region])
        found = Person(Box(x, y, x + width, y + height), pixels, (region,))
        owner = next(
            (i for i, p in enumerate(persons) if _is_fragment(found, p, part, labels)), None
        )
        if owner is not None:
            persons[owner] = _join(persons[owner], found)
        elif pixels >= smallest:
            persons.append(found)
    return People(tuple(sorted(persons, key=lambda p: -p.pixels)), count - 1), labels


def _is_fragment(found: Person, person: Person, part: np.ndarray, labels: np.ndarray) -> bool:
    if found.pixels > FRAGMENT_SHARE * person.pixels:
        return False
    new, own = found.box, person.box
    gap_x = max(own.left - new.right, new.left - own.right, 0)
    gap_y = max(own.top - new.bottom, new.top - own.bottom, 0)
    if max(gap_x, gap_y) > FRAGMENT_REACH * max(own.width, own.height):
        return False
    shown = set(np.unique(part[own.slices][np.isin(labels[own.slices], person.regions)]))
    added = set(np.unique(part[new.slices][labels[new.slices] == found.regions[0]]))
    # a second head or trunk is somebody else's
    return not (shown & added & set(SINGLE_PARTS))


def _join(person: Person, fragment: Person) -> Person:
    one, other = person.box, fragment.box
    return replace(
        person,
        box=Box(
            min(one.left, other.left),
            min(one.top, other.top),
            max(one.right, other.right),
            max(one.bottom, other.bottom),
        ),
        pixels=person.pixels + fragment.pixels,
        regions=person.regions + fragment.regions,
    )
