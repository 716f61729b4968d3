"""Hands of people in frames that are finished side by side: found once, and steadied in order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from motion_transfer.estimate.blazepose import details
from motion_transfer.estimate.blazepose.details import DetailsInFrame, fit_details
from motion_transfer.estimate.blazepose.hands import HandModel, first_region
from motion_transfer.estimate.blazepose.retarget import BONES, BodyFit
from motion_transfer.estimate.interface import LANDMARK, Landmarks

SECONDS = 1 / 30


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Frames in which hands were looked for; each has a left hand at its own number of pixels."""
    frames: list[int] = []

    def find(frame: np.ndarray, people: Any) -> dict:
        number = int(frame[0, 0, 0])
        frames.append(number)
        points = np.random.default_rng(0).random((21, 3)).astype(np.float32) * 50
        return {person: {"left": points + number} for person, _ in people}

    monkeypatch.setattr(details, "_find_details", find)
    return frames


def frame(number: int) -> np.ndarray:
    return np.full((4, 4, 3), number, np.uint8)


def chain(numbers: list[int], seconds: float | None = SECONDS) -> list[DetailsInFrame]:
    made: list[DetailsInFrame] = []
    for number in numbers:
        before = made[-1] if made else None
        made.append(DetailsInFrame(frame(number), [(0, None)], before, seconds))  # pyright: ignore[reportArgumentType]
    return made


def test_the_order_of_asking_does_not_matter(looked: list[int]) -> None:
    numbers = [0, 5, 0, 5]
    in_order = [one.work_out()[0]["left"] for one in chain(numbers)]
    made = chain(numbers)
    last = made[3].work_out()[0]["left"]
    assert sorted(looked[4:]) == sorted(numbers)
    assert np.array_equal(last, in_order[3])
    assert np.array_equal(made[1].work_out()[0]["left"], in_order[1])
    assert len(looked) == 8, "each is looked for once"
    # trembling is calmed
    assert np.abs(in_order[3] - in_order[2]).max() < 5


def test_photos_are_not_smoothed(looked: list[int]) -> None:
    first, second = (one.work_out()[0]["left"] for one in chain([0, 5], None))
    assert second - first == pytest.approx(5, abs=1e-4)
    assert looked == [0, 5]


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
