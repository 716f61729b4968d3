"""Feet that stand keep their place, and those that move are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("anny")

from scipy.ndimage import gaussian_filter1d
from tracking_clips import CAMERA, clip

from motion_transfer.estimate.interface import Landmarks
from motion_transfer.people.figure.body import load_body_model
from motion_transfer.tracking import fitting
from motion_transfer.tracking.contacts import FEET, find_standing
from motion_transfer.tracking.fitting import View, fit_postures
from motion_transfer.tracking.puppet import Puppet
from motion_transfer.tracking.starting import observe

VIEW = View(CAMERA.focal_px, (CAMERA.width / 2, CAMERA.height / 2))
RATE = 30


def marks_of(name: str, count: int) -> list[Landmarks]:
    return [one for one in clip(name, count)[2] if one is not None]


def noisy(marks: list[Landmarks]) -> list[Landmarks]:
    """Landmarks that tremble slowly, as BlazePose's do, most of all in their metres."""
    rng, out = np.random.default_rng(0), []
    height = np.ptp(marks[0].image[:, 1])
    waves = [gaussian_filter1d(rng.normal(0, 1, (len(marks), 33, 3)), 6, axis=0) for _ in range(2)]
    image, world = (wave / wave.std() for wave in waves)
    for index, one in enumerate(marks):
        places = one.image + image[index] * (0.01 * height, 0.01 * height, 0)
        metres = one.world + 0.06 * world[index]
        out.append(replace(one, image=places.astype(np.float32), world=metres.astype(np.float32)))
    return out


def feet_of(marks: list[Landmarks]) -> np.ndarray:
    """Where heels and balls of the fitted feet are, N x 4 x 3."""
    model = load_body_model()
    puppet = Puppet(model.template, model)
    postures, _ = fit_postures(puppet, observe([*marks]), VIEW, RATE)
    return puppet.place(postures).landmarks[:, FEET]


def speed(feet: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(feet, axis=0), axis=-1).mean() * RATE)


def test_feet_that_stand_do_not_slide(monkeypatch: pytest.MonkeyPatch) -> None:
    marks = noisy(marks_of("wave", 60))
    pinned = speed(feet_of(marks))
    monkeypatch.setattr(fitting, "find_standing", lambda *_: [])
    free = speed(feet_of(marks))
    assert free > 0.1  # metres a second
    assert pinned < 0.5 * free


def test_feet_that_walk_on_the_spot_do_not_stand() -> None:
    marks = marks_of("walk", 40)
    observed = observe([*marks])
    points = np.stack([mark.world for mark in marks]).astype(float)
    standing = find_standing(observed.image, observed.weight, points, 300.0, RATE)
    assert sum(len(one.frames) for one in standing) < 0.1 * 4 * len(marks)


def path(*stretches: tuple[int, float]) -> np.ndarray:
    """All landmarks at places that move to the right, by so many px a frame for so many frames."""
    x = np.cumsum([step for count, step in stretches for _ in range(count)])
    shown = np.zeros((len(x), 33, 2))
    shown[..., 0] = x[:, None]
    return shown


def standing_in(shown: np.ndarray, *, up: float = 0.0, weight: float = 1.0) -> list[range]:
    """When the left heel stands, of a body 400 px tall."""
    points = np.zeros((len(shown), 33, 3))
    points[:, FEET[0], 2] = up
    weights = np.full(shown.shape[:2], weight)
    found = find_standing(shown, weights, points, 400.0, RATE)
    return [one.frames for one in found if one.landmark == FEET[0]]


def test_a_step_parts_two_stands() -> None:
    (first, second) = standing_in(path((20, 0), (6, 20), (20, 0)))
    assert first.start == 0 and 14 <= first.stop <= 20
    assert 26 <= second.start <= 32 and second.stop == 46


def test_a_slow_drift_is_many_stands() -> None:
    stands = standing_in(path((120, 1.0)))  # a tenth of what is fast, and a third of the body
    assert len(stands) > 3
    assert all(len(one) < 40 for one in stands)


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        (path((40, 10)), {}),
        (path((40, 0)), {"up": 0.5}),
        (path((40, 0)), {"weight": 0.1}),
        (path((4, 0)), {}),
        (path((1, 0)), {}),
    ],
)
def test_what_does_not_stand(shown: np.ndarray, words: dict) -> None:
    assert standing_in(shown, **words) == []
