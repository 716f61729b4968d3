"""Free people in training and in evaluation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.options import EvaluationOptions

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")

from motion_transfer.people.free.assets import load_assets  # noqa: E402
from motion_transfer.training.config import build_config  # noqa: E402
from motion_transfer.training.sources import (  # noqa: E402
    StreamedPairs,
    TrainingData,
    held_out_pairs,
    open_training_data,
)


@pytest.fixture(autouse=True)
def no_variable(monkeypatch) -> None:
    monkeypatch.delenv("MT_ASSETS", raising=False)


def opened(run: Path, **data) -> TrainingData:
    settings = {f"data.{key}": value for key, value in {"size_px": 64, **data}.items()}
    ignore = lambda *_counts: None  # noqa: E731
    return open_training_data(build_config(settings), run, photographed=ignore, checked=ignore)


def test_endless_pairs_have_free_people_among_them(assets, tmp_path):
    data = opened(tmp_path, people=0, assets=str(assets), free_share=0.7)
    assert "70% of them in photographed clothes" in data.description
    assert load_assets(assets).digest in data.digest
    assert data.pairs[0].source.load().rgb.shape == (64, 64, 3)
    without = opened(tmp_path, people=0)
    # a run that began before there were assets goes on
    assert without.digest == repr(StreamedPairs(seed=0, size=(64, 64), noise=0.5))
    assert "assets" not in without.digest


def test_the_environment_names_assets_for_training_too(assets, tmp_path, monkeypatch):
    monkeypatch.setenv("MT_ASSETS", str(assets))
    assert load_assets(assets).digest in opened(tmp_path, people=0).digest


def test_a_share_without_assets_is_refused_by_training(tmp_path):
    with pytest.raises(InputError, match="needs assets; name their folder with --assets DIR"):
        opened(tmp_path, people=0, free_share=0.7)


def test_a_protocol_of_free_people_is_another_one_with_other_assets(assets):
    free, painted = held_out_pairs(2, assets), held_out_pairs(2)
    assert free.name == "free people (held-out)" and free.digest != painted.digest
    assert free.digest == held_out_pairs(2, assets).digest


def test_the_protocol_needs_assets(assets, tmp_path):
    common: dict[str, Any] = {"protocol": "free-people", "renderer": "texture", "output": tmp_path}
    with pytest.raises(InputError, match="protocol free-people needs assets; name their folder"):
        EvaluationOptions(**common)
    with pytest.raises(InputError, match="no such folder"):
        EvaluationOptions(**common, assets=tmp_path / "nowhere")
    assert EvaluationOptions(**common, assets=assets).protocol_assets == assets
    assert EvaluationOptions(**common | {"protocol": "people"}).protocol_assets is None
