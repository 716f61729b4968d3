"""BlazePose's two networks: the detector, and the landmarks.

The detector looks at 224 x 224 pixels of a frame and says for each of 2,254 anchors whether
somebody's face and trunk are there, where, and how large the circle around the whole body is. The
landmark model looks at one person: 33 points in the picture and in metres, and the person's mask.

Source: Bazarevsky et al., BlazePose (2020); anchors, decoder's numbers and how outputs are read are
those of MediaPipe's graphs `pose_detection_cpu` and `pose_landmark_by_roi_cpu` (0.10.14).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.inference import open_network
from motion_transfer.estimate.interface import (
    LANDMARK,
    LANDMARK_COUNT,
    LANDMARK_NAMES,
    Landmarks,
    other_side,
)

DETECTOR_SIZE = 224
STRIDES = (8, 16, 32, 32, 32)
ANCHORS_A_CELL = 2  # per layer: one, and one at the scale between it and the next
SCORE_LIMIT = 100.0
LEAST_SCORE = 0.5
SAME_PERSON = 0.3  # overlap (intersection over union) from which two boxes are one person

LANDMARKS_SIZE = 256
FEATURE_TENSORS = tuple(
    f"model_1/model/up_sampling2d_{stage}/resize/ResizeBilinear" for stage in (2, 3)
)
"""Enlarged maps of the landmark model: with the finer maps that are added to them they are all that
its heat maps, and its mask, are read from."""

LAST_PIXEL = 1 - 1 / LANDMARKS_SIZE  # where it lies in a region, see `Region.matrix`
OTHER_SIDE = [LANDMARK[other_side(name)] for name in LANDMARK_NAMES]
"""For each landmark the place of its mirror image in the list."""

LEAST_PRESENCE = 0.5  # a smaller chance that a body is there means that there is none
REFINED_RADIUS = 3  # cells: a landmark is refined by its heat map's 7 x 7 cells around it,
REFINED_FROM = 0.5  # where one of them is at least this hot


@dataclass(frozen=True)
class Detection:
    """Somebody.

    Attributes:
        score: Chance that it is a person, 0..1.
        region: What the landmark model should look at.
    """

    score: float
    region: Region


class PersonDetector:
    """The detector."""

    def __init__(self, model: Path) -> None:
        self._network = open_network(model)

    def detect(
        self,
        frame: UInt8[np.ndarray, "H W 3"],
        region: Region | None = None,
        least_score: float = LEAST_SCORE,
    ) -> list[Detection]:
        """Find everybody in a frame of any size, or in one square of it, the most certain first.

        Coordinates are the frame's.
        """
        height, width = frame.shape[:2]
        region = region or Region(width / 2, height / 2, max(height, width))
        seen = region.cut(frame, DETECTOR_SIZE, border=cv2.BORDER_CONSTANT)
        raw, logits = self._network.run(seen[None].astype(np.float32) / 127.5 - 1)
        found = []
        for score, points in merge_overlapping(*decode(raw[0], logits[0, :, 0], least_score)):
            found.append(Detection(score, Region.around_body(*region.to_frame(points[2:4]))))
        return found


@cache
def anchor_centres() -> Float32[np.ndarray, "2254 2"]:
    """List x and y of each anchor in [0, 1]; layers of the same stride share their cells."""
    rows = []
    for stride in sorted(set(STRIDES)):
        cells = DETECTOR_SIZE // stride
        each = ANCHORS_A_CELL * STRIDES.count(stride)
        y, x = (np.mgrid[:cells, :cells] + 0.5) / cells
        rows.append(np.repeat(np.stack([x.ravel(), y.ravel()], 1), each, axis=0))
    return np.concatenate(rows).astype(np.float32)


def decode(
    raw: Float32[np.ndarray, "2254 12"], logits: Float32[np.ndarray, " 2254"], least_score: float
) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, "N 6 2"]]:
    """Read the network's output as scores and points, for the anchors that are certain enough.

    Returns: Scores, and for each (left, top), (right, bottom) and four alignment points in [0, 1]
        of the square: middle of the hips, circle of the body, middle of the shoulders, circle of
        the upper body.
    """
    scores = 1 / (1 + np.exp(-logits.clip(-SCORE_LIMIT, SCORE_LIMIT).astype(np.float64)))
    kept = np.flatnonzero(scores >= least_score)
    points = raw[kept].reshape(-1, 6, 2) / DETECTOR_SIZE
    # the first pair is the box's middle, from the anchor; the second its size
    centre, size = points[:, 0] + anchor_centres()[kept], points[:, 1].copy()
    points[:, 2:] += anchor_centres()[kept, None]
    points[:, 0], points[:, 1] = centre - size / 2, centre + size / 2
    return scores[kept].astype(np.float32), points


def merge_overlapping(
    scores: Float32[np.ndarray, " N"], points: Float32[np.ndarray, "N 6 2"]
) -> list[tuple[float, Float32[np.ndarray, "6 2"]]]:
    """Make one of each group of overlapping boxes: their mean weighted by score.

    Source: weighted non-maximum suppression, Bazarevsky et al., BlazeFace (2019).
    """
    left = np.argsort(-scores, kind="stable")
    merged = []
    while len(left):
        same = _overlaps(points[left[0]], points[left]) > SAME_PERSON
        same[0] = True  # also where its box is empty, or the loop would not end
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


@dataclass(frozen=True)
class BodyFeatures:
    """What the landmark model knows of each place of a region, before it decides.

    Attributes:
        coarse: What the heat maps are read from.
        fine: What the mask is read from.
        region: Where it looked.
    """

    coarse: Float32[np.ndarray, "64 64 48"]
    fine: Float32[np.ndarray, "128 128 8"]
    region: Region

    def look(
        self, window: Float64[np.ndarray, "2 3"]
    ) -> tuple[Float32[np.ndarray, "64 64 48"], Float32[np.ndarray, "128 128 8"]]:
        """See both in a window, 0 where it reaches beyond the region.

        Args:
            window: From frame coordinates to the window's, which run from (0, 0) to (1, 1).
        """
        return self._look(self.coarse, window), self._look(self.fine, window)

    def _look(
        self, features: Float32[np.ndarray, "n n C"], window: Float64[np.ndarray, "2 3"]
    ) -> Float32[np.ndarray, "n n C"]:
        size = len(features)
        pixels = LANDMARKS_SIZE / size  # of the picture that the network saw
        seen = np.array([[pixels, 0, pixels / 2 - 0.5], [0, pixels, pixels / 2 - 0.5], [0, 0, 1]])
        to_frame = self.region.matrix(LANDMARKS_SIZE) @ seen
        # OpenCV's whole numbers are pixel centres
        to_frame[:, 2] += 0.5
        matrix = window @ np.vstack([to_frame, [0, 0, 1]]) * size
        matrix[:, 2] -= 0.5
        return cv2.warpAffine(features, matrix, (size, size), flags=cv2.INTER_LINEAR)


@dataclass(frozen=True)
class SeenBody:
    """What the landmark model saw in a region.

    Attributes:
        presence: Chance that a body is there, 0..1.
        landmarks: 33 points on the frame.
        region: Where it looked.
        mask: The person's share of each pixel of the region, 0..1.
        next_region: Where to look in the next frame.
        features: None where the body was given other proportions than the picture's, or a mirror
            was looked at.
    """

    presence: float
    landmarks: Landmarks
    region: Region
    mask: Float32[np.ndarray, "256 256"]
    next_region: Region
    features: BodyFeatures | None


class LandmarkModel:
    """The landmark model."""

    def __init__(self, model: Path) -> None:
        self._network = open_network(model, FEATURE_TENSORS)

    def locate(
        self, frame: UInt8[np.ndarray, "H W 3"], region: Region, *, mirrored: bool = False
    ) -> SeenBody | None:
        """Find the body in a region of the frame; None where there is none.

        Args:
            mirrored: Whether to look in a mirror; there are no features then.

        Of the network's 39 points 33 are landmarks and two span the region of the next frame; the
        others serve the network's training.
        """
        if not region.is_usable:
            return None
        seen = region.cut(frame, LANDMARKS_SIZE, border=cv2.BORDER_REPLICATE)
        if mirrored:
            seen = seen[:, ::-1]
        outputs = self._network.run(seen[None].astype(np.float32) / 255)
        points, presence, mask, heat, world, *maps = (output[0] for output in outputs)
        if (chance := float(presence[0])) < LEAST_PRESENCE:
            return None
        rows = points.reshape(-1, 5)  # x, y, depth, and two chances
        places = refine(rows[:, :2] / LANDMARKS_SIZE, heat)
        if mirrored:
            places[:, 0] = LAST_PIXEL - places[:, 0]
        on_frame = region.to_frame(places)
        depth = rows[:, 2:3] / LANDMARKS_SIZE * region.side
        chances = _sigmoid(rows[:, 3:])
        metres = world.reshape(-1, 3).copy()
        if mirrored:
            metres[:, 0] *= -1
        metres[:, :2] = region.rotate(metres[:, :2])
        kept = OTHER_SIDE if mirrored else slice(LANDMARK_COUNT)
        landmarks = Landmarks(
            image=np.concatenate([on_frame, depth], 1)[kept].astype(np.float32),
            world=metres[kept],
            visibility=chances[kept, 0],
            presence=chances[kept, 1],
        )
        next_region = Region.around_body(*on_frame[LANDMARK_COUNT : LANDMARK_COUNT + 2])
        mask = _sigmoid(mask[..., 0])
        if mirrored:
            return SeenBody(chance, landmarks, region, mask[:, ::-1], next_region, None)
        # copies: the network's next answer overwrites this one
        coarse, fine = (each.transpose(1, 2, 0).copy() for each in maps)
        features = BodyFeatures(coarse, fine, region)
        return SeenBody(chance, landmarks, region, mask, next_region, features)


def refine(
    places: Float32[np.ndarray, "N 2"], heat: Float32[np.ndarray, "h w N"]
) -> Float32[np.ndarray, "N 2"]:
    """Move each point to the centre of gravity of its heat map nearby, where that is hot.

    Args:
        places: In [0, 1] of the region.
        heat: Logits, one map for each point.
    """
    height, width, _ = heat.shape
    centres = (places * (width, height)).astype(np.int64)  # column and row, towards zero
    steps = np.arange(-REFINED_RADIUS, REFINED_RADIUS + 1)
    rows, columns = centres[:, 1, None, None] + steps[:, None], centres[:, 0, None, None] + steps
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    index = np.arange(len(places))[:, None, None]
    near = _sigmoid(heat[rows.clip(0, height - 1), columns.clip(0, width - 1), index]) * inside
    total = near.sum((1, 2))
    is_hot = ((centres >= 0) & (centres < (width, height))).all(1)
    is_hot &= near.max((1, 2)) >= REFINED_FROM
    refined = places.copy()
    for axis, cells, count in ((0, columns, width), (1, rows, height)):
        middle = (near * cells).sum((1, 2))
        np.divide(middle, total * count, out=refined[:, axis], where=is_hot)
    return refined


def _sigmoid(logits: np.ndarray) -> np.ndarray:
    return (1 / (1 + np.exp(-logits.clip(-60, 60)))).astype(np.float32)  # exp(60) fits float32
