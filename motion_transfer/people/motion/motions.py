"""Named motions that repeat without a seam.

Convention: a motion is a function of its phase, 0 to 1 for one cycle; phase 1 is phase 0 again (one
full turn further where the person turns). Angles are smooth in the phase: no sudden speeds. What
names no source was posed by eye.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin

import numpy as np
from scipy.interpolate import PchipInterpolator

from motion_transfer.people.motion.dance import RAD, dance_pose, loop
from motion_transfer.people.motion.poses import Arm, Bend, Pose, clamped
from motion_transfer.people.motion.stances import BALL, HEEL, Foot, ankle_height, standing


@dataclass(frozen=True)
class Motion:
    """A loop.

    Attributes:
        name: What a user asks for.
        seconds: The natural length of one cycle.
        pose_at: Finds the pose at a phase in [0, 1).
    """

    name: str
    seconds: float
    pose_at: Callable[[float], Pose]

    def pose(self, phase: float) -> Pose:
        """Find the pose at a phase; whole cycles are left out (1.25 is 0.25)."""
        return self.pose_at(phase % 1.0)


STANCE = 0.6  # of a cycle a foot is on the floor (Perry, Gait Analysis, 1992)


@cache
def _foot_path(stride: float) -> PchipInterpolator:
    """Lead one foot through a cycle from its heel's strike: forward, height of ankle, heel.

    On the floor the sole moves back at an even speed, as on a treadmill: `stride` legs a cycle.
    The foot comes down on the heel, rolls flat, and leaves over the ball.
    """
    flatter = min(1.0, 0.4 + 0.45 * stride)  # short steps pitch the foot less
    # on the floor: rolls over the heel, lies flat, lifts the heel
    times = np.array([0.0, 0.04, 0.09, 0.18, 0.28, 0.36, 0.44, 0.5, 0.55, 0.6])
    heel = np.array([-20, -11, 0, 0, 0, 4, 10, 18, 33, 55]) * RAD * flatter
    sole = 0.4 * STANCE * stride - stride * times
    lifted = np.maximum(heel, 0)
    ankle = sole + BALL[0] * (1 - np.cos(lifted)) + BALL[1] * np.sin(lifted)
    up = np.array([ankle_height(angle) for angle in heel])
    # in the air: the toes clear the floor, then the foot rises to come down on the heel
    swing = np.array([0.68, 0.76, 0.84, 0.92, 0.97])
    start, end = ankle[-1], ankle[0]
    along = np.array([0.14, 0.44, 0.78, 1.02, 1.035])
    clear = HEEL[1] + np.array([0.125, 0.085, 0.045, 0.03, 0.018])
    pitch = np.array([50, 26, 0, -14, -20]) * RAD * flatter
    forward = np.concatenate([ankle, start + (end - start) * along])
    rows = np.stack([forward, np.concatenate([up, clear]), np.concatenate([heel, pitch])], 1)
    return loop(np.concatenate([times, swing]), rows)


def walk_pose(phase: float, stride: float = 1.3, swing: float = 1.0) -> Pose:
    """Find one instant of a walk on the spot; phase 0 is the left heel's strike.

    Args:
        stride: Length of two steps, 0.6 to 1.4 leg lengths; 1.3 is a calm walk (some 1.2 m).
        swing: How far the arms and the trunk swing; 1 is usual.
    """
    turn = 2 * pi * phase
    size = stride / 1.3
    lead = cos(turn)  # 1 when the left leg is in front
    sway = sin(turn - 0.35)  # 1 with the weight on the left leg
    pelvis = Bend(3 * RAD, -3.5 * RAD * sway * size, -5 * RAD * lead * size)
    # lowest with both feet on the floor, highest over one of them
    height = 0.9915 - 0.021 * size**2 - 0.015 * size**2 * cos(2 * turn - 0.3)
    feet = []
    for shift, side in ((0.0, 1), (0.5, -1)):
        # rounded: a path is worked out once for strides that nobody can tell apart
        forward, up, heel = _foot_path(round(stride, 3))((phase + shift) % 1.0)
        lift = float(up) - ankle_height(float(heel))
        feet.append(Foot(float(forward), -0.06 - side * 0.02 * sway, float(heel), 0.09, lift))
    arms = [
        Arm(
            swing=(4 - 22 * side * swing * lead) * RAD,
            abduction=(9 + 2 * side * sway) * RAD,
            turn_out=-12 * RAD,
            elbow=(20 - 12 * side * swing * lead) * RAD,
            pronation=25 * RAD,
            curl=0.38,
        )
        for side in (1, -1)
    ]
    pose = standing(
        feet[0],
        feet[1],
        pelvis,
        height=height,
        left_arm=arms[0],
        right_arm=arms[1],
        # the trunk turns against the pelvis, and the head back to the front
        spine=Bend((1 + 1.5 * cos(2 * turn)) * RAD, 4 * RAD * sway * size, 10 * RAD * lead * swing),
        head=Bend((-3 - cos(2 * turn)) * RAD, -0.5 * RAD * sway, -5 * RAD * lead * swing),
        offset=(0.018 * sway, 0.0, 0.0),
    )
    return clamped(pose)


def _turntable(phase: float) -> Pose:
    """Stand relaxed, arms a little away, and turn: all of the body is seen."""
    foot = Foot(out=0.03, turn_out=0.12)
    arm = Arm(swing=2 * RAD, abduction=20 * RAD, turn_out=-8 * RAD, elbow=18 * RAD, pronation=0.35)
    return standing(foot, foot, sink=0.001, left_arm=arm, right_arm=arm, turn=2 * pi * phase)


def _wave(phase: float) -> Pose:
    """Wave the left hand three times a cycle while the body sways once."""
    turn = 2 * pi * phase
    sway, beat = sin(turn), sin(3 * turn)
    pelvis = Bend(1 * RAD, (-2 - 1.5 * sway) * RAD, 2 * RAD * sway)
    late = sin(3 * turn - 0.7)  # the hand follows the forearm
    return standing(
        Foot(out=-0.01 - 0.012 * sway, turn_out=0.12),
        Foot(forward=0.04, out=0.03 + 0.012 * sway, turn_out=0.25),
        pelvis,
        sink=0.004,
        left_arm=Arm(
            swing=20 * RAD,
            abduction=(72 + 3 * beat) * RAD,
            turn_out=(68 + 12 * beat) * RAD,
            elbow=(96 - 15 * beat) * RAD,
            pronation=(30 + 6 * late) * RAD,
            wrist_side=-10 * late * RAD,
            curl=0.12,
        ),
        right_arm=Arm(
            swing=(2 + 2 * sway) * RAD,
            abduction=(12 - sway) * RAD,
            turn_out=-0.2,
            elbow=(17 + 2 * sway) * RAD,
            pronation=0.45,
            curl=0.35,
        ),
        spine=Bend(0.0, (1 - 1.5 * sway) * RAD, (3 - sway) * RAD),
        head=Bend(-1 * RAD, (4 + 2 * sway) * RAD, 3 * RAD * sway),
        offset=(0.011 * sway, 0.0, 0.0),
    )


def _jumping_jack(phase: float) -> Pose:
    """Jump: feet together at phase 0, astride at 0.5, in the air between the two."""
    spread = 0.5 - 0.5 * cos(2 * pi * phase)
    spread = spread * spread * (3 - 2 * spread)  # lingers at both ends
    # half a cycle is one jump: knees give at its ends, the flight lasts the middle 60 %
    jump = (2 * phase) % 1.0
    air = max(0.0, sin(pi * (jump - 0.2) / 0.6)) if 0.2 < jump < 0.8 else 0.0
    ground = 0.5 + 0.5 * cos(2 * pi * jump)
    foot = Foot(out=-0.05 + 0.33 * spread, turn_out=0.12 + 0.15 * spread, heel=35 * RAD * air**2)
    up = 165 * spread
    arm = Arm(
        swing=8 * RAD,
        abduction=(9 + up) * RAD,
        turn_out=(-8 + 60 * spread) * RAD,
        elbow=(14 + 12 * spread) * RAD,
        pronation=(15 - 10 * spread) * RAD,
        shrug=8 * RAD * spread,
        curl=0.12,
    )
    return standing(
        foot,
        foot,
        Bend(forward=5 * RAD * ground**2),
        sink=0.008 + 0.045 * ground**2,
        left_arm=arm,
        right_arm=arm,
        spine=Bend(forward=(4 * ground**2 - 2 * spread) * RAD),
        head=Bend(forward=-6 * RAD * ground**2),
        offset=(0.0, 0.0, 0.11 * air**2),
    )


MOTIONS: dict[str, Motion] = {
    motion.name: motion
    for motion in (
        Motion("walk", 1.1, walk_pose),  # Perry 1992: 113 steps a minute
        Motion("turntable", 6.0, _turntable),
        Motion("dance", 8.0, dance_pose),
        Motion("wave", 2.4, _wave),
        Motion("jumping-jacks", 1.2, _jumping_jack),
    )
}
"""All of them, by name."""
