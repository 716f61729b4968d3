"""The estimator blazepose-heavy: the large landmark model, and a painter for its features."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from skimage import data

from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose import BlazePoseEstimator
from motion_transfer.estimate.clip import lay_iuv
from motion_transfer.estimate.models import HEAVY_LANDMARKER, find_model
from motion_transfer.estimate.opening import estimator_facts, open_estimator
from motion_transfer.people import PeopleStream
from motion_transfer.training.iuv.trainer import IuvScore, score_iuv


@pytest.fixture(scope="session")
def heavy_model(models: dict[str, Path]) -> Path:
    try:
        return find_model(HEAVY_LANDMARKER)
    except InputError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def estimators(heavy_model: Path) -> dict[str, BlazePoseEstimator]:
    names = {"full": False, "heavy": True}
    return {
        name: BlazePoseEstimator(heavy=heavy, most_people=1, smooth=False)
        for name, heavy in names.items()
    }


def test_it_sees_people_better(estimators, body_model) -> None:
    people = PeopleStream(split="held-out", size=(384, 384))
    scores: dict[str, list[IuvScore]] = {name: [] for name in estimators}
    for number in range(8, 20, 2):  # one look of the other one gets some of them wrong
        photo = people.take(people.dress(number), people.shot(number, 0))
        for name, estimator in estimators.items():
            estimator.start_shot()
            found = lay_iuv(estimator.estimate(photo.rgb), *photo.rgb.shape[:2])
            scores[name].append(score_iuv(found, photo.iuv))
    parts = {name: np.mean([s.part_agreement for s in each]) for name, each in scores.items()}
    away = {name: np.mean([s.uv_error for s in each]) for name, each in scores.items()}
    assert parts["heavy"] > parts["full"]
    assert away["heavy"] < away["full"]


def test_its_landmarks_are_other_ones(estimators) -> None:
    photo = data.astronaut()
    found = []
    for estimator in estimators.values():
        estimator.start_shot()
        (person,) = estimator.estimate(photo)
        found.append(person.landmarks.image)
    away = np.abs(found[0] - found[1])[:11, :2].max()  # the face
    assert 0 < away < 40


def test_it_is_opened_by_its_name(heavy_model: Path) -> None:
    (person,) = open_estimator("blazepose-heavy", None, for_photos=True).estimate(data.astronaut())
    assert person.pixels > 1000


def test_its_answers_have_keys_of_their_own() -> None:
    full, heavy = (estimator_facts(name, None) for name in ("blazepose", "blazepose-heavy"))
    assert set(full["models"]) < set(heavy["models"])
    assert heavy["network"] and heavy["network"] != full["network"]


def test_without_its_model_the_command_is_named(
    models: dict[str, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "models").mkdir()
    for name, path in models.items():
        (tmp_path / "models" / name).symlink_to(path)
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path))
    with pytest.raises(InputError, match=r"pose_landmark_heavy.*`mt models fetch --heavy`"):
        open_estimator("blazepose-heavy", None)
