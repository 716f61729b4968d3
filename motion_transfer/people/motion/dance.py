"""A dance of eight counts: figures joined smoothly, with one full turn.

Each figure is a pose that is hit on a beat; between beats every angle eases from one to the next.
"""

from __future__ import annotations

from functools import cache
from math import pi

import numpy as np

from motion_transfer.people.motion.loops import Loop
from motion_transfer.people.motion.poses import (
    Arm,
    Bend,
    Leg,
    Pose,
    from_numbers,
    mirrored,
    numbers,
)
from motion_transfer.people.motion.stances import Foot, stance

RAD = pi / 180


def _arm(swing: float, abduction: float, turn_out: float, elbow: float, **more: float) -> Arm:
    """Degrees; the fingers' curl is a share."""
    curl = more.pop("curl", 0.2)
    rest = {name: value * RAD for name, value in more.items()}
    return Arm(swing * RAD, abduction * RAD, turn_out * RAD, elbow * RAD, curl=curl, **rest)


def _bend(forward: float, side: float, turn: float) -> Bend:
    return Bend(forward * RAD, side * RAD, turn * RAD)


def _groove() -> Pose:
    """Knees soft, weight on the left, the arms bent in front."""
    pelvis = _bend(4, -8, 8)
    left, right = stance(
        Foot(0.0, 0.06, turn_out=0.3), Foot(0.06, 0.1, 0.35, 0.35), pelvis, sink=0.02
    )
    return Pose(
        left_arm=_arm(-18, 28, -20, 78, pronation=10, curl=0.6),
        right_arm=_arm(38, 18, -25, 88, pronation=10, curl=0.6),
        left_leg=left,
        right_leg=right,
        pelvis=pelvis,
        spine=_bend(4, 12, -16),
        head=_bend(2, -6, 10),
        offset=(0.05, 0.0, 0.0),
    )


def _side_lunge() -> Pose:
    """Deep on the left leg, the right arm thrown up and out."""
    pelvis = _bend(10, 4, 6)
    left, right = stance(
        Foot(0.08, 0.28, turn_out=0.5), Foot(0.0, 0.5, turn_out=0.2), pelvis, sink=0.03
    )
    return Pose(
        left_arm=_arm(14, 74, -8, 92, pronation=15, wrist=10, curl=0.3),
        right_arm=_arm(12, 142, 20, 8, pronation=10),
        left_leg=left,
        right_leg=right,
        pelvis=pelvis,
        spine=_bend(0, 16, 4),
        head=_bend(-6, -4, -38),
        offset=(0.12, 0.0, 0.0),
    )


def _reach() -> Pose:
    """On the toes, both arms high, the back arched."""
    pelvis = _bend(-4, 0, 0)
    left, right = stance(
        Foot(0.05, -0.03, 0.5, 0.2), Foot(-0.05, -0.03, 0.5, 0.2), pelvis, sink=0.004
    )
    arm = _arm(6, 160, 45, 22, pronation=10, shrug=6, curl=0.1)
    return Pose(
        left_arm=arm,
        right_arm=arm,
        left_leg=left,
        right_leg=right,
        pelvis=pelvis,
        spine=_bend(-10, 0, 0),
        head=_bend(-16, 0, 0),
    )


def _passe() -> Pose:
    """On the right leg, the left knee up and out, arms round in front and above."""
    pelvis = _bend(0, 3, 0)
    _, right = stance(Foot(), Foot(0.0, -0.1, 0.4, 0.25), pelvis, sink=0.003)
    return Pose(
        left_arm=_arm(62, 18, -20, 52, pronation=-10, curl=0.15),
        right_arm=_arm(10, 148, 60, 42, pronation=0, curl=0.15),
        left_leg=Leg(70 * RAD, 34 * RAD, 40 * RAD, 100 * RAD, -40 * RAD),
        right_leg=right,
        pelvis=pelvis,
        spine=_bend(-3, -4, 4),
        head=_bend(-3, 2, 22),
        offset=(-0.07, 0.0, 0.0),
    )


def _open() -> Pose:
    """A wide step with both arms opened level, chest to the light."""
    left, right = stance(Foot(0.16, 0.14, turn_out=0.35), Foot(-0.2, 0.14, 0.5, 0.35), sink=0.012)
    arm = _arm(-6, 88, 30, 14, pronation=-25, wrist=-12, curl=0.1)
    return Pose(
        left_arm=arm,
        right_arm=arm,
        left_leg=left,
        right_leg=right,
        pelvis=_bend(0, 0, -6),
        spine=_bend(-8, 0, 8),
        head=_bend(-8, 0, 0),
    )


def _close() -> Pose:
    """Low, with arms crossed in front, before a throw."""
    pelvis = _bend(16, 0, 0)
    left, right = stance(
        Foot(0.05, 0.08, turn_out=0.4), Foot(0.05, 0.08, turn_out=0.4), pelvis, sink=0.08
    )
    return Pose(
        left_arm=_arm(62, 0, -40, 62, pronation=10, curl=0.5),
        right_arm=_arm(26, 8, -44, 58, pronation=10, curl=0.5),
        left_leg=left,
        right_leg=right,
        pelvis=pelvis,
        spine=_bend(14, 0, 0),
        head=_bend(10, 0, 0),
    )


# beat, figure, and how far the whole body has turned, in turns
_FIGURES = (
    (0, _groove, False, 0.0),
    (1, _groove, True, 0.0),
    (2, _side_lunge, False, 0.0),
    (3, _groove, True, 0.0),
    (4, _side_lunge, True, 0.0),
    (5, _close, False, 0.03),
    (6, _reach, False, 0.0),
    (7, _open, True, 0.08),
    (8, _close, True, 0.12),
    (9, _passe, False, 0.45),
    (10, _passe, False, 0.85),
    (11, _open, False, 1.0),
    (12, _groove, False, 1.0),
    (13, _groove, True, 1.0),
    (14, _reach, True, 1.0),
    (15, _close, False, 1.0),
)


@cache
def _figures() -> Loop:
    rows = []
    for _, figure, swap, turn in _FIGURES:
        pose = mirrored(figure()) if swap else figure()
        row = numbers(pose)
        row[0] = 2 * pi * turn
        rows.append(row)
    gain = np.zeros(len(rows[0]))
    gain[0] = 2 * pi
    return Loop.through([beat / 16 for beat, *_ in _FIGURES], np.array(rows), gain)


def dance_pose(phase: float) -> Pose:
    """One instant; sixteen beats a cycle, one turn to the left in the middle."""
    pose = _figures()(phase)
    return from_numbers(np.asarray(pose))
