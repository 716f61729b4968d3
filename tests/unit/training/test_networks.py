"""What a run starts with."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from motion_transfer.training.config import build_config
from motion_transfer.training.trainer import build_state
from nhrr_core import ModelConfig, NeuralReRenderer

SMALL = ModelConfig(
    feature_width=2, render_width=4, residual_blocks=1, texture_size=64, image_size=32
)


@pytest.mark.parametrize("new", [("clearance",), ("prior",), ("clearance", "geometry")])
def test_new_inputs_begin_without_effect(new: tuple[str, ...]) -> None:
    """A run from weights that know of none draws at first what they draw."""
    init = NeuralReRenderer(SMALL).eval()
    settings = {"run.steps": 1, **{f"model.{name}": True for name in new}}
    config = build_config(settings, model=SMALL)
    model = build_state(config, init, torch.device("cpu")).model.eval()
    assert all(getattr(model.config, name) for name in new)
    clearance = torch.rand(1, 2, 128, 128).round()
    texture, visibility = torch.rand(1, 3, 64, 64), torch.ones(1, 1, 64, 64)
    target = torch.randint(1, 25, (1, 3, 32, 32), dtype=torch.uint8)
    drawn = model.render(model.encode_texture(texture, visibility, clearance), target)
    expected = init.render(init.encode_texture(texture, visibility), target)
    assert torch.allclose(drawn, expected, atol=0.01)


def test_networks_are_compiled_for_the_sizes_they_meet(monkeypatch: pytest.MonkeyPatch) -> None:
    """With sizes left open, torch 2.13 cannot compile a RenderNet with its shortcut for a second.

    Compiling one for two sizes takes minutes, so only the request is looked at.
    """
    asked: list[object] = []
    monkeypatch.setattr(nn.Module, "compile", lambda _, **how: asked.append(how))
    settings = {"run.steps": 1, "speed.compile": True}
    build_state(
        build_config({**settings, "losses.r1_weight": 0}, model=SMALL), None, torch.device("cpu")
    )
    assert asked == [{"dynamic": False}] * 3  # FeatureNet, RenderNet, discriminator
    asked.clear()
    # a compiled discriminator has no second derivative, which R1 takes
    build_state(build_config(settings, model=SMALL), None, torch.device("cpu"))
    assert asked == [{"dynamic": False}] * 2
