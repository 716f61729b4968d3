"""Legs from where the feet stand, so that both reach the floor.

Convention: lengths in legs (hip to ankle, straight = 1), so that a stance fits every body;
thigh and shin count as equally long. A foot is given relative to the place under its hip joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, asin, atan2, cos, hypot, pi, sin, sqrt
from typing import Any

import numpy as np

from motion_transfer.people.motion.limbs import turned
from motion_transfer.people.motion.poses import Bend, Leg, Pose, leg_chain

HIP = 0.128  # half the distance between the hip joints: 0.115 of 0.9 m in the middle shape
HEEL = (0.05, 0.085)  # the ankle's place before and above the heel's lowest point
BALL = (0.17, 0.06)  # the ball's place before and below the ankle
STRAIGHT = 0.9995  # longest reach: a knee locked in the middle of a motion would jerk


@dataclass(frozen=True)
class Foot:
    """Where one foot stands.

    Attributes:
        forward, out: How far its ankle is from the place under the hip, legs.
        heel: How far the heel is lifted about the ball, radians; negative stands on the heel.
        turn_out: How far the leg is turned outwards, radians.
        lift: Height of the sole above the floor, legs.
    """

    forward: float = 0.0
    out: float = 0.0
    heel: float = 0.0
    turn_out: float = 0.0
    lift: float = 0.0


def ankle_height(heel: float) -> float:
    """Find the ankle's height above the floor, legs, for a foot pitched by `heel`."""
    if heel >= 0:
        return HEEL[1] + BALL[0] * sin(heel) - BALL[1] * (1 - cos(heel))
    return HEEL[1] * cos(heel) + HEEL[0] * sin(-heel)


def leg_to(foot: Foot, height: float) -> Leg:
    """Find the leg whose ankle is `height` legs below the hip, its sole level but for `heel`.

    A leg too short for that is straight and points there.
    """
    x, y = foot.out, -foot.forward
    length = sqrt(x * x + y * y + height * height)
    reach = min(length, STRAIGHT)
    half = acos(reach)  # thigh and shin are equal, so the knee bends by twice this
    # hip and out: turn the bent leg's line, q, onto the target's direction
    qx, qy, qz = -sin(half) * sin(foot.turn_out), sin(half) * cos(foot.turn_out), -cos(half)
    side = max(-1.0, min(1.0, x / length / hypot(qx, qz)))
    out = asin(side) - atan2(qx, -qz)
    wz = qx * sin(out) + qz * cos(out)
    hip = atan2(wz, qy) - atan2(-height, y)
    hip = (hip + pi) % (2 * pi) - pi
    leg = Leg(hip=hip, out=out, turn_out=foot.turn_out, knee=2 * half)
    # the shin's view of "up" says how to hold the ankle
    up = (leg_chain(leg) @ turned(leg.knee, 0, 0)).T[:, 2]
    ankle = atan2(up[1], up[2]) - foot.heel
    heel = max(foot.heel, 0.0)
    toes = heel * heel / (heel + 0.15)  # stay on the floor; without a jerk as the heel lifts off
    return Leg(hip, out, foot.turn_out, 2 * half, ankle, float(np.arcsin(up[0])), toes)


def standing(
    left: Foot,
    right: Foot,
    pelvis: Bend | None = None,
    *,
    sink: float = 0.0,
    height: float = 0.0,
    **rest: Any,
) -> Pose:
    """Make the pose of a person who stands on both feet.

    Args:
        pelvis: Its tilt and turn move the hip joints, which the legs make up for.
        sink: How much lower the hips are than the straighter leg would allow, legs.
        height: How high the hips are above the ankles of flat feet, legs, instead of `sink`; 0 does
            not say.
        rest: The pose's other parts.
    """
    pelvis = pelvis or Bend()
    places = []
    for foot, side in ((left, 1), (right, -1)):
        forward = foot.forward + side * HIP * sin(pelvis.turn)
        drop = side * HIP * sin(pelvis.side) + ankle_height(foot.heel) + foot.lift - HEEL[1]
        longest = sqrt(max(STRAIGHT**2 - forward**2 - foot.out**2, 0.01))
        places.append((Foot(forward, foot.out, foot.heel, foot.turn_out), drop, longest + drop))
    hips = height or min(longest for _, _, longest in places) - sink
    legs = [leg_to(foot, hips - drop) for foot, drop, _ in places]
    return Pose(left_leg=legs[0], right_leg=legs[1], pelvis=pelvis, **rest)
