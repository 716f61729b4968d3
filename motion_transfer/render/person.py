"""Several people in one IUV image: tell them apart, choose one, follow it.

An IUV image does not say whose a pixel is. People are taken to be its connected regions; a small
region nearby (a hand behind a bag) joins the person it belongs to. People who touch are one region.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from motion_transfer.errors import InputError
from motion_transfer.estimate.choice import choose_box
from motion_transfer.estimate.interface import Box

SMALLEST_SHARE = 0.0005  # of the image; a smaller region alone is a speck, not a person
FRAGMENT_SHARE = 0.25  # of the person; a larger region is somebody else
FRAGMENT_REACH = 0.15  # of the person's longer side; further away is somebody else
SINGLE_PARTS = (1, 2, 23, 24)  # torso and head: a person has one of each


@dataclass(frozen=True)
class Person:
    """A person in one image: the box (half-open, px), pixel count, and regions that make it up."""

    x0: int
    y0: int
    x1: int
    y1: int
    pixels: int
    regions: tuple[int, ...]

    def overlap(self, other: Person) -> float:
        """Intersection over union of the boxes."""
        width = min(self.x1, other.x1) - max(self.x0, other.x0)
        height = min(self.y1, other.y1) - max(self.y0, other.y0)
        shared = max(width, 0) * max(height, 0)
        return shared / (self.area + other.area - shared)

    @property
    def area(self) -> int:
        return (self.x1 - self.x0) * (self.y1 - self.y0)


@dataclass(frozen=True)
class People:
    """Everybody in one image, largest first, and how many regions it has in all."""

    persons: tuple[Person, ...]
    region_count: int


def find_people(iuv: UInt8[np.ndarray, "H W 3"]) -> People:
    """The people of an image; deterministic, so that it can be repeated instead of stored."""
    return _find_people(iuv)[0]


def occupancy(iuv: UInt8[np.ndarray, "H W 3"]) -> UInt8[np.ndarray, "H W"]:
    """1 where anybody is, 0 on the background."""
    return (iuv[..., 0] > 0).astype(np.uint8)


def disc(radius: float) -> UInt8[np.ndarray, "D D"]:
    """A round neighbourhood for growing and shrinking masks; at least one pixel in radius."""
    side = 2 * max(1, round(radius)) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))


def isolate(iuv: UInt8[np.ndarray, "H W 3"], person: Person) -> UInt8[np.ndarray, "H W 3"]:
    """The IUV with everything but one of its people turned into background."""
    _, labels = _find_people(iuv)
    return iuv * person_mask(labels, person)[..., None]


def person_mask(labels: np.ndarray, person: Person) -> Bool[np.ndarray, "H W"]:
    return np.isin(labels, person.regions)


def choose_person(people: People, choice: str, where: str) -> Person:
    """One of the people: `largest`, an index from the left, or the most overlapped by a box.

    Raises: InputError if there is nobody, the index is too high, or the box holds nobody.
    """
    persons = people.persons
    if not persons:
        raise InputError(f"{where}: no person in it, every pixel is background")
    boxes = [Box(p.x0, p.y0, p.x1, p.y1) for p in persons]
    return persons[choose_box(boxes, [p.pixels for p in persons], choice, where)]


def take_as_one(iuv: UInt8[np.ndarray, "H W 3"]) -> People:
    """The people of an image that is known to show one person at most, in however many pieces."""
    rows, columns = (np.flatnonzero(iuv[..., 0].any(axis)) for axis in (1, 0))
    if not len(rows):
        return People((), 0)
    box = int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
    pixels = int(np.count_nonzero(iuv[..., 0]))
    return People((Person(*box, pixels, regions=(1,)),), 1)


def follow(frames: Sequence[People], first: Person) -> list[Person | None]:
    """The same person in every frame, None where it cannot be seen.

    It is the one that overlaps most with where it last was; only somebody of similar size may
    take its place after a jump without overlap, and only if nobody else is there.
    """
    path: list[Person | None] = []
    last = first
    for people in frames:
        best = max(people.persons, key=last.overlap, default=None)
        if best is not None and last.overlap(best) == 0:
            alone = len(people.persons) == 1
            similar = 0.25 < best.area / last.area < 4
            best = best if alone and similar else None
        path.append(best)
        last = best or last
    return path


def _find_people(iuv: UInt8[np.ndarray, "H W 3"]) -> tuple[People, np.ndarray]:
    part = np.ascontiguousarray(iuv[..., 0])
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(
        occupancy(iuv), connectivity=8, ltype=cv2.CV_16U if part.size < 65536 else cv2.CV_32S
    )
    smallest = max(16, SMALLEST_SHARE * part.size)
    by_size = sorted(range(1, count), key=lambda region: -boxes[region, cv2.CC_STAT_AREA])
    persons: list[Person] = []
    for region in by_size:
        x, y, width, height, pixels = (int(value) for value in boxes[region])
        found = Person(x, y, x + width, y + height, pixels, (region,))
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
    gap_x = max(person.x0 - found.x1, found.x0 - person.x1, 0)
    gap_y = max(person.y0 - found.y1, found.y0 - person.y1, 0)
    reach = FRAGMENT_REACH * max(person.x1 - person.x0, person.y1 - person.y0)
    if max(gap_x, gap_y) > reach:
        return False
    own = set(np.unique(_cut(part, person)[np.isin(_cut(labels, person), person.regions)]))
    new = set(np.unique(_cut(part, found)[_cut(labels, found) == found.regions[0]]))
    return not (own & new & set(SINGLE_PARTS))


def _cut(image: np.ndarray, person: Person) -> np.ndarray:
    return image[person.y0 : person.y1, person.x0 : person.x1]


def _join(person: Person, fragment: Person) -> Person:
    return replace(
        person,
        x0=min(person.x0, fragment.x0),
        y0=min(person.y0, fragment.y0),
        x1=max(person.x1, fragment.x1),
        y1=max(person.y1, fragment.y1),
        pixels=person.pixels + fragment.pixels,
        regions=person.regions + fragment.regions,
    )
