"""Bringing a body into a pose."""

from __future__ import annotations

from motion_transfer.people.figure.body import Body, BodyModel, Rotations
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.people.motion.poses import Pose, placed, pose_rotations


def posed(body: Body, pose: Pose, model: BodyModel) -> PosedBody:
    """A body in a pose, standing on the floor z = 0 (or as high above it as the pose says)."""
    transforms = body.transforms(pose_rotations(pose, body))
    points = model.pose(body, transforms)
    shift = placed(points, pose)
    points += shift
    transforms[..., 3] += shift
    return PosedBody(body, transforms, points, body.posed_joints(transforms))


def moved(
    body: Body, rotations: Rotations, offset: tuple[float, float, float], model: BodyModel
) -> PosedBody:
    """A body with bones turned and the whole of it moved by an offset in metres."""
    transforms = body.transforms(rotations, offset)
    points = model.pose(body, transforms)
    return PosedBody(body, transforms, points, body.posed_joints(transforms))
