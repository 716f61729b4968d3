"""Hands of people in frames that are finished side by side: found once, and steadied in order."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from motion_transfer.estimate.blazepose import details
from motion_transfer.estimate.blazepose.details import DetailsInFrame, fit_details
from motion_transfer.estimate.blazepose.hands import HandModel, first_region
from motion_transfer.estimate.blazepose.retarget import BONES, BodyFit
from motion_transfer.estimate.interface import LANDMARK, Landmarks

SECONDS = 1 / 30


SLOW = 0.1  # seconds; all details are looked at in each frame


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, tuple[str, ...]]]:
    """Frames that were looked at, and for what; in each, details lie at its own number of px."""
    frames: list[tuple[int, tuple[str, ...]]] = []

    def find(frame: np.ndarray, landmarks: Any, names: Any) -> dict:
        number = int(frame[0, 0, 0])
        frames.append((number, tuple(names[0])))
        points = np.random.default_rng(0).random((21, 3)).astype(np.float32) * 50
        return {person: dict.fromkeys(names[person], points + number) for person in landmarks}

    monkeypatch.setattr(details, "_find_details", find)
    return frames


def frame(number: int) -> np.ndarray:
    return np.full((4, 4, 3), number, np.uint8)


def body_at(x: float) -> Any:
    """A seen body, of which only landmarks matter here."""
    sure = np.ones(33, np.float32)
    return SimpleNamespace(
        landmarks=Landmarks(np.full((33, 3), x, np.float32), np.zeros((33, 3)), sure, sure)
    )


def chain(numbers: list[int], seconds: float | None = SLOW) -> list[DetailsInFrame]:
    made: list[DetailsInFrame] = []
    for number in numbers:
        before = made[-1] if made else None
        made.append(DetailsInFrame(frame(number), [(0, body_at(2.0 * number))], before, seconds))
    return made


def test_the_order_of_asking_does_not_matter(looked: list) -> None:
    numbers = [0, 5, 0, 5]
    in_order = [one.work_out()[0]["left"] for one in chain(numbers)]
    made = chain(numbers)
    last = made[3].work_out()[0]["left"]
    assert sorted(number for number, _ in looked[4:]) == sorted(numbers)
    assert np.array_equal(last, in_order[3])
    assert np.array_equal(made[1].work_out()[0]["left"], in_order[1])
    assert len(looked) == 8, "each is looked for once"
    # trembling is calmed
    assert np.abs(in_order[3] - in_order[2]).max() < 5


def test_details_take_turns_and_move_along_meanwhile(looked: list) -> None:
    first, second, third = (one.work_out()[0] for one in chain([0, 1, 2], SECONDS))
    assert looked == [(0, ("left", "right", "face")), (1, ("right",)), (2, ("left", "face"))]
    assert set(first) == set(second) == set(third) == {"left", "right", "face"}
    # landmarks went two pixels to the right and down, the picture's own points one
    moved = second["left"] - first["left"]
    assert moved[:, :2].min() > 1 and moved[:, :2].max() <= 2
    assert moved[:, 2] == pytest.approx(0, abs=1e-5)
    assert (second["right"] - first["right"]).max() <= 1


def test_a_face_that_is_missed_moves_along_for_a_while(
    looked: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = details._find_details

    def miss(frame: np.ndarray, landmarks: Any, names: Any) -> Any:
        found = find(frame, landmarks, names)
        if frame.any():
            for each in found.values():
                each.pop("face", None)
        return found

    monkeypatch.setattr(details, "_find_details", miss)
    monkeypatch.setattr(details, "_looks_aside", lambda _face: False)
    shown = ["face" in one.work_out()[0] for one in chain([0, 1, 2, 3, 4, 5, 6, 7], SECONDS)]
    assert shown == [True] * 6 + [False] * 2  # it was looked for in every other frame
    assert ["face" in one.work_out()[0] for one in chain([0, 1, 2])] == [True, False, False]
    monkeypatch.setattr(details, "_looks_aside", lambda _face: True)
    shown = ["face" in one.work_out()[0] for one in chain([0, 1, 2, 3], SECONDS)]
    assert shown == [True, True, False, False]  # missed in the third


def test_who_is_new_is_looked_at_all_over(looked: list) -> None:
    first = DetailsInFrame(frame(0), [(0, body_at(0))], None, SECONDS)
    second = DetailsInFrame(frame(1), [(0, body_at(0)), (7, body_at(9))], first, SECONDS)
    assert set(second.work_out()[7]) == {"left", "right", "face"}
    assert set(first.work_out()[0]) == set(second.work_out()[0])


def test_photos_are_not_smoothed(looked: list) -> None:
    first, second = (one.work_out()[0]["left"] for one in chain([0, 5], None))
    assert second - first == pytest.approx(5, abs=1e-4)
    assert [number for number, _ in looked] == [0, 5]


def test_a_fitted_body_takes_its_hands_along() -> None:
    image = np.zeros((33, 3), np.float32)
    image[LANDMARK["left-wrist"]] = 10, 20, 0
    sure = np.ones(33, np.float32)
    seen = Landmarks(image, image * 0, sure, sure)
    moved = image.copy()
    moved[LANDMARK["left-wrist"]] = 40, 50, 0
    fitted = Landmarks(moved, image * 0, sure, sure)
    points = np.array([[10, 20, 0], [10, 10, 2]], np.float32)
    fit = BodyFit(dict.fromkeys(BONES, 1.0) | {"lower-arm": 0.5})
    found = fit_details({"left": points}, seen, fitted, fit)["left"]
    assert found.tolist() == [[40, 50, 0], [40, 45, 1]]


def test_a_hands_region_points_along_the_hand() -> None:
    wrist, knuckle = np.array([50.0, 100.0]), np.array([50.0, 80.0])
    region = first_region(wrist, knuckle, knuckle)
    assert region.turn == pytest.approx(0)
    assert region.side == pytest.approx(2 * 2.7 * 20)
    assert region.x == pytest.approx(50)
    assert region.y == pytest.approx(80 - 0.1 * region.side)


@pytest.mark.parametrize(("size", "visibility"), [(3.0, 1.0), (40.0, 0.1)])
def test_small_and_hidden_hands_are_left_alone(models, size: float, visibility: float) -> None:
    image = np.full((33, 3), 200, np.float32)
    image[LANDMARK["left-index"], 1] -= size
    image[LANDMARK["left-pinky"], 1] -= size
    chance = np.full(33, visibility, np.float32)
    landmarks = Landmarks(image, np.zeros((33, 3), np.float32), chance, chance)
    picture = np.random.default_rng(0).integers(0, 256, (400, 400, 3), np.uint8)
    assert HandModel().find(picture, landmarks, "left") is None
