"""Motion from a BVH file on our body.

Limbs are matched by where they point in the world, frame by frame, so that it does not matter how
a file's skeleton stands at rest. Elbows and knees say how upper arms and thighs are twisted; where
they are straight, the joints' own rotations carry that over from frames in which they are bent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from jaxtyping import Float64

from motion_transfer.people.figure.body import Body
from motion_transfer.people.motion.bvh.file import BvhMotion, read_bvh
from motion_transfer.people.motion.bvh.frames import Frames, body_frames
from motion_transfer.people.motion.limbs import (
    ARM_AT_ZERO,
    HAND_AT_ZERO,
    LEG_AT_ZERO,
    MIRROR,
    Bones,
    Rest,
    arm_bones,
    finger_bones,
    leg_bones,
    mirrored_matrix,
    rotation,
    rotation_vector,
    whole_body,
)
from motion_transfer.people.motion.poses import RELAXED, collar_bone

__all__ = ["BvhMotion", "BvhPoses", "bvh_poses", "read_bvh"]

Offset = tuple[float, float, float]
Numbers = Float64[np.ndarray, "N"]

HEEL_BEHIND = 0.05  # metres that the heel lies behind the ankle joint, for the floor's height
ON_FLOOR = 0.02  # share of the frames that may dip below the floor: captures have outliers


@dataclass(frozen=True)
class BvhPoses:
    """A body's bone rotations and offset, frame by frame, made when asked for.

    Attributes:
        rest: The body's limbs at rest.
        frames: The motion.
        offsets: N x 3, metres, for `body.transforms`.
        frame_rate: The motion's frames per second.
        places: Which moment each item shows, in frames of the motion.
    """

    rest: Rest
    frames: Frames
    offsets: Float64[np.ndarray, "N 3"]
    frame_rate: Fraction
    places: Numbers

    def __len__(self) -> int:
        return len(self.places)

    def __getitem__(self, index: int) -> tuple[Bones, Offset]:
        place = float(self.places[index])
        first = int(place)
        share = place - first
        bones = self._bones(first)
        offset = self.offsets[first]
        if share >= 1e-9:  # the last frame has none after it
            after = self._bones(first + 1)
            bones = {name: _between(matrix, after[name], share) for name, matrix in bones.items()}
            offset = (1 - share) * offset + share * self.offsets[first + 1]
        x, y, z = offset.tolist()
        return bones, (x, y, z)

    def resampled(self, frame_count: int, frame_rate: Fraction) -> BvhPoses:
        """Show the same motion at another rate: item i is the moment i / frame_rate.

        Between two frames every bone turns evenly; after the last frame the body stands still.
        """
        last = len(self.offsets) - 1
        places = [
            min(float(index / Fraction(frame_rate) * self.frame_rate), last)
            for index in range(frame_count)
        ]
        return replace(self, places=np.array(places))

    def _bones(self, frame: int) -> Bones:
        rest, frames = self.rest, self.frames
        pelvis, chest = frames.pelvis[frame], frames.chest[frame]
        sides = []
        for side in (0, 1):
            below, above = map(mirrored_matrix, (pelvis, chest)) if side else (pelvis, chest)
            thigh, shin = (
                below.T @ part[frame] @ LEG_AT_ZERO.T @ rest.leg
                for part in (frames.legs[side].upper, frames.legs[side].lower)
            )
            bones = leg_bones(rest, thigh, shin, below.T @ frames.legs[side].tip[frame])
            if frames.arms is not None:
                arm = frames.arms[side]
                upper = above.T @ arm.upper[frame] @ ARM_AT_ZERO.T @ rest.upper_arm
                fore = above.T @ arm.lower[frame] @ ARM_AT_ZERO.T @ rest.forearm
                hand = above.T @ arm.tip[frame] @ HAND_AT_ZERO.T @ rest.hand
                bones |= arm_bones(rest, collar_bone(upper, rest), upper, fore, hand)
                bones |= finger_bones(rest, RELAXED)
            sides.append(bones)
        neck = rotation_vector(chest.T @ frames.head[frame])
        return whole_body(pelvis, rotation_vector(pelvis.T @ chest), neck, sides[0], sides[1])


def _between(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """Turn evenly from one rotation to another (spherical linear interpolation)."""
    vector = rotation_vector(a.T @ b)
    return a @ rotation(*(share * vector))


def bvh_poses(motion: BvhMotion, body: Body, *, travel: bool = False) -> BvhPoses:
    """Put a body through a captured motion.

    Args:
        motion: In any unit, y or z up, facing anywhere: the first frame is made to face the camera.
        body: Its leg length sets the scale.
        travel: The body goes where the person went, from the middle; otherwise it stays there, and
            only its height changes.
    Returns: one item for each frame: bone rotations and offset for `body.transforms`.
    Raises: InputError where the skeleton has no hips with two legs.
    """
    frames, rest = body_frames(motion), Rest.of(body)
    hip, knee, ankle = (body.joint(f"{n}.L") for n in ("upperleg01", "lowerleg01", "foot"))
    root = body.joint("root")
    middle = hip * [0, 1, 1]
    leg = np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)
    hips = frames.hips * leg
    hips[:, :2] += middle[:2] - (hips[0, :2] if travel else hips[:, :2])
    # the pelvis turns about the root, which is not between the hip joints
    offsets = hips - root - frames.pelvis @ (middle - root)
    offsets[:, 2] -= np.quantile(_lowest(frames, rest, body, hips), ON_FLOOR)
    places = np.arange(len(offsets), dtype=np.float64)
    return BvhPoses(rest, frames, offsets, motion.frame_rate, places)


def _lowest(frames: Frames, rest: Rest, body: Body, hips: Float64[np.ndarray, "N 3"]) -> Numbers:
    """Find the height of the lower sole in each frame, were the body's hips at `hips`."""
    hip, knee, ankle, toe = (
        body.joint(f"{n}.L") for n in ("upperleg01", "lowerleg01", "foot", "toe2-2")
    )
    under = [np.array([ankle[0], ankle[1] + HEEL_BEHIND, 0.0]), toe * [1, 1, 0]]
    heights = []
    for side, leg in enumerate(frames.legs):
        pelvis = frames.pelvis * np.outer(MIRROR, MIRROR) if side else frames.pelvis
        place = pelvis @ (hip * [1, 0, 0])
        place = place + leg.upper @ LEG_AT_ZERO.T @ rest.leg @ (knee - hip)
        place = place + leg.lower @ LEG_AT_ZERO.T @ rest.leg @ (ankle - knee)
        heights += [(place + leg.tip @ (sole - ankle))[:, 2] for sole in under]
    return hips[:, 2] + np.min(heights, axis=0)
