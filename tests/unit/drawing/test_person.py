"""Several people in one image: told apart, chosen, followed."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.drawing.person import (
    Box,
    Follower,
    People,
    Person,
    choose_person,
    find_people,
    isolate,
)
from motion_transfer.errors import InputError

SIZE = (100, 300)


def crowd(studio, *people: tuple[int, int, int]) -> np.ndarray:
    """People given as x, y and scale in halves: 2 is the whole mannequin, 1 every other pixel."""
    image = np.zeros((*SIZE, 3), np.uint8)
    for x, y, scale in people:
        figure = studio.iuv()[:: 3 - scale, :: 3 - scale]
        place = image[y : y + figure.shape[0], x : x + figure.shape[1]]
        np.copyto(place, figure[: place.shape[0], : place.shape[1]])
    return image


SMALL, BIG, MIDDLE = (10, 10, 1), (80, 2, 2), (200, 40, 1)


def test_people_are_counted_largest_first(studio) -> None:
    people = find_people(crowd(studio, SMALL, BIG, MIDDLE)).persons
    assert len(people) == 3
    assert people[0].box.left == 80 + 14
    assert people[0].pixels > people[1].pixels


@pytest.mark.parametrize(
    ("choice", "left"),
    [("largest", 94), ("0", 17), ("1", 94), ("2", 207), ("190,30,260,99", 207), ("0,0,60,60", 17)],
)
def test_choice(studio, choice: str, left: int) -> None:
    people = find_people(crowd(studio, SMALL, BIG, MIDDLE))
    assert choose_person(people, choice, "here").box.left == left


@pytest.mark.parametrize(
    ("choice", "reason"),
    [
        ("3", "here: person 3 asked for, but only 3 found"),
        ("270,0,299,10", "here: nobody in the box 270,0,299,10; people are at 94,6,130,95"),
        ("-1", "person '-1'; write largest"),
        ("left", "person 'left'; write largest"),
        ("1,2,3", "person '1,2,3'; write largest"),
        ("9,9,5,20", "person '9,9,5,20'; write largest"),
        ("", "person ''; write largest"),
    ],
)
def test_bad_choice(studio, choice: str, reason: str) -> None:
    people = find_people(crowd(studio, SMALL, BIG, MIDDLE))
    with pytest.raises(InputError, match=reason):
        choose_person(people, choice, "here")


def test_nobody_there() -> None:
    people = find_people(np.zeros((*SIZE, 3), np.uint8))
    assert people == People((), 0)
    with pytest.raises(InputError, match="here: no person in it"):
        choose_person(people, "largest", "here")


def test_a_speck_is_nobody(studio) -> None:
    image = crowd(studio, BIG)
    image[0, 0] = (2, 9, 9)
    assert len(find_people(image).persons) == 1


def test_a_floating_hand_joins_its_person(studio) -> None:
    image = studio.iuv(parts=(2, 23, 24, 9, 10, 13, 14))
    image[50:56, 46:50] = (4, 50, 50)
    people = find_people(image)
    assert people.region_count == 2
    (person,) = people.persons
    assert person.pixels == (image[..., 0] > 0).sum()
    np.testing.assert_array_equal(isolate(image, person), image)


def test_a_second_head_does_not_join(studio) -> None:
    image = studio.iuv(size=(96, 90))
    image[10:22, 60:72] = (23, 50, 50)  # somebody behind, of whom only the head shows
    first, second = find_people(image).persons
    assert second.pixels == 12 * 12
    assert not isolate(image, first)[10:22, 60:72].any()


def test_a_hand_far_away_does_not_join(studio) -> None:
    image = studio.iuv(size=(96, 200))
    image[50:60, 150:160] = (3, 50, 50)
    assert len(find_people(image).persons) == 2


def test_isolating_leaves_one_person(studio) -> None:
    image = crowd(studio, SMALL, BIG)
    people = find_people(image)
    np.testing.assert_array_equal(isolate(image, people.persons[0]), crowd(studio, BIG))
    np.testing.assert_array_equal(isolate(image, people.persons[1]), crowd(studio, SMALL))


def box(x: int, side: int = 20, y: int = 0) -> Person:
    return Person(Box(x, y, x + side, y + side), side * side, (1,))


def people(*persons: Person) -> People:
    return People(tuple(sorted(persons, key=lambda person: -person.pixels)), len(persons))


def follow(frames: list[People], first: Person) -> list[Person | None]:
    """The path of somebody who is chosen by the place in the first frame."""
    where = first.box
    follower = Follower[Person](f"{where.left},{where.top},{where.right},{where.bottom}")
    picked = [follower.pick(frame.persons, "here") for frame in frames]
    return [found[0] if found else None for found in picked]


@pytest.mark.parametrize(
    ("path", "others"),
    [
        ([box(0), box(5), box(10)], [box(100, 10), box(100, 30), box(100, 60)]),
        ([box(0), box(8), box(16), box(24)], [box(60), box(52), box(44), box(40)]),
        ([box(50), box(45), box(40)], [box(0), box(70), box(0)]),
    ],
    ids=["another grows larger", "two approach", "another changes sides"],
)
def test_the_same_person_is_followed(path: list[Person], others: list[Person]) -> None:
    frames = [people(own, other) for own, other in zip(path, others, strict=True)]
    assert follow(frames, path[0]) == path


def test_two_people_pass_each_other(studio) -> None:
    """The one chosen at the left keeps walking right, above the other, who walks left."""
    images = [crowd(studio, (10 * i, 0, 1), (90 - 10 * i, 50, 1)) for i in range(10)]
    found = [find_people(image) for image in images]
    path = follow(found, choose_person(found[0], "0", "here"))
    assert [person.box.left for person in path if person] == [10 * i + 7 for i in range(10)]


def test_absence_is_none_and_the_person_is_found_again() -> None:
    frames = [people(box(0)), people(), people(box(100)), people(box(100), box(2))]
    path = follow([*frames[:2], *frames[3:]], box(0))
    assert path == [box(0), None, box(2)]


def test_only_somebody_alike_and_alone_is_the_same_after_a_jump() -> None:
    assert follow([people(box(0)), people(box(100, 22))], box(0))[1] == box(100, 22)
    assert follow([people(box(0)), people(box(100, 60))], box(0))[1] is None
    assert follow([people(box(0)), people(box(100), box(200))], box(0))[1] is None
