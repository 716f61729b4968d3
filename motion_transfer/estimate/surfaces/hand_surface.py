"""A hand's surface, and how it is brought to 21 points.

Convention: axes are those of the picture: x to the right, y down, z away from who looks. At rest
the surface is in metres with the wrist's joint at 0; posed it is in frame pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files

import numpy as np
from jaxtyping import Float32, Int64, UInt8

SIDES = ("left", "right")
FOREARM, PALM = 0, 1  # bones; then three of each finger, the thumb first
PALM_POINTS = (0, 1, 5, 9, 13, 17)  # which move with the palm: the wrist, and the first knuckles
LEAST_STRETCH, MOST_STRETCH = 0.6, 1.6  # of a finger's bone; more is a point seen wrongly
LEAST_LENGTH = 1e-6


@dataclass(frozen=True)
class HandSurface:
    """The hand of one side at rest, with the end of its forearm.

    Attributes:
        points: Vertices.
        faces: Triangles of them, clockwise in the picture seen from outside.
        weights: How the 17 bones move the vertices; each row sums to 1.
        joints: Where the 21 points are.
        elbow: Where the forearm comes from.
        part, uv: Charts: the part of each triangle, and (U, V) of its corners, 0..255.
    """

    points: Float32[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    weights: Float32[np.ndarray, "V 17"]
    joints: Float32[np.ndarray, "21 3"]
    elbow: Float32[np.ndarray, 3]
    part: UInt8[np.ndarray, " F"]
    uv: UInt8[np.ndarray, "F 3 2"]

    def pose(
        self, points: Float32[np.ndarray, "21 3"], forearm: Float32[np.ndarray, 3] | None = None
    ) -> Float32[np.ndarray, "V 3"]:
        """Bring the surface to where the 21 points are seen.

        The palm is turned, scaled and moved as a whole; every bone of a finger lies between its two
        points and is as long as they are apart.

        Args:
            forearm: The direction from the elbow to the wrist; None: as at rest.
        """
        scale, turn = fit_turn(self.joints[list(PALM_POINTS)], points[list(PALM_POINTS)])
        moved = np.zeros((17, 3, 4))
        middle = (points - scale * self.joints @ turn.T)[list(PALM_POINTS)].mean(0)
        moved[PALM] = _matrix(scale * turn, np.zeros(3), middle)
        arm = turn
        if forearm is not None:
            arm = turn_between(turn @ -self.elbow, forearm) @ turn
        moved[FOREARM] = _matrix(scale * arm, np.zeros(3), middle)  # about the wrist's joint
        for finger in range(5):
            above = turn
            for joint in range(3):
                start = 1 + 4 * finger + joint
                rest, seen = (p[start + 1] - p[start] for p in (self.joints, points))
                above = turn_between(above @ rest, seen) @ above
                length = np.linalg.norm(seen) / (scale * np.linalg.norm(rest))
                stretch = np.clip(length, LEAST_STRETCH, MOST_STRETCH) - 1
                along = rest / np.linalg.norm(rest)
                longer = np.eye(3) + stretch * np.outer(along, along)
                bone = 2 + 3 * finger + joint
                moved[bone] = _matrix(scale * above @ longer, self.joints[start], points[start])
        blended = np.einsum("vb,bij->vij", self.weights, moved)
        return (np.einsum("vij,vj->vi", blended[..., :3], self.points) + blended[..., 3]).astype(
            np.float32
        )


@cache
def load_hand(side: str) -> HandSurface:
    """Load the hand of a side, once a process; its arrays are shared."""
    with (
        as_file(files("motion_transfer.estimate.surfaces") / "hand.npz") as path,
        np.load(path) as table,
    ):
        arrays = dict(table)
    mirror = np.array([-1.0 if side == "right" else 1.0, 1, 1], np.float32)
    number = SIDES.index(side)
    # a mirrored triangle runs the other way around
    order = [0, 1, 2] if side == "right" else [0, 2, 1]
    weights = arrays["weights"].astype(np.float32)
    return HandSurface(
        points=arrays["points"] * mirror,
        faces=arrays["faces"].astype(np.int64)[:, order],
        weights=weights / weights.sum(1, keepdims=True),
        joints=arrays["joints"] * mirror,
        elbow=arrays["elbow"] * mirror,
        part=arrays["part"][number],
        uv=arrays["uv"][number][:, order],
    )


def fit_turn(
    rest: Float32[np.ndarray, "N 3"], seen: Float32[np.ndarray, "N 3"]
) -> tuple[float, np.ndarray]:
    """Find the scale and the turn, without a mirror, that bring points nearest to others.

    Source: Umeyama, Least-squares estimation of transformation parameters (1991).
    """
    rest, seen = rest - rest.mean(0), seen - seen.mean(0)
    left, sizes, right = np.linalg.svd(seen.T.astype(np.float64) @ rest)
    signs = np.array([1, 1, np.sign(np.linalg.det(left @ right))])
    scale = float((sizes * signs).sum() / np.square(rest).sum())
    return max(scale, LEAST_LENGTH), left * signs @ right


def turn_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Find the shortest turn that brings a direction to another, 3 x 3.

    Source: Rodrigues' formula, written with the sine and cosine that the products give.
    """
    one, other = (v / max(float(np.linalg.norm(v)), LEAST_LENGTH) for v in (one, other))
    axis, cosine = np.cross(one, other), float(one @ other)
    if cosine < -1 + LEAST_LENGTH:  # opposite: about any axis across
        across = np.cross(one, np.eye(3)[np.abs(one).argmin()])
        across /= np.linalg.norm(across)
        return 2 * np.outer(across, across) - np.eye(3)
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + skew + skew @ skew / (1 + cosine)


def _matrix(turn: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Make the 3 x 4 matrix that turns about a place at rest and takes it to another."""
    return np.concatenate([turn, (end - turn @ start)[:, None]], 1)
