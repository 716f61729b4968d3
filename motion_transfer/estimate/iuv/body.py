"""What the IUV network is told of a person, in a window around it. No torch here.

Convention: the network looks at a square window around a person. Window coordinates run from (0, 0)
at its top left corner to (1, 1); depth is in the same unit.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_COUNT, Bone, Landmarks, both_sides

MASK_SIZE = 256
GRID = 64  # bones are drawn on 64 x 64 cells; the mask's finer pixels are channels of a cell
MARGIN = 0.06  # share of the window's side that is left free around the person
REACH = 0.2  # how far a bone is felt, in lengths of the trunk: a thigh's width
LEAST_REACH = 1.5 / GRID  # a cell and a half: thinner bones would fall between the cells
COARSE = (64, 64, 48)
FINE = (128, 128, 8)
FEATURE_SCALE = 0.25  # brings the landmark model's features to about one
NEAR_METRES = 0.3  # the unit in which depths are seen
MOST_BESIDE, MOST_DEPTH = 3.0, 4.0  # far from a bone, how far it is says nothing more

SHOULDERS, HIPS = ("left-shoulder", "right-shoulder"), ("left-hip", "right-hip")
_EARS = ("left-ear", "right-ear")
BONES: tuple[Bone, ...] = (
    *both_sides(
        *(("shoulder", "elbow"), ("elbow", "wrist")),
        *(("wrist", "index"), ("wrist", "pinky"), ("wrist", "thumb")),
        *(("hip", "knee"), ("knee", "ankle"), ("ankle", "heel"), ("heel", "foot-index")),
        ("shoulder", "hip"),
    ),
    *(((left,), (right,)) for left, right in (SHOULDERS, HIPS)),
    *((SHOULDERS, HIPS), (SHOULDERS, _EARS), (("left-ear",), ("right-ear",))),
    *((_EARS, ("nose",)), (("nose",), ("mouth-left", "mouth-right"))),
)
"""What is drawn. The trained weights depend on the order."""

FINE_CELL, MASK_CELL = FINE[0] // GRID, MASK_SIZE // GRID  # pixels along a cell's side
MAP_CHANNELS = 3 * len(BONES) + 2 + MASK_CELL**2 + COARSE[2] + FINE_CELL**2 * FINE[2]
VECTOR_LENGTH = 7 * LANDMARK_COUNT


class BodyArrays(NamedTuple):
    """What is known of one person.

    Attributes:
        points: X, y and depth in window coordinates.
        world: Metres, as in `Landmarks`.
        visibility: As in `Landmarks`, 0..1.
        mask: How much of each pixel is the person, 0..1.
        coarse, fine: The landmark model's features there, see `BodyFeatures`; 0 where there are
            none.
    """

    points: Float32[np.ndarray, "1 33 3"]
    world: Float32[np.ndarray, "1 33 3"]
    visibility: Float32[np.ndarray, "1 33"]
    mask: Float32[np.ndarray, "1 1 256 256"]
    coarse: Float32[np.ndarray, "1 64 64 48"]
    fine: Float32[np.ndarray, "1 128 128 8"]


def body_window(landmarks: Landmarks, mask_box: Box | None) -> Box:
    """Lay a square around what the mask covers, and the landmarks that are in the picture.

    It may reach beyond the frame.
    """
    points = landmarks.image[landmarks.presence > 0.5, :2]  # in the picture rather than not
    if mask_box is not None:
        ends = [[mask_box.left, mask_box.top], [mask_box.right, mask_box.bottom]]
        points = np.concatenate([points, np.array(ends, np.float32)])
    if not len(points):
        points = landmarks.image[:, :2]
    low, high = points.min(0), points.max(0)
    side = max(2, int(np.ceil((high - low).max() / (1 - 2 * MARGIN))))
    left, top = (int(corner) for corner in np.floor((low + high - side) / 2))
    return Box(left, top, left + side, top + side)


def body_arrays(
    landmarks: Landmarks,
    mask: Float32[np.ndarray, "H W"],
    features: tuple[Float32[np.ndarray, "64 64 48"], Float32[np.ndarray, "128 128 8"]] | None,
    window: Box,
) -> BodyArrays:
    """Put together what is known of one person.

    Args:
        mask: 0..1 on the window, at any size.
        features: Coarse and fine ones on the window.
    """
    points = landmarks.image.copy()
    points[:, :2] -= (window.left, window.top)
    points /= window.width
    way = cv2.INTER_AREA if mask.shape[0] > MASK_SIZE else cv2.INTER_LINEAR
    coarse, fine = features or (np.zeros(COARSE, np.float32), np.zeros(FINE, np.float32))
    seen = cv2.resize(mask, (MASK_SIZE, MASK_SIZE), interpolation=way)
    return BodyArrays(
        points=points[None],
        world=np.ascontiguousarray(landmarks.world)[None],
        visibility=np.ascontiguousarray(landmarks.visibility)[None],
        mask=seen[None, None],
        coarse=coarse[None],
        fine=fine[None],
    )


@cache
def bone_ends() -> Float32[np.ndarray, "bones 2 33"]:
    """Tell which landmarks a bone's two ends are the middle of, as shares of each."""
    shares = np.zeros((len(BONES), 2, LANDMARK_COUNT), np.float32)
    for bone, ends in enumerate(BONES):
        for end, names in enumerate(ends):
            shares[bone, end, [LANDMARK[name] for name in names]] = 1 / len(names)
    return shares


@cache
def cell_centres() -> Float32[np.ndarray, "cells 2"]:
    """List x and y of the cells' centres, row by row."""
    centres = (np.arange(GRID, dtype=np.float32) + 0.5) / GRID
    y, x = np.meshgrid(centres, centres, indexing="ij")
    return np.stack([x.ravel(), y.ravel()], 1)
