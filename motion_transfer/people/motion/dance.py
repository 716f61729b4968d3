"""A dance of eight counts, and what repeats without a seam.

Each figure is a pose that is hit on a beat; between beats every angle eases from one to the next.
The figures were posed by eye.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
from scipy.interpolate import PchipInterpolator

from motion_transfer.people.motion.poses import (
    Arm,
    Bend,
    Leg,
    Pose,
    from_numbers,
    mirrored,
    numbers,
)
from motion_transfer.people.motion.stances import Foot, standing

RAD = pi / 180
"""One degree."""


def loop(phases: np.ndarray, rows: np.ndarray, gain: np.ndarray | float = 0.0) -> PchipInterpolator:
    """Join rows of numbers smoothly and round (monotone cubic, no overshoot).

    Args:
        phases: One a row, rising in [0, 1).
        gain: What a cycle adds to a row.
    """
    x = np.concatenate([phases + cycle for cycle in (-1, 0, 1)])
    return PchipInterpolator(x, np.concatenate([rows + c * gain for c in (-1, 0, 1)]))


def _arm(swing: float, abduction: float, turn_out: float, elbow: float, **more: float) -> Arm:
    """Take degrees; the fingers' curl is a share."""
    curl = more.pop("curl", 0.2)
    rest = {name: value * RAD for name, value in more.items()}
    return Arm(swing * RAD, abduction * RAD, turn_out * RAD, elbow * RAD, curl=curl, **rest)


def _bend(forward: float, side: float, turn: float) -> Bend:
    return Bend(forward * RAD, side * RAD, turn * RAD)


_RAISED = _arm(6, 160, 45, 22, pronation=10, shrug=6, curl=0.1)
_OPENED = _arm(-6, 88, 30, 14, pronation=-25, wrist=-12, curl=0.1)

_GROOVE = standing(
    Foot(0.0, 0.06, turn_out=0.3),
    Foot(0.06, 0.1, 0.35, 0.35),
    _bend(4, -8, 8),
    sink=0.02,
    left_arm=_arm(-18, 28, -20, 78, pronation=10, curl=0.6),
    right_arm=_arm(38, 18, -25, 88, pronation=10, curl=0.6),
    spine=_bend(4, 12, -16),
    head=_bend(2, -6, 10),
    offset=(0.05, 0.0, 0.0),
)
"""Knees soft, weight on the left, the arms bent in front."""

_SIDE_LUNGE = standing(
    Foot(0.08, 0.28, turn_out=0.5),
    Foot(0.0, 0.5, turn_out=0.2),
    _bend(10, 4, 6),
    sink=0.03,
    left_arm=_arm(14, 74, -8, 92, pronation=15, wrist=10, curl=0.3),
    right_arm=_arm(12, 142, 20, 8, pronation=10),
    spine=_bend(0, 16, 4),
    head=_bend(-6, -4, -38),
    offset=(0.12, 0.0, 0.0),
)
"""Deep on the left leg, the right arm thrown up and out."""

_REACH = standing(
    Foot(0.05, -0.03, 0.5, 0.2),
    Foot(-0.05, -0.03, 0.5, 0.2),
    _bend(-4, 0, 0),
    sink=0.004,
    left_arm=_RAISED,
    right_arm=_RAISED,
    spine=_bend(-10, 0, 0),
    head=_bend(-16, 0, 0),
)
"""On the toes, both arms high, the back arched."""

_PASSE = replace(
    standing(
        Foot(),
        Foot(0.0, -0.1, 0.4, 0.25),
        _bend(0, 3, 0),
        sink=0.003,
        left_arm=_arm(62, 18, -20, 52, pronation=-10, curl=0.15),
        right_arm=_arm(10, 148, 60, 42, pronation=0, curl=0.15),
        spine=_bend(-3, -4, 4),
        head=_bend(-3, 2, 22),
        offset=(-0.07, 0.0, 0.0),
    ),
    left_leg=Leg(70 * RAD, 34 * RAD, 40 * RAD, 100 * RAD, -40 * RAD),
)
"""On the right leg, the left knee up and out, arms round in front and above."""

_OPEN = replace(
    standing(
        Foot(0.16, 0.14, turn_out=0.35),
        Foot(-0.2, 0.14, 0.5, 0.35),
        sink=0.012,
        left_arm=_OPENED,
        right_arm=_OPENED,
        spine=_bend(-8, 0, 8),
        head=_bend(-8, 0, 0),
    ),
    pelvis=_bend(0, 0, -6),
)
"""A wide step with both arms opened level, chest to the light."""

_CLOSE = standing(
    Foot(0.05, 0.08, turn_out=0.4),
    Foot(0.05, 0.08, turn_out=0.4),
    _bend(16, 0, 0),
    sink=0.08,
    left_arm=_arm(62, 0, -40, 62, pronation=10, curl=0.5),
    right_arm=_arm(26, 8, -44, 58, pronation=10, curl=0.5),
    spine=_bend(14, 0, 0),
    head=_bend(10, 0, 0),
)
"""Low, with arms crossed in front, before a throw."""

# figure on each beat, whether it is mirrored, and how far the whole body has turned, in turns
_FIGURES = (
    (_GROOVE, False, 0.0),
    (_GROOVE, True, 0.0),
    (_SIDE_LUNGE, False, 0.0),
    (_GROOVE, True, 0.0),
    (_SIDE_LUNGE, True, 0.0),
    (_CLOSE, False, 0.03),
    (_REACH, False, 0.0),
    (_OPEN, True, 0.08),
    (_CLOSE, True, 0.12),
    (_PASSE, False, 0.45),
    (_PASSE, False, 0.85),
    (_OPEN, False, 1.0),
    (_GROOVE, False, 1.0),
    (_GROOVE, True, 1.0),
    (_REACH, True, 1.0),
    (_CLOSE, False, 1.0),
)


@cache
def _figures() -> PchipInterpolator:
    rows = np.array([numbers(mirrored(pose) if swap else pose) for pose, swap, _ in _FIGURES])
    rows[:, 0] = [2 * pi * turn for *_, turn in _FIGURES]
    gain = np.zeros(rows.shape[1])
    gain[0] = 2 * pi  # the next cycle begins one turn further
    return loop(np.arange(len(_FIGURES)) / len(_FIGURES), rows, gain)


def dance_pose(phase: float) -> Pose:
    """Find one instant of the dance; sixteen beats a cycle, one turn to the left in the middle."""
    return from_numbers(_figures()(phase))
