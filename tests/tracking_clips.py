"""Clips of a body in motion whose landmarks are known exactly."""

from __future__ import annotations

import numpy as np

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.interface import Landmarks, PersonEstimate
from motion_transfer.people.figure.body import load_body_model
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.people.motion.motions import MOTIONS
from motion_transfer.people.motion.poses import Pose, posed
from motion_transfer.tracking.landmarks import exact_landmarks

FOCAL = 614.4
CAMERA = Camera(512, 512, FOCAL, 3.2, (0.0, 0.0, 0.9))


def clip(name: str, count: int = 60) -> tuple[list[Pose], list[PosedBody], list[Landmarks | None]]:
    """A motion's poses, bodies and exact landmarks, at 30 frames a second."""
    model, motion = load_body_model(), MOTIONS[name]
    poses = [motion.pose(frame / (30 * motion.seconds)) for frame in range(count)]
    bodies = [posed(model.template, pose, model) for pose in poses]
    marks = [exact_landmarks(body, model, CAMERA) for body in bodies]
    # BlazePose's metres are short, see TO_WORLD
    short = np.array([1 / 1.09, 1 / 1.09, 1 / 0.93], np.float32)
    seen = [Landmarks(m.image, m.world * short, m.visibility, m.presence) for m in marks]
    return poses, bodies, list(seen)


class Known:
    """An estimator that says what it was told to, frame after frame."""

    def __init__(self, marks: list[Landmarks | None]) -> None:
        self._marks = iter(marks)

    def start_shot(self) -> None:
        pass

    def estimate(self, frame: np.ndarray) -> list[PersonEstimate]:
        marks = next(self._marks)
        iuv, alpha = np.ones((4, 4, 3), np.uint8), np.full((4, 4), 255, np.uint8)
        one = PersonEstimate(0, Box(0, 0, 4, 4), iuv, alpha, 1.0, marks)
        return [one] if marks is not None else []
