"""BlazePose's person detector: boxes and four alignment points from a whole frame.

The network looks at 224 x 224 pixels and says for each of 2,254 anchors whether somebody's face and
trunk are there, where, and how large the circle around the whole body is.

Source: Bazarevsky et al., BlazePose (2020); the anchors' and decoder's numbers are those of
MediaPipe's graph `pose_detection_cpu` (0.10.14).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.estimate.litert import LiteModel
from motion_transfer.estimate.region import Region

SIZE = 224
STRIDES = (8, 16, 32, 32, 32)
ANCHORS_A_CELL = 2  # per layer: one, and one at the scale between it and the next
SCORE_LIMIT = 100.0
LEAST_SCORE = 0.5
SAME_PERSON = 0.3
"""Overlap (intersection over union) from which two boxes are one person."""


@dataclass(frozen=True)
class Detection:
    """Somebody.

    Attributes:
        score: chance that it is a person, 0..1.
        box: left, top, right, bottom of face and trunk, frame pixels.
        hips: x, y of the middle of the hips.
        top: x, y of a point above the head, on the circle around the whole body.
    """

    score: float
    box: Float32[np.ndarray, 4]
    hips: Float32[np.ndarray, 2]
    top: Float32[np.ndarray, 2]

    @property
    def region(self) -> Region:
        """What the landmark model should look at."""
        return Region.around_body(self.hips, self.top)


class PersonDetector:
    """The detector; one object serves one thread."""

    def __init__(self, model: Path, threads: int = 1) -> None:
        self._model = LiteModel(model, threads)

    def detect(
        self, frame: UInt8[np.ndarray, "H W 3"], *, least_score: float = LEAST_SCORE
    ) -> list[Detection]:
        """Everybody in a frame of any size, the most certain first."""
        height, width = frame.shape[:2]
        return self.detect_in(frame, Region(width / 2, height / 2, max(height, width)), least_score)

    def detect_in(
        self, frame: UInt8[np.ndarray, "H W 3"], region: Region, least_score: float = LEAST_SCORE
    ) -> list[Detection]:
        """Everybody in one square of a frame; coordinates are the frame's."""
        seen = region.cut(frame, SIZE, border=cv2.BORDER_CONSTANT)
        raw, logits = self._model.run(seen.astype(np.float32) / 127.5 - 1)
        found = decode(raw, logits[:, 0], least_score)
        return [
            Detection(
                float(score),
                region.to_frame(points[:2]).reshape(4),
                *region.to_frame(points[2:4]),
            )
            for score, points in merge_overlapping(*found)
        ]


@cache
def anchor_centres() -> Float32[np.ndarray, "2254 2"]:
    """x and y of each anchor in [0, 1]; layers of the same stride share their cells."""
    rows = []
    for stride in sorted(set(STRIDES)):
        cells = SIZE // stride
        each = ANCHORS_A_CELL * STRIDES.count(stride)
        y, x = (np.mgrid[:cells, :cells] + 0.5) / cells
        rows.append(np.repeat(np.stack([x.ravel(), y.ravel()], 1), each, axis=0))
    return np.concatenate(rows).astype(np.float32)


def decode(
    raw: Float32[np.ndarray, "2254 12"], logits: Float32[np.ndarray, " 2254"], least_score: float
) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, "N 6 2"]]:
    """The network's output as scores and points, for the anchors that are certain enough.

    Returns: scores, and for each (left, top), (right, bottom) and four alignment points in [0, 1]
        of the square: middle of the hips, circle of the body, middle of the shoulders, circle of
        the upper body.
    """
    scores = 1 / (1 + np.exp(-logits.clip(-SCORE_LIMIT, SCORE_LIMIT).astype(np.float64)))
    kept = np.flatnonzero(scores >= least_score)
    points = raw[kept].reshape(-1, 6, 2) / SIZE
    centre, size = points[:, 0] + anchor_centres()[kept], points[:, 1].copy()
    points[:, 2:] += anchor_centres()[kept, None]
    points[:, 0], points[:, 1] = centre - size / 2, centre + size / 2
    return scores[kept].astype(np.float32), points


def merge_overlapping(
    scores: Float32[np.ndarray, " N"], points: Float32[np.ndarray, "N 6 2"]
) -> list[tuple[float, Float32[np.ndarray, "6 2"]]]:
    """One of each group of overlapping boxes: their mean weighted by score (weighted non-maximum
    suppression, Bazarevsky et al., BlazeFace, 2019)."""
    left = np.argsort(-scores, kind="stable")
    merged = []
    while len(left):
        same = _overlaps(points[left[0]], points[left]) > SAME_PERSON
        same[0] = True
        group = left[same]
        weights = scores[group] / scores[group].sum()
        merged.append((float(scores[left[0]]), np.einsum("n,nij->ij", weights, points[group])))
        left = left[~same]
    return merged


def _overlaps(
    one: Float32[np.ndarray, "6 2"], many: Float32[np.ndarray, "N 6 2"]
) -> Float32[np.ndarray, " N"]:
    low, high = np.maximum(one[0], many[:, 0]), np.minimum(one[1], many[:, 1])
    shared = (high - low).clip(0).prod(-1)
    areas = (many[:, 1] - many[:, 0]).prod(-1)
    return shared / np.maximum(areas + (one[1] - one[0]).prod() - shared, 1e-9)
