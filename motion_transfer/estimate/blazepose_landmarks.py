"""BlazePose's landmark model: 33 points in the picture and in metres, and the person's mask.

Source: Bazarevsky et al., BlazePose (2020); how the outputs are read follows MediaPipe's graph
`pose_landmark_by_roi_cpu` (0.10.14).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.estimate.interface import LANDMARK_COUNT, Landmarks
from motion_transfer.estimate.litert import LiteModel
from motion_transfer.estimate.region import Region

SIZE = 256
LEAST_PRESENCE = 0.5
"""A smaller chance that a body is there means that there is none."""

REFINED_RADIUS = 3
REFINED_FROM = 0.5
"""A landmark moves to the middle of its heat map's 7 x 7 cells around it where one of them is at
least this hot."""


@dataclass(frozen=True)
class SeenBody:
    """What the landmark model saw in a region.

    Attributes:
        presence: chance that a body is there, 0..1.
        landmarks: 33 points on the frame.
        region: where it looked.
        mask: the person's share of each pixel of the region, 0..1.
        next_region: where to look in the next frame.
    """

    presence: float
    landmarks: Landmarks
    region: Region
    mask: Float32[np.ndarray, "256 256"]
    next_region: Region


class LandmarkModel:
    """The landmark model; one object serves one thread."""

    def __init__(self, model: Path, threads: int = 1) -> None:
        self._model = LiteModel(model, threads)

    def look(self, frame: UInt8[np.ndarray, "H W 3"], region: Region) -> SeenBody | None:
        """The body in a region of the frame; None where there is none."""
        if not region.is_usable:
            return None
        seen = region.cut(frame, SIZE, border=cv2.BORDER_REPLICATE)
        points, presence, mask, heat, world = self._model.run(seen.astype(np.float32) / 255)
        if float(presence[0]) < LEAST_PRESENCE:
            return None
        return read_outputs(points, float(presence[0]), mask[..., 0], heat, world, region)


def read_outputs(
    points: Float32[np.ndarray, 195],
    presence: float,
    mask: Float32[np.ndarray, "256 256"],
    heat: Float32[np.ndarray, "64 64 39"],
    world: Float32[np.ndarray, 117],
    region: Region,
) -> SeenBody:
    """The network's outputs on the frame. Of 39 points 33 are landmarks and two span the region of
    the next frame; the others serve the network's training."""
    rows = points.reshape(-1, 5)
    place = refine(rows[:, :2] / SIZE, heat)
    on_frame = region.to_frame(place)
    depth = rows[:, 2:3] / SIZE * region.side
    chances = _sigmoid(rows[:, 3:])
    metres = world.reshape(-1, 3).copy()
    metres[:, :2] = region.rotate(metres[:, :2])
    kept = slice(LANDMARK_COUNT)
    landmarks = Landmarks(
        image=np.concatenate([on_frame, depth], 1)[kept].astype(np.float32),
        world=metres[kept],
        visibility=chances[kept, 0],
        presence=chances[kept, 1],
    )
    hips, top = on_frame[LANDMARK_COUNT : LANDMARK_COUNT + 2]
    return SeenBody(presence, landmarks, region, _sigmoid(mask), Region.around_body(hips, top))


def refine(
    places: Float32[np.ndarray, "N 2"], heat: Float32[np.ndarray, "h w N"]
) -> Float32[np.ndarray, "N 2"]:
    """Each point moved to the centre of gravity of its heat map nearby, where that is hot.

    Args:
        places: in [0, 1] of the region.
        heat: logits, one map for each point.
    """
    height, width, _ = heat.shape
    refined = places.copy()
    for index, (x, y) in enumerate(places):
        column, row = int(x * width), int(y * height)
        if not (0 <= column < width and 0 <= row < height):
            continue
        top, left = max(0, row - REFINED_RADIUS), max(0, column - REFINED_RADIUS)
        near = heat[top : row + REFINED_RADIUS + 1, left : column + REFINED_RADIUS + 1, index]
        near = _sigmoid(near)
        if near.max() < REFINED_FROM:
            continue
        rows, columns = np.indices(near.shape)
        total = near.sum()
        refined[index] = (
            (near * (columns + left)).sum() / total / width,
            (near * (rows + top)).sum() / total / height,
        )
    return refined


def _sigmoid(logits: np.ndarray) -> np.ndarray:
    return (1 / (1 + np.exp(-logits.clip(-60, 60)))).astype(np.float32)
