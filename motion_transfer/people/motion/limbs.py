"""From where limbs point to how bones turn, shared by angles and by captured motion.

Convention: a limb segment's `turn` is the rotation that takes it from the rest pose to its place,
in the axes of the chest (arms) or of the pelvis (legs). Everything is written for the left side;
the right side is its mirror image. Angles are radians.

Zero pose: arms and legs hang straight down, palms to the body, toes forward. `Rest` holds the
rotation from the rest pose to it for each segment, so a segment's turn is `chain @ rest.segment`
for a chain of joint angles that is the identity at zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import cv2
import numpy as np
from jaxtyping import Float64

from motion_transfer.people.figure.body import Body

Matrix = Float64[np.ndarray, "3 3"]
Vector = Float64[np.ndarray, "3"]
Bones = dict[str, Matrix]

MIRROR = np.array([-1.0, 1.0, 1.0])
SPINE = ("spine05", "spine04", "spine03", "spine02", "spine01")
NECK = ("neck01", "neck02", "neck03", "head")
TOES = ("toe1-1", "toe2-1", "toe3-1", "toe4-1", "toe5-1")
FINGERS = (2, 3, 4, 5)  # index to little finger, as the bones count; the thumb is 1
OPEN = np.radians([0.0, 5.0, 3.0])  # knuckle, middle and end joint of a flat hand
FIST = np.radians([80.0, 100.0, 60.0])  # both by eye, on the body's own hand
TWIST_IN_FOREARM = 0.6
"""Share of the hand's turn about the forearm: skin shears less there than at the wrist."""

# zero frames: columns are the direction, the hinge (or the thumb's side), and their cross product
ARM_AT_ZERO = np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]])
HAND_AT_ZERO = np.array([[0.0, 0, -1], [0, -1, 0], [-1, 0, 0]])
LEG_AT_ZERO = np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])


def unit(vector: Vector) -> Vector:
    """Find a vector's direction."""
    return vector / np.sqrt(vector @ vector)


def cross(a: Vector, b: Vector) -> Vector:
    """Multiply crosswise; for one pair ten times as quick as NumPy."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def rotation(x: float, y: float, z: float) -> Matrix:
    """Make the matrix of a rotation vector."""
    return cv2.Rodrigues(np.array([x, y, z], np.float64))[0]


def turned(x: float, y: float, z: float) -> Matrix:
    """Turn about the axes one after the other, z first: Rx(x) Ry(y) Rz(z)."""
    a, b, c, d, e, f = cos(x), sin(x), cos(y), sin(y), cos(z), sin(z)
    rows = (c * e, -c * f, d), (a * f + b * d * e, a * e - b * d * f, -b * c)
    return np.array([*rows, (b * f - a * d * e, b * e + a * d * f, a * c)])


def about(axis: Vector, angle: float) -> Matrix:
    """Make the matrix that turns about a unit axis, counter-clockwise against it."""
    return cv2.Rodrigues(axis * angle)[0]


def rotation_vector(matrix: Matrix) -> Vector:
    """Find the shortest rotation vector of a matrix."""
    return cv2.Rodrigues(np.ascontiguousarray(matrix))[0][:, 0]


def twist_angle(matrix: Matrix, axis: Vector) -> float:
    """Measure how far a rotation turns about a unit axis (as in swing and twist), -pi .. pi."""
    skew = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    return float(2 * np.arctan2(skew @ axis, 1 + matrix.trace()))


def frame(direction: Vector, side: Vector) -> Matrix:
    """Make unit columns: a direction, `side` made perpendicular to it, and their cross product."""
    first = unit(direction)
    second = unit(side - (side @ first) * first)
    return np.stack([first, second, cross(first, second)], 1)


@dataclass(frozen=True)
class Rest:
    """What a body's rest pose says about its left limbs.

    Attributes:
        upper_arm, forearm, hand, leg: Rotations from the rest pose to the zero pose.
        upper_axis, fore_axis, leg_axis: Directions at rest.
        hinge: The axis at rest about which the elbow bends.
        curl_axis, thumb_axis: The axes at rest about which fingers and thumb curl.
        finger_angles: 4 x 3: how far each finger's joints are bent at rest.
    """

    upper_arm: Matrix
    forearm: Matrix
    hand: Matrix
    leg: Matrix
    upper_axis: Vector
    fore_axis: Vector
    leg_axis: Vector
    hinge: Vector
    curl_axis: Vector
    thumb_axis: Vector
    finger_angles: Float64[np.ndarray, "4 3"]

    @classmethod
    def of(cls, body: Body) -> Rest:
        """Measure a body."""
        index, heads = body.skeleton.index, body.heads
        shoulder, elbow, wrist = (
            heads[index[name]] for name in ("upperarm01.L", "lowerarm01.L", "wrist.L")
        )
        upper, fore = unit(elbow - shoulder), unit(wrist - elbow)
        hinge = unit(cross(upper, fore))
        fingers = [[heads[index[f"finger{k}-{i}.L"]] for i in (1, 2, 3)] for k in FINGERS]
        hand = frame(fingers[1][0] - wrist, fingers[0][0] - fingers[3][0])
        thumb = heads[index["finger1-3.L"]] - heads[index["finger1-2.L"]]
        curl_axis = cross(hand[:, 0], hand[:, 2])
        across, angles = cross(curl_axis, hand[:, 0]), np.empty((4, 3))
        for row, bones in zip(angles, np.diff(fingers, axis=1), strict=True):
            near, far = (np.arctan2(bone @ across, bone @ hand[:, 0]) for bone in bones)
            # the last bone's end is not in the model; as in a relaxed hand
            row[:] = near, far - near, 0.6 * (far - near)
        # a knee looks straight where hip, knee and ankle are slightly bent (about 8 degrees), so
        # thigh and shin share the line from hip to ankle
        leg = frame(heads[index["foot.L"]] - heads[index["upperleg01.L"]], np.array([1.0, 0, 0]))
        return cls(
            upper_arm=ARM_AT_ZERO @ frame(upper, hinge).T,
            forearm=ARM_AT_ZERO @ frame(fore, hinge).T,
            hand=HAND_AT_ZERO @ hand.T,
            leg=LEG_AT_ZERO @ leg.T,
            upper_axis=upper,
            fore_axis=fore,
            leg_axis=leg[:, 0],
            hinge=hinge,
            curl_axis=curl_axis,
            # a thumb closes neither across the palm nor along it, but between the two
            thumb_axis=unit(cross(thumb, 0.5 * hand[:, 2] - hand[:, 1])),
            finger_angles=angles,
        )


def arm_bones(rest: Rest, clavicle: Matrix, upper: Matrix, fore: Matrix, hand: Matrix) -> Bones:
    """Turn the left arm's bones, given its segments' turns.

    Upper arm and forearm each spread their twist over two bones: all of it at one joint would pinch
    the skin like a sweet's wrapper.
    """
    at_shoulder = clavicle.T @ upper
    half = about(rest.upper_axis, 0.5 * twist_angle(at_shoulder, rest.upper_axis))
    at_wrist = fore.T @ hand
    twist = twist_angle(at_wrist, rest.fore_axis)
    in_forearm = about(rest.fore_axis, TWIST_IN_FOREARM * twist)
    return {
        "clavicle": clavicle,
        "upperarm01": at_shoulder @ half.T,
        "upperarm02": half,
        "lowerarm01": upper.T @ fore,
        "lowerarm02": in_forearm,
        "wrist": in_forearm.T @ at_wrist,
    }


def finger_bones(rest: Rest, curl: float) -> Bones:
    """Bend the left hand's fingers: 0 is flat, 1 a fist."""
    bones = {}
    for finger, at_rest in zip(FINGERS, rest.finger_angles, strict=True):
        share = curl * (0.86 + 0.05 * (finger - 2))  # a relaxed little finger is bent the most
        for joint, angle in enumerate(OPEN + share * (FIST - OPEN) - at_rest, 1):
            bones[f"finger{finger}-{joint}"] = about(rest.curl_axis, angle)
    # the thumb rests as in a relaxed hand (0.3) and bends most at its tip
    for joint, angle in enumerate((0.35, 0.6, 0.9), 1):
        bones[f"finger1-{joint}"] = about(rest.thumb_axis, angle * (curl - 0.3))
    return bones


def leg_bones(rest: Rest, thigh: Matrix, shin: Matrix, foot: Matrix, toes: float = 0.0) -> Bones:
    """Turn the left leg's bones, given its segments' turns; `toes` bends them up."""
    half = about(rest.leg_axis, 0.5 * twist_angle(thigh, rest.leg_axis))
    bones = {
        "upperleg01": thigh @ half.T,
        "upperleg02": half,
        "lowerleg01": thigh.T @ shin,
        "foot": shin.T @ foot,
    }
    if toes:
        bones |= dict.fromkeys(TOES, rotation(-toes, 0, 0))
    return bones


def mirrored_matrix(matrix: Matrix) -> Matrix:
    """Turn a rotation into the one that a mirror through the body's middle shows."""
    return matrix * np.outer(MIRROR, MIRROR)


def whole_body(root: Matrix, spine: Vector, neck: Vector, left: Bones, right: Bones) -> Bones:
    """Name all bones that turn.

    Args:
        root: The pelvis's rotation.
        spine, neck: Rotation vectors of chest and head, spread evenly over what carries them.
        left, right: Each side's bones, both as if they were the left one's.
    """
    return {
        "root": root,
        **dict.fromkeys(SPINE, cv2.Rodrigues(spine / len(SPINE))[0]),
        **dict.fromkeys(NECK, cv2.Rodrigues(neck / len(NECK))[0]),
        **{f"{name}.L": matrix for name, matrix in left.items()},
        **{f"{name}.R": mirrored_matrix(matrix) for name, matrix in right.items()},
    }
