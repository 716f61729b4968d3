"""Checkpoints: written whole, read back, and refused for the reason that is there."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from motion_transfer.errors import WeightsError
from motion_transfer.weights.checkpoint import (
    digest_weights,
    inspect_checkpoint,
    load_checkpoint,
    save_checkpoint,
)
from nhrr_core import ModelConfig


def read(path: Path) -> tuple[dict[str, torch.Tensor], dict[str, str]]:
    with safe_open(path, framework="pt") as file:
        return {name: file.get_tensor(name) for name in file.keys()}, dict(file.metadata())  # noqa: SIM118


def test_round_trip(tmp_path: Path, checkpoint: Path) -> None:
    model = load_checkpoint(checkpoint)
    save_checkpoint(tmp_path / "copy.safetensors", model, notes={"data": "synthetic"})
    copy = load_checkpoint(tmp_path / "copy.safetensors")
    assert copy.config == model.config
    assert not copy.training
    for name, tensor in model.state_dict().items():
        torch.testing.assert_close(copy.state_dict()[name], tensor, rtol=0, atol=0)
    assert [item.name for item in tmp_path.iterdir()] == ["copy.safetensors"]


def test_inspection_tells_what_is_inside(checkpoint: Path) -> None:
    info = inspect_checkpoint(checkpoint)
    state = load_checkpoint(checkpoint).state_dict()
    assert info.notes == {"licence": "CC0"}
    assert info.tensor_count == len(state)
    assert info.parameter_count == sum(tensor.numel() for tensor in state.values())
    assert info.config.image_size == 64


def test_half_precision_storage(tmp_path: Path, checkpoint: Path) -> None:
    model = load_checkpoint(checkpoint)
    path = tmp_path / "half.safetensors"
    save_checkpoint(path, model, dtype=torch.float16)
    assert path.stat().st_size < 0.6 * checkpoint.stat().st_size
    for name, tensor in load_checkpoint(path).state_dict().items():
        assert tensor.dtype == model.state_dict()[name].dtype
        torch.testing.assert_close(tensor, model.state_dict()[name].half().to(tensor.dtype))


def test_a_name_as_long_as_can_be_is_written(tmp_path: Path, checkpoint: Path) -> None:
    path = tmp_path / ("n" * 243 + ".safetensors")
    save_checkpoint(path, load_checkpoint(checkpoint))
    assert [item.name for item in tmp_path.iterdir()] == [path.name]


def test_a_failed_write_keeps_the_old_file(tmp_path: Path, checkpoint: Path) -> None:
    path = tmp_path / "model.safetensors"
    path.write_text("old")
    with pytest.raises(TypeError):
        save_checkpoint(path, load_checkpoint(checkpoint), notes={"year": 2020})  # type: ignore[dict-item]
    assert [(item.name, item.read_text()) for item in tmp_path.iterdir()] == [(path.name, "old")]


def spoil(checkpoint: Path, path: Path, kind: str) -> Path:
    """A file at `path` with one thing wrong."""
    state, metadata = read(checkpoint)
    name, tensor = next((n, t) for n, t in state.items() if t.ndim == 4)
    config = json.loads(metadata["config"])
    if kind == "missing":
        return path
    if kind == "folder":
        path.mkdir()
        return path
    if kind in ("empty", "random", "truncated", "no end"):
        data = checkpoint.read_bytes()
        content = {
            "empty": b"",
            "random": bytes(range(256)) * 8,
            "truncated": data[: len(data) // 2],
            "no end": data[:-1],
        }
        path.write_bytes(content[kind])
        return path
    if kind == "pickle":
        torch.save(state, path)
        return path
    if kind == "tensor missing":
        del state[name]
    elif kind == "tensor unknown":
        state["stranger"] = torch.zeros(3)
    elif kind == "tensor of another shape":
        state[name] = tensor[:1].clone()
    elif kind == "another model":
        metadata = {"format": "pt"}
    elif kind == "no metadata":
        metadata = {}
    elif kind == "no configuration":
        del metadata["config"]
    elif kind == "configuration is no JSON":
        metadata["config"] = "{"
    elif kind == "configuration is a list":
        metadata["config"] = "[1]"
    elif kind == "unknown field":
        metadata["config"] = json.dumps({**config, "depth": 3})
    elif kind == "impossible value":
        metadata["config"] = json.dumps({**config, "image_size": 65})
    elif kind == "terabytes":
        metadata["config"] = json.dumps({**config, "render_width": 1024, "down_blocks": 6})
    elif kind == "blocks without end":
        metadata["config"] = json.dumps({**config, "down_blocks": 2**62})
    elif kind == "no number":
        metadata["config"] = json.dumps({**config, "image_size": float("nan")})
    elif kind == "digits":
        metadata["config"] = '{"image_size": ' + "9" * 5000 + "}"
    elif kind == "deep":
        metadata["config"] = "[" * 50000
    elif kind == "twice":
        metadata["config"] = '{"alpha": true, "alpha": false}'
    elif kind == "values that are no numbers":
        state[name] = torch.full_like(tensor, torch.nan)
    elif kind == "negative variances":
        norm = next(name for name in state if name.endswith("running_var"))
        state[norm] = -torch.ones_like(state[norm])
    elif kind == "whole numbers":
        state[name] = torch.zeros_like(tensor, dtype=torch.int32)
    elif kind == "another configuration":
        metadata["config"] = json.dumps({**config, "render_width": 8})
    save_file(state, path, metadata=metadata)
    return path


BROKEN = [
    ("missing", "does not exist"),
    ("folder", "is a folder; name a file in it"),
    ("empty", "not a whole safetensors file"),
    ("random", "not a whole safetensors file"),
    ("truncated", "not a whole safetensors file"),
    ("no end", "not a whole safetensors file"),
    ("pickle", "not a whole safetensors file"),
    ("another model", "not a checkpoint of this model: .*format 'pt'"),
    ("no metadata", "not a checkpoint of this model: .*format None"),
    ("no configuration", "broken configuration"),
    ("configuration is no JSON", "broken configuration"),
    ("configuration is a list", "broken configuration"),
    ("unknown field", "broken configuration: unknown configuration field depth"),
    ("impossible value", "broken configuration: image_size is 65"),
    ("blocks without end", "broken configuration: config:1: '4611686018427387904' is no number"),
    ("no number", "broken configuration: config:1: 'NaN' is no number"),
    ("digits", "broken configuration: config:1: '99999"),
    ("deep", "broken configuration: config:1: lists and mappings lie in each other"),
    ("twice", "broken configuration: config:1: alpha stands here, and in line 1, too"),
]
UNFIT = [
    ("tensor missing", "is missing"),
    ("tensor unknown", "stranger is unknown"),
    ("tensor of another shape", r"is \[1, .*\], not \["),
    ("terabytes", "layers.13.weight is missing"),
    ("values that are no numbers", "holds values that are no finite numbers"),
    ("negative variances", "running_var holds negative variances"),
    ("whole numbers", "holds another kind of numbers"),
    ("another configuration", r"is \[.*\], not \[.*; \.\.\."),
]


@pytest.mark.parametrize(("kind", "reason"), BROKEN + UNFIT)
def test_what_is_no_checkpoint_is_refused(
    tmp_path: Path, checkpoint: Path, kind: str, reason: str
) -> None:
    path = spoil(checkpoint, tmp_path / "broken.safetensors", kind)
    with pytest.raises(WeightsError, match=rf"weights .*broken\.safetensors.*({reason})"):
        load_checkpoint(path)


@pytest.mark.parametrize(("kind", "reason"), BROKEN)
def test_inspection_refuses_them_as_well(
    tmp_path: Path, checkpoint: Path, kind: str, reason: str
) -> None:
    path = spoil(checkpoint, tmp_path / "broken.safetensors", kind)
    with pytest.raises(WeightsError, match=rf"weights .*broken\.safetensors.*({reason})"):
        inspect_checkpoint(path)


def test_a_model_of_any_variant_survives(tmp_path: Path) -> None:
    from nhrr_core import VARIANTS, NeuralReRenderer

    for variant in VARIANTS:
        config = ModelConfig(
            variant=variant, feature_width=2, render_width=2, residual_blocks=1, alpha=True
        )
        save_checkpoint(tmp_path / "a.safetensors", NeuralReRenderer(config))
        assert load_checkpoint(tmp_path / "a.safetensors").config == config


def test_pickles_are_told_what_to_do(tmp_path: Path, checkpoint: Path) -> None:
    path = spoil(checkpoint, tmp_path / "epoch_9.pth", "pickle")
    with pytest.raises(
        WeightsError, match=r"epoch_9\.pth .*; only \.safetensors is read; save its"
    ):
        load_checkpoint(path)


def test_pipes_and_devices_are_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        for read_it in (load_checkpoint, inspect_checkpoint, digest_weights):
            with pytest.raises(WeightsError, match=f"weights {path} is a device or a pipe"):
                read_it(path)
