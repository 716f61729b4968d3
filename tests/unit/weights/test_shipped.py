"""The checkpoints that ship: small, whole, and with their papers."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import torch

from motion_transfer import weights
from motion_transfer.errors import WeightsError
from motion_transfer.weights import DEFAULT_WEIGHTS, SHIPPED, find_weights
from motion_transfer.weights.checkpoint import inspect_checkpoint, load_checkpoint


@pytest.mark.parametrize("name", SHIPPED)
def test_they_load_and_say_what_they_are(name: str) -> None:
    path = find_weights(Path(name))
    info = inspect_checkpoint(path)
    assert path.stat().st_size < 40e6
    assert info.notes["licence"] == "CC0-1.0"
    assert "synthetic people" in info.notes["data"]
    recipe = tomllib.loads(info.notes["train.toml"])
    assert "/" not in recipe["run"]["init"] + recipe["data"]["people_cache"]
    assert int(info.notes["step"]) > 0
    model = load_checkpoint(path)
    assert all(value.dtype == torch.float32 for value in model.parameters())
    assert all(bool(value.isfinite().all()) for value in model.parameters())


def test_the_default_has_alpha_and_the_recipe_is_in_the_docs() -> None:
    path = find_weights(DEFAULT_WEIGHTS)
    info = inspect_checkpoint(path)
    assert (info.config.variant, info.config.alpha, info.config.image_size) == ("full", True, 256)
    recipes = Path(__file__).parents[3].glob(f"docs/weights/{DEFAULT_WEIGHTS}-*.toml")
    last = max(recipes, key=lambda path: int(path.stem.rpartition("-")[2]))
    assert last.read_text() == info.notes["train.toml"]


def test_a_path_is_a_path(tmp_path: Path) -> None:
    assert find_weights(tmp_path / "mine.safetensors") == tmp_path / "mine.safetensors"
    assert find_weights(tmp_path / "lite") == tmp_path / "lite"


def test_a_package_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weights, "SHIPPED", ("lite", "lost"))
    with pytest.raises(WeightsError, match=r"lost should have come .* --renderer texture"):
        find_weights(Path("lost"))
