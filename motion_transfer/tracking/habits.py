"""How people usually hold themselves: which turns of the joints go together, as a Gaussian.

It is that of the poses which synthetic people are photographed in; joints are free to leave it, but
the picture has to insist on it.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from functools import cache

import numpy as np
from jaxtyping import Float64

from motion_transfer.people import (
    Arm,
    Leg,
    Pose,
    arm_chain,
    leg_chain,
    mirrored_matrix,
    rotation,
    sample_pose,
    turned,
)
from motion_transfer.tracking.puppet import LAYOUT, PARAMETERS, Postures

POSES = 600
JOINTS = slice(LAYOUT["spine"].start, PARAMETERS)
"""The numbers of a step that turn joints; where a body is and which way it faces has no habits."""

LEAST_SIGMA = 0.1
"""Radians; feet and spines of sampled poses keep stiller than those of real people."""

STRENGTH = 0.5
"""How much habits count; measured on synthetic clips: 0.3 to 1 are best."""

BEND_LIMITS = np.radians([0, 150])
LIMIT_SIGMA = np.radians(3)

REST_STEP = 1e-3
"""Curvature added to every number, so that a step is found where nothing is known."""


@dataclass(frozen=True)
class Habits:
    """A Gaussian over the turns of the joints from the zero pose."""

    mean: Float64[np.ndarray, " J"]
    precision: Float64[np.ndarray, "J J"]

    def pull(
        self,
        postures: Postures,
        blocks: Float64[np.ndarray, "N P P"],
        right: Float64[np.ndarray, "N P"],
    ) -> None:
        """Add to normal equations what draws joints to usual turns, and bends inside limits."""
        away = postures.away_from(at_zero(postures))
        blocks[:, JOINTS, JOINTS] += self.precision
        right[:, JOINTS] -= (away[:, JOINTS] - self.mean) @ self.precision
        curvature = np.full((len(postures), PARAMETERS), REST_STEP)
        for name, part in LAYOUT.items():
            if name.startswith(("elbow", "knee")):
                beyond = away[:, part] - np.clip(away[:, part], *BEND_LIMITS)
                outside = (beyond != 0) / LIMIT_SIGMA**2
                curvature[:, part] += outside
                right[:, part] -= outside * beyond
        diagonal = np.arange(PARAMETERS)
        blocks[:, diagonal, diagonal] += curvature


@cache
def usual_habits() -> Habits:
    """Measure the poses of synthetic people, once a process: a third of a second."""
    rng = np.random.default_rng(0)
    poses = as_postures([sample_pose(rng) for _ in range(POSES)])
    turns = poses.away_from(at_zero(poses))[:, JOINTS]
    spread = np.cov(turns.T) + LEAST_SIGMA**2 * np.eye(turns.shape[1])
    return Habits(turns.mean(0), STRENGTH * np.linalg.inv(spread))


def at_zero(postures: Postures) -> Postures:
    """Let limbs hang and the trunk be straight, where the bodies are."""
    count = len(postures)
    still, none = np.tile(np.eye(3), (count, 2, 1, 1)), np.zeros((count, 3))
    bends = np.zeros((count, 2))
    return Postures(
        place=postures.place,
        pelvis=postures.pelvis,
        spine=none,
        neck=none,
        arm=still,
        elbow=bends,
        hand=still,
        leg=still,
        knee=bends,
        foot=still,
    )


def as_postures(poses: list[Pose]) -> Postures:
    """Write poses as postures at the origin."""
    limbs = [_limbs(pose) for pose in poses]
    names = ("arm", "elbow", "hand", "leg", "knee", "foot")
    pelvis = [turned(0, 0, pose.turn) @ rotation(*astuple(pose.pelvis)) for pose in poses]
    return Postures(
        place=np.zeros((len(poses), 3)),
        pelvis=np.array(pelvis),
        spine=np.array([astuple(pose.spine) for pose in poses], np.float64),
        neck=np.array([astuple(pose.head) for pose in poses], np.float64),
        **{name: np.array([row[name] for row in limbs], np.float64) for name in names},
    )


def _limbs(pose: Pose) -> dict[str, list]:
    pelvis = rotation(*astuple(pose.pelvis))
    rows: dict[str, list] = {}
    for side, (arm, leg) in enumerate(
        ((pose.left_arm, pose.left_leg), (pose.right_arm, pose.right_leg))
    ):
        for name, value in _limbs_of_side(arm, leg, pelvis, side).items():
            rows.setdefault(name, []).append(value)
    return rows


def _limbs_of_side(arm: Arm, leg: Leg, pelvis: np.ndarray, side: int) -> dict[str, np.ndarray]:
    own = mirrored_matrix if side else np.asarray
    hand = turned(0, 0, -arm.pronation) @ turned(-arm.wrist_side, arm.wrist, 0)
    return {
        "arm": own(arm_chain(arm)),
        "elbow": np.asarray(arm.elbow),
        "hand": own(hand),
        "leg": pelvis.T @ own(leg_chain(leg)),  # a pose's legs are measured from the upright
        "knee": np.asarray(leg.knee),
        "foot": own(turned(-leg.ankle, leg.roll, 0)),
    }
