"""Where people are in the output: as in the driver, at a place, on the spot, on the ground."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from motion_transfer.drawing.person import Box, Person
from motion_transfer.drawing.window import Window
from motion_transfer.render.placing import place_in_square, place_people
from motion_transfer.render.plan import DriverPlan, FramePlan, Shot

DRIVER = (200, 300)


@dataclass(frozen=True)
class Wish:
    place: str | None = None
    on_the_spot: bool = False


def plan(boxes: list[Box | None], *, cut: int | None = None) -> DriverPlan:
    frames = tuple(
        FramePlan(None if box is None else Person(box, box.area, (1,)), alone=True) for box in boxes
    )
    ends = [0, len(boxes)] if cut is None else [0, cut, len(boxes)]
    shots = tuple(Shot(start, stop, Window(10 + start, 20, 128)) for start, stop in pairwise(ends))
    return DriverPlan(0, frames, shots, Fraction(30))


def standing(count: int = 30, *, x: int = 60, bottom: int = 140) -> list[Box | None]:
    return [Box(x, bottom - 100, x + 40, bottom)] * count


def walking(count: int = 90) -> list[Box | None]:
    return [Box(20 + 2 * i, 40, 60 + 2 * i, 140) for i in range(count)]


def test_without_wishes_everybody_stays() -> None:
    (spots,) = place_people([plan(walking())], Wish(), DRIVER, DRIVER)
    assert {spot.window for spot in spots} == {Window(10, 20, 128)}
    (even,) = place_people([plan(walking())], Wish(), (199, 299), DRIVER)
    assert {spot.window for spot in even} == {Window(10, 20, 128)}


def test_another_frame_holds_the_drivers() -> None:
    (spots,) = place_people([plan(standing())], Wish(), DRIVER, (400, 1000))
    assert {spot.window for spot in spots} == {Window(200 + 20, 40, 256)}
    assert {spot.ground for spot in spots} == {280}


@pytest.mark.parametrize("output", [(200, 300), (400, 1000)])
def test_feet_stand_at_the_place(output: tuple[int, int]) -> None:
    fitted = min(output[0] / 200, output[1] / 300)
    (spots,) = place_people([plan(standing())], Wish("0.25,0.9,1.5"), DRIVER, output)
    scale = 1.5 * fitted
    spot = spots[7]
    assert spot.window.side == round(128 * scale)
    feet_x = spot.window.x + (80 - 10) * scale
    feet_y = spot.window.y + (140 - 20) * scale
    assert feet_x == pytest.approx(0.25 * output[1], abs=1)
    assert feet_y == pytest.approx(0.9 * output[0], abs=1)
    assert spot.ground == pytest.approx(0.9 * output[0], abs=1)


def test_a_place_keeps_the_path() -> None:
    (spots,) = place_people([plan(walking())], Wish("0.5,0.5,2"), DRIVER, DRIVER)
    assert len({spot.window for spot in spots}) == 1  # the window holds the whole walk


def test_on_the_spot_the_window_goes_against_the_walk() -> None:
    (spots,) = place_people([plan(walking())], Wish(on_the_spot=True), DRIVER, DRIVER)
    feet = np.array([spot.window.x + (40 + 2 * i - 10) for i, spot in enumerate(spots)])
    assert np.abs(feet[36:-36] - feet[36]).max() <= 1  # but for the ends, which are smoothed
    assert spots[0].window == Window(10, 20, 128)


def test_a_jump_leaves_the_ground_where_it_is() -> None:
    jump = [
        Box(60, 40 - h, 100, 140 - h) for h in [0] * 40 + [10, 25, 35, 40, 35, 25, 10] + [0] * 40
    ]
    (spots,) = place_people([plan(jump)], Wish(on_the_spot=True), DRIVER, DRIVER)
    assert {spot.ground for spot in spots} == {140}
    assert len({spot.window for spot in spots}) == 1


def test_in_the_square_the_ground_is_under_the_feet() -> None:
    spots = place_in_square(plan(standing(bottom=140)), 256)
    assert {spot.window for spot in spots} == {Window(0, 0, 256)}
    assert {spot.ground for spot in spots} == {(140 - 20) * 2}


def test_each_shot_begins_at_the_place() -> None:
    boxes = standing(40, x=60) + standing(40, x=200)
    (spots,) = place_people([plan(boxes, cut=40)], Wish("0.5,0.9,1"), DRIVER, DRIVER)
    for spot, x, window_x in ((spots[0], 80, 10), (spots[79], 220, 50)):
        assert spot.window.x + x - window_x == pytest.approx(150, abs=1)


def test_partners_keep_their_distance_to_who_leads() -> None:
    lead, partner = standing(x=60, bottom=140), standing(x=160, bottom=130)
    first, second = place_people([plan(lead), plan(partner)], Wish("0.5,0.9,0.5"), DRIVER, DRIVER)
    assert first[0].window == second[0].window
    assert first[0].ground - second[0].ground == 5


def test_where_nobody_is_found_the_way_goes_on() -> None:
    boxes = walking()
    boxes[30:40] = [None] * 10
    (gaps,), (whole,) = (
        place_people([plan(each)], Wish(on_the_spot=True), DRIVER, DRIVER)
        for each in (boxes, walking())
    )
    assert max(abs(a.window.x - b.window.x) for a, b in zip(gaps, whole, strict=True)) <= 1
    (alone,) = place_people([plan([None] * 5 + standing(5), cut=5)], Wish("0,0,1"), DRIVER, DRIVER)
    assert len(alone) == 10
