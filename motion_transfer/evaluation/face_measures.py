"""Measures that networks made for faces compute: whether one is there, and whose it is.

Both look only at targets that look at the camera, which their IUV tells.
"""

from __future__ import annotations

import math

import numpy as np
import torch

from motion_transfer.estimate.blazeface import FACE_SIZE, FaceDetector
from motion_transfer.estimate.models import FACE_DETECTOR, FACE_NETWORK, find_model
from motion_transfer.evaluation.framing import Image, PairPictures
from motion_transfer.evaluation.measures import Column, Numbers, hash_weights, to_tensor
from motion_transfer.evaluation.region_measures import mark_face
from motion_transfer.training.face_networks import (
    CHIP_SIZE,
    frame_chips,
    load_dlib_face,
)
from motion_transfer.training.faces import (
    HEAD_PARTS,
    MIN_FACE_PIXELS,
    MIN_HEAD_PIXELS,
    crop_boxes,
    face_table,
    find_faces,
    find_heads,
)
from motion_transfer.training.metrics import stack_iuv

LEAST_EVEN = 0.5  # of one half of the face to the other, in pixels
MIN_FACE_HEIGHT = 10  # px, chin to eyebrows
LOOKS = (
    f"only targets that look at the camera: each half of the face, chin to eyebrows, has more than"
    f" {LEAST_EVEN} times the other's pixels, and it is {MIN_FACE_HEIGHT} px high"
)

AROUND_HEAD = 1.5
"""Side of what the detector sees, in sides of the head's square."""

LEAST_SCORE = 0.75
"""Of 39 real pictures of held-out synthetic people who look at the camera, 97 % score more; of the
same with the face painted over in the colour of its skin, and of heads from behind, none."""

FACE_TABLE = face_table()


def looks_at_camera(iuv: Image) -> bool:
    """Tell whether the face is turned to the camera and large enough to be recognised."""
    face = mark_face(iuv, FACE_TABLE)
    smaller, larger = sorted(np.count_nonzero(face & (iuv[..., 0] == part)) for part in HEAD_PARTS)
    rows = np.flatnonzero(face.any(1))
    return bool(
        smaller + larger >= MIN_FACE_PIXELS
        and smaller > LEAST_EVEN * larger
        and np.ptp(rows) + 1 >= MIN_FACE_HEIGHT
        and np.isin(iuv[..., 0], HEAD_PARTS).sum() >= MIN_HEAD_PIXELS
    )


class FacesMeasure:
    """Whether a detector finds a face where the target has one.

    Raises: InputError if the detector is not in the cache, or the package that runs it is missing.
    """

    takes_turns = True  # the detector serves one thread

    def __init__(self) -> None:
        self._detector = FaceDetector(find_model(FACE_DETECTOR))
        definition = (
            f"share of results in which BlazeFace (short range, sha256 {FACE_DETECTOR.sha256[:16]})"
            f" finds a face with a score of {LEAST_SCORE} whose box lies inside the head's square,"
            f" looking at {AROUND_HEAD} times its side; {LOOKS}"
        )
        self.columns = (Column("face-found", "higher", 3, definition),)

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        if not looks_at_camera(shown.target.iuv):
            return [(math.nan,)] * len(shown.results)
        return [(float(self.finds_face(result, shown.target.iuv)),) for result in shown.results]

    def finds_face(self, picture: Image, iuv: Image) -> bool:
        """Tell whether a face is found where a head is by its IUV."""
        boxes, _ = find_heads(stack_iuv(iuv))
        low, high = boxes.split(2, 1)
        middle, half = (low + high) / 2, (high - low) / 2 * AROUND_HEAD
        pixels = torch.from_numpy(np.ascontiguousarray(picture)).permute(2, 0, 1)[None].float()
        seen = crop_boxes(
            pixels, torch.cat([middle - half, middle + half], 1), (FACE_SIZE, FACE_SIZE)
        )
        found = self._detector.detect(seen[0].permute(1, 2, 0).round().byte().numpy())
        reach = [abs(x - 0.5) + side / 2 for x, side in zip(found.middle, found.size, strict=True)]
        return found.score >= LEAST_SCORE and max(reach) * AROUND_HEAD <= 0.5


class IdentityMeasure:
    """How far the result's face is from the target's, as a face recognition network sees them.

    Args:
        network: Face crops as `frame_chips` frames them, in [-1, 1], to embeddings.
    """

    takes_turns = True

    def __init__(self, network: torch.nn.Module) -> None:
        definition = (
            "Euclidean distance of the embeddings of dlib's face recognition network (v1; up to 0.6"
            f" is one person); the crop follows from the target's IUV; {LOOKS}; weights sha256"
            f" {hash_weights(network)}"
        )
        self.columns = (Column("identity", "lower", 3, definition),)
        self._network = network

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        if not looks_at_camera(shown.target.iuv):
            return [(math.nan,)] * len(shown.results)
        boxes, _ = find_faces(stack_iuv(shown.target.iuv), FACE_TABLE)
        pictures = to_tensor([shown.target.rgb, *shown.results])
        with torch.inference_mode():
            chips = crop_boxes(
                pictures, frame_chips(boxes).expand(len(pictures), 4), (CHIP_SIZE, CHIP_SIZE)
            )
            real, *rendered = self._network(chips)
            return [(float(torch.linalg.vector_norm(each - real)),) for each in rendered]


def load_identity() -> IdentityMeasure:
    """Load that measure with dlib's network. Raises: InputError if it is not in the cache."""
    return IdentityMeasure(load_dlib_face(find_model(FACE_NETWORK)))
