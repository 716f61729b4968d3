"""What a run starts with."""

from __future__ import annotations

import torch

from motion_transfer.training.config_file import build_config
from motion_transfer.training.networks import build_state
from nhrr_core import ModelConfig, NeuralReRenderer

SMALL = ModelConfig(
    feature_width=2, render_width=4, residual_blocks=1, texture_size=64, image_size=32
)


def test_clearance_begins_without_effect() -> None:
    """A run from weights that know of none draws at first what they draw."""
    init = NeuralReRenderer(SMALL).eval()
    config = build_config({"run.steps": 1, "model.clearance": True}, model=SMALL)
    model = build_state(config, init, torch.device("cpu")).model.eval()
    assert model.config.clearance
    clearance = torch.rand(1, 2, 128, 128).round()
    texture, visibility = torch.rand(1, 3, 64, 64), torch.ones(1, 1, 64, 64)
    target = torch.randint(1, 25, (1, 3, 32, 32), dtype=torch.uint8)
    drawn = model.render(model.encode_texture(texture, visibility, clearance), target)
    expected = init.render(init.encode_texture(texture, visibility), target)
    assert torch.allclose(drawn, expected, atol=0.01)
