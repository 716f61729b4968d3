from __future__ import annotations

import itertools
from typing import Any

import pytest
import torch

from nhrr_core import VARIANTS, ModelConfig, NeuralReRenderer
from nhrr_core.tensors import list_tensors

SWITCHES = [
    dict.fromkeys(("alpha", "geometry", "prior"), on[0])
    | dict.fromkeys(("prefilled", "clearance"), on[1])
    | {"visibility_input": on[2]}
    for on in itertools.product((False, True), repeat=3)
]


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("switches", SWITCHES, ids=str)
def test_they_are_those_of_the_model(variant: str, switches: dict[str, Any]) -> None:
    sizes = {"feature_width": 3, "render_width": 5, "down_blocks": 2, "texture_size": 32}
    config = ModelConfig.from_dict({"variant": variant, "residual_blocks": 2, **sizes, **switches})
    with torch.device("meta"):
        model = NeuralReRenderer(config)
    expected = {name: tuple(tensor.shape) for name, tensor in model.state_dict().items()}
    assert list_tensors(config) == expected
