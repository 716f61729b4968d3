"""Measures of faces: which targets they look at, and what they ask of their networks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from motion_transfer.errors import InputError
from motion_transfer.estimate.blazeface import FaceDetection
from motion_transfer.evaluation import face_measures
from motion_transfer.evaluation.face_measures import FacesMeasure, IdentityMeasure, looks_at_camera
from motion_transfer.evaluation.framing import PairPictures, TargetFrame
from motion_transfer.evaluation.measures import MEASURES, choose_measures
from motion_transfer.training.faces import face_table


def face_iuv(right: int = 12, left: int = 12, height: int = 14) -> np.ndarray:
    """A head in a picture of 96 x 96 whose face is `right` and `left` px wide and so high."""
    iuv = np.zeros((96, 96, 3), np.uint8)
    table = face_table()
    places = {part: table[part].nonzero()[0] for part in (23, 24)}  # one place of the face, V, U
    bald = {part: (~table[part]).nonzero()[0] for part in (23, 24)}
    for part, columns, face in (
        (23, slice(48 - 16, 48), slice(48 - right, 48)),
        (24, slice(48, 48 + 16), slice(48, 48 + left)),
    ):
        iuv[20:60, columns] = (part, bald[part][1], bald[part][0])
        iuv[36 : 36 + height, face] = (part, places[part][1], places[part][0])
    return iuv


@pytest.mark.parametrize(
    ("face", "looks"),
    [
        ({}, True),
        ({"left": 7}, True),
        ({"left": 6}, False),  # half of the other
        ({"right": 0}, False),
        ({"height": 10}, True),
        ({"height": 9}, False),
        ({"right": 0, "left": 0}, False),
        ({"right": 3, "left": 3, "height": 11}, True),
        ({"right": 3, "left": 3, "height": 10}, False),  # 60 px
    ],
)
def test_who_looks_at_the_camera(face: dict[str, int], looks: bool) -> None:
    assert looks_at_camera(face_iuv(**face)) is looks


def pair_of(iuv: np.ndarray, rgb: np.ndarray, *results: np.ndarray) -> PairPictures:
    return PairPictures(rgb, iuv, TargetFrame(rgb, iuv, iuv[..., 0] > 0), results)


class Detector:
    """Says what it is told, of the brightness that it sees."""

    def __init__(self, _model: Path) -> None:
        self.found = FaceDetection(0.9, (0.5, 0.5), (0.3, 0.3))
        self.seen: list[np.ndarray] = []

    def detect(self, picture: np.ndarray) -> FaceDetection:
        self.seen.append(picture)
        return self.found


@pytest.fixture
def faces(monkeypatch) -> tuple[FacesMeasure, Detector]:
    detector = Detector(Path())
    monkeypatch.setattr(face_measures, "FaceDetector", lambda _model: detector)
    monkeypatch.setattr(face_measures, "find_model", lambda _file: Path())
    return FacesMeasure(), detector


def test_the_detector_sees_the_head_enlarged(faces) -> None:
    measure, detector = faces
    iuv = face_iuv()
    rgb = np.zeros((96, 96, 3), np.uint8)
    rgb[iuv[..., 0] > 0] = 200
    assert measure.measure(pair_of(iuv, rgb, rgb, rgb // 2)) == [(1.0,), (1.0,)]
    first, second = detector.seen
    assert first.shape == (128, 128, 3)
    # the head's 40 px are 1.35 * 1.5 less than the side
    rows = np.flatnonzero(first[:, 64, 0] > 100)
    assert len(rows) == pytest.approx(128 / (1.35 * 1.5), abs=2)
    assert rows.mean() == pytest.approx(63.5, abs=1)
    assert second.max() == 100


@pytest.mark.parametrize(
    ("found", "number"),
    [
        (FaceDetection(0.74, (0.5, 0.5), (0.3, 0.3)), 0.0),
        (FaceDetection(0.76, (0.5, 0.5), (0.3, 0.3)), 1.0),
        (FaceDetection(0.9, (0.5, 0.75), (0.3, 0.3)), 0.0),  # beside the head
        (FaceDetection(0.9, (0.5, 0.5), (0.8, 0.8)), 0.0),  # larger than it
    ],
)
def test_a_face_is_certain_and_inside_the_head(faces, found: FaceDetection, number: float) -> None:
    measure, detector = faces
    detector.found = found
    iuv = face_iuv()
    assert measure.measure(pair_of(iuv, iuv, iuv)) == [(number,)]


def test_targets_that_look_away_have_no_number(faces) -> None:
    measure, detector = faces
    iuv = face_iuv(left=2)
    assert np.isnan(measure.measure(pair_of(iuv, iuv, iuv))).all()
    assert np.isnan(IdentityMeasure(Means()).measure(pair_of(iuv, iuv, iuv))).all()
    assert not detector.seen


class Means(nn.Module):
    """Embeds a face crop as its mean colour."""

    def forward(self, face: torch.Tensor) -> torch.Tensor:
        assert face.shape[1:] == (3, 150, 150)
        return face.mean((2, 3))


def test_identity_is_the_distance_of_embeddings() -> None:
    iuv = face_iuv()
    rgb = np.full((96, 96, 3), 100, np.uint8)
    other = rgb.copy()
    other[..., 0] += 51  # 0.4 of [-1, 1]
    other[90:] = 0  # far from the face
    found = IdentityMeasure(Means()).measure(pair_of(iuv, rgb, rgb, other))
    assert found[0] == (0,)
    assert found[1] == pytest.approx((0.4,), abs=0.01)


@pytest.mark.parametrize("name", ["faces", "identity"])
def test_without_the_models_a_measure_is_left_out_or_says_how_to_fetch(
    name: str, monkeypatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path))
    assert not MEASURES[name].is_met(None, False)
    with pytest.raises(InputError, match="`mt models fetch --faces` fetches it"):
        choose_measures([name])
