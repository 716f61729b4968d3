"""BlazeFace, the network that finds faces.

It looks at 128 x 128 pixels and says for each of 896 anchors whether a face is there, and where. It
was made for the front cameras of telephones: a face should fill a good part of what it sees.

Source: Bazarevsky et al., BlazeFace (2019); anchors and how outputs are read are those of
MediaPipe's graph `face_detection_short_range_cpu` (0.10.14).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.estimate.inference import open_network

FACE_SIZE = 128
LAYERS = ((8, 2), (16, 6))
"""The stride of each grid of anchors, and how many anchors a cell has."""

POINTS = 8
"""Pairs of numbers an anchor: the box's middle and size, both eyes, nose, mouth, both ears."""


@dataclass(frozen=True)
class FaceDetection:
    """The most certain face.

    Attributes:
        score: Chance that it is one, 0..1.
        middle: x and y of its box's middle, in [0, 1] of the picture.
        size: Width and height of the box, likewise.
    """

    score: float
    middle: tuple[float, float]
    size: tuple[float, float]


class FaceDetector:
    """The detector.

    Raises: InputError if the file is no model.
    """

    def __init__(self, model: Path) -> None:
        self._network = open_network(model)

    def detect(self, picture: UInt8[np.ndarray, "128 128 3"]) -> FaceDetection:
        """Find the face that it is most certain of, however uncertain that is."""
        seen = picture[None].astype(np.float32) / 127.5 - 1
        raw, logits = (output[0] for output in self._network.run(seen))
        best = int(logits[:, 0].argmax())
        score = 1 / (1 + np.exp(-float(logits[best, 0].clip(-100, 100))))
        offset, size = raw[best].reshape(POINTS, 2)[:2] / FACE_SIZE
        x, y = anchor_centres()[best] + offset
        return FaceDetection(score, (float(x), float(y)), (float(size[0]), float(size[1])))


@cache
def anchor_centres() -> Float32[np.ndarray, "896 2"]:
    """List x and y of each anchor in [0, 1]."""
    grids = []
    for stride, each in LAYERS:
        cells = FACE_SIZE // stride
        y, x = (np.mgrid[:cells, :cells] + 0.5) / cells
        grids.append(np.stack([x.ravel(), y.ravel()], 1).repeat(each, axis=0))
    return np.concatenate(grids).astype(np.float32)
