"""Measure where BlazePose sees its landmarks on synthetic people, for tracking/landmarks.py.

    python tools/fit_body_landmarks.py [--people 150]

Prints how far its answers are from the anchors (median over photos, shares of the body's height in
the picture), then the offsets in the axes of the rest pose that bring the anchors to them: to be
copied into `ANCHORS` by hand (they are added to what stands there). Needs the extras `people` and
`estimate`, and `mt models fetch`.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from motion_transfer.estimate.blazepose.tracker import BodyTracker
from motion_transfer.estimate.interface import LANDMARK_NAMES, Landmarks
from motion_transfer.people import Camera, PeopleStream, load_body_model
from motion_transfer.tracking.landmarks import (
    ANCHORS,
    anchor_of,
    carrying_bones,
    exact_landmarks,
    rest_places,
)
from motion_transfer.training.iuv.samples import find_body

ROUNDS = 12
NEAR = 0.008
"""Residuals beyond this share of the height count with their size and not its square."""

STEP = 0.005
"""Of the numerical derivative, a share of the height."""

SEEN = 0.5  # visibility above which a landmark counts

STIFFNESS = 4e-5
"""Pulls offsets towards 0, where the photos do not tell them; chosen by eye."""


@dataclass(frozen=True)
class Observation:
    """One photo, and BlazePose's answer to it."""

    exact: Landmarks
    seen: Landmarks
    transforms: np.ndarray
    rest: np.ndarray
    body_height: float
    camera: Camera

    @property
    def tall(self) -> float:
        """Height in the picture, px."""
        return float(np.ptp(self.exact.image[:, 1]))


def observe(people: int, views: int = 2) -> list[Observation]:
    stream, model = PeopleStream(), load_body_model()
    tracker = BodyTracker(most_people=1, smooth=False)
    found = []
    for number in range(people):
        dressed = stream.dress(number)
        for view in range(views):
            shot = stream.shot(number, view)
            photo, posed = stream.take(dressed, shot), dressed.posed(shot.pose)
            exact = exact_landmarks(posed, model, photo.camera)
            seen, _ = find_body(photo.rgb, tracker, exact)
            if seen is not None:
                transforms = posed.transforms[carrying_bones(posed.body)]
                rest = rest_places(posed.body, model)
                found.append(
                    Observation(exact, seen, transforms, rest, posed.body.height, photo.camera)
                )
    return found


def report(observations: list[Observation]) -> None:
    for index, name in enumerate(LANDMARK_NAMES):
        away = [
            np.linalg.norm((o.seen.image - o.exact.image)[index, :2]) / o.tall
            for o in observations
            if o.exact.visibility[index] > SEEN
        ]
        print(f"{name:18} {len(away):5} seen, median {np.median(away):.4f} of the height")


def fit(observations: list[Observation], kind: str) -> np.ndarray:
    """Fit the offset of one kind of landmark by robust Gauss-Newton steps, both sides at once."""
    offset = np.zeros(3)
    sides = [(i, anchor_of(name)[1]) for i, name in enumerate(LANDMARK_NAMES)]
    wanted = [(i, side) for i, side in sides if anchor_of(LANDMARK_NAMES[i])[0] == kind]
    for _ in range(ROUNDS):
        normal, right, count = np.zeros((3, 3)), np.zeros(3), 0
        for o in observations:
            for index, side in wanted:
                if o.exact.visibility[index] <= SEEN:
                    continue
                slopes, rest = _linearised(o, index, side, offset)
                weight = 1 / max(float(np.linalg.norm(rest)), NEAR)
                normal += weight * slopes.T @ slopes
                right += weight * slopes.T @ rest
                count += 1
        offset += np.linalg.solve(normal + STIFFNESS * count * np.eye(3), right)
        if kind == "nose":  # it has no side, and is in the middle
            offset[0] = 0
    return offset


def _linearised(
    o: Observation, index: int, side: str, offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How the landmark moves in the picture with its offset, and how far it has to go."""
    sign = np.array([-1.0 if side == "R" else 1.0, 1.0, 1.0])
    place = o.rest[index] + sign * offset * o.body_height
    places = np.concatenate([place[None], place + np.diag(sign * o.body_height * STEP)])
    matrix = o.transforms[index]
    screen = o.camera.project((places @ matrix[:, :3].T + matrix[:, 3]).astype(np.float32))[:, :2]
    slopes = ((screen[1:] - screen[0]) / STEP).T / o.tall
    return slopes, (o.seen.image[index, :2] - screen[0]) / o.tall


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--people", type=int, default=150)
    observations = observe(parser.parse_args().people)
    report(observations)
    for kind in ANCHORS:
        print(f"{kind:12} {tuple(fit(observations, kind).round(4).tolist())}")
