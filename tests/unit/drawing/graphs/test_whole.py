from __future__ import annotations

from typing import Any

import numpy as np
import onnx
import onnxruntime
import openvino
import pytest
import torch

from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.lookup import FeatureRows
from motion_transfer.drawing.engines.outline import signed_distance
from motion_transfer.drawing.graphs.whole import build_encoder, build_painter, build_sampler
from motion_transfer.drawing.unfolding import pixels_per_texel
from nhrr_core import ModelConfig, NeuralReRenderer
from nhrr_core.config import UNIT_PIXELS, UNIT_TEXELS

SMALL = {
    "feature_width": 2,
    "render_width": 4,
    "residual_blocks": 2,
    "texture_size": 32,
    "image_size": 32,
}
EVERYTHING = {
    "alpha": True,
    "prefilled": True,
    "colour_shortcut": True,
    "colour_margin": True,
    "clearance": True,
    "geometry": True,
    "even": True,
}
CONFIGURATIONS: list[dict[str, Any]] = [
    {},
    {"visibility_input": False, "down_blocks": 2},
    {"variant": "no-int", "alpha": True},
    {"variant": "ip", "colour_shortcut": True, "prefilled": True},
    {"variant": "warp"},
    {"variant": "warp-cond", "alpha": True},
    {"colour_shortcut": True, "colour_margin": True},
    {"geometry": True},
    {"clearance": True},
    EVERYTHING,
    {**EVERYTHING, "prior": True, "bilinear": True},
    {**EVERYTHING, "variant": "warp-cond"},
    {**EVERYTHING, "image_size": 40, "texture_size": 48},
    {**EVERYTHING, "texture_size": 160},  # so fine that some of its detail is drawn
]
NARROW = (np.arange(48)[:, None] // 8 == 4).astype(np.uint8)
each = pytest.mark.parametrize("changes", CONFIGURATIONS, ids=lambda c: "-".join(map(str, c)))


def make(changes: dict[str, Any]) -> NeuralReRenderer:
    torch.manual_seed(0)
    model = NeuralReRenderer(ModelConfig.from_dict(SMALL | changes)).eval()
    for name, tensor in model.state_dict().items():
        if "running_var" in name:
            tensor.uniform_(0.5, 2)
        elif "running_mean" in name or "prior" in name or "bias" in name:
            tensor.normal_(0, 0.3)
    return model


def weights_of(model: NeuralReRenderer) -> dict[str, np.ndarray]:
    return {name: tensor.numpy() for name, tensor in model.state_dict().items()}


def run(model: onnx.ModelProto, inputs: dict[str, np.ndarray]) -> list[np.ndarray]:
    onnx.checker.check_model(model, full_check=True)
    names = {given.name for given in model.graph.input}
    inputs = {name: value for name, value in inputs.items() if name in names}
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    outputs = session.run(None, inputs)
    core = openvino.Core()
    exact = {"INFERENCE_PRECISION_HINT": "f32"}
    compiled = core.compile_model(core.read_model(model.SerializeToString()), "CPU", exact)
    read = {port.get_any_name() for port in compiled.inputs}  # one that nothing reads is dropped
    inputs = {name: value for name, value in inputs.items() if name in read}
    for one, other in zip(compiled(inputs).values(), outputs, strict=True):
        level = 1 if other.dtype == np.uint8 else 1e-3  # what lies half-way may be rounded up
        np.testing.assert_allclose(one.astype(float), other.astype(float), rtol=0, atol=level)
    return outputs


def seen_texture(config: ModelConfig) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    side = config.finest_texture
    visibility = (rng.random((1, 1, side, side)) < 0.3).astype(np.float32)
    measured = (rng.random((1, 1, 128, 128)) < 0.1).astype(np.float32)
    lengths = rng.normal(size=(1, 1, 128, 128)).astype(np.float32)
    colours = rng.uniform(-1, 1, (1, 3, side, side)).astype(np.float32)
    return {
        "texture": colours * visibility,
        "visibility": visibility,
        "clearance": np.concatenate([lengths * measured, measured], axis=1),
    }


def target(height: int, width: int) -> np.ndarray:
    """Blocks of body parts on a background, 1 x H x W x 3."""
    rng = np.random.default_rng(1)
    iuv = rng.integers(0, 256, (1, height, width, 3), np.uint8)
    iuv[..., 0] = rng.integers(1, 25, (1, height, width))
    iuv[:, : height // 4] = iuv[:, :, : width // 3] = iuv[:, -3:] = 0
    return iuv


def noise(config: ModelConfig) -> dict[str, torch.Tensor]:
    """A feature map, and detail where the model has a use for it."""
    side, finest = config.texture_size, config.finest_texture
    known = {"feature_map": torch.randn(1, config.map_channels, side, side)}
    if config.has_detail:
        known["detail"] = torch.randn(1, 3, finest, finest) / 2
    return known


def arrays(tensors: dict[str, torch.Tensor]) -> dict[str, np.ndarray]:
    return {name: tensor.numpy() for name, tensor in tensors.items()}


@each
def test_the_encoder_is_torchs(changes: dict[str, Any]) -> None:
    model = make(changes)
    inputs = seen_texture(model.config)
    found = run(build_encoder(model.config, weights_of(model)), inputs)
    texture, visibility, clearance = map(torch.from_numpy, inputs.values())
    with torch.no_grad():
        expected = [model.encode_texture(texture, visibility, clearance)]
        detail = model.detail(texture, visibility)
    assert (detail is not None) == model.config.has_detail
    expected += [] if detail is None else [detail]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other.numpy(), rtol=0, atol=1e-4)


@each
def test_the_sampler_is_torchs(changes: dict[str, Any]) -> None:
    model, iuv = make(changes), target(40, 56)
    known = noise(model.config)
    (features,) = run(build_sampler(model.config), arrays(known) | {"iuv": iuv})
    with torch.no_grad():
        target_iuv = torch.from_numpy(iuv).permute(0, 3, 1, 2)
        expected = model.feature_image(**known, target_iuv=target_iuv)
    np.testing.assert_allclose(features, expected.numpy(), rtol=0, atol=1e-4)


@each
@pytest.mark.parametrize("iuv", [target(40, 56), target(64, 32), target(48, 48) * NARROW], ids=len)
def test_the_painter_is_torchs(changes: dict[str, Any], iuv: np.ndarray) -> None:
    model = make(changes)
    known = noise(model.config)
    inputs = arrays(known) | {"iuv": iuv}
    (frame,) = run(build_painter(model.config, weights_of(model)), inputs)
    with torch.no_grad():
        drawn = model.render(**known, target_iuv=torch.from_numpy(iuv).permute(0, 3, 1, 2))
    expected = ((drawn + 1) * 127.5).permute(0, 2, 3, 1).numpy()
    assert np.abs(frame - expected).max() < 0.51


@each
def test_the_painter_may_be_given_what_is_looked_up(changes: dict[str, Any]) -> None:
    model, iuv = make(changes), target(40, 56)
    config = model.config
    known = arrays(noise(config))
    rows = FeatureRows(FeatureMap(known["feature_map"], known.get("detail")))
    scale = pixels_per_texel(iuv[0])
    inputs = {
        **known,
        "iuv": iuv,
        "sampled": rows.look_up(iuv[0], scale),
        "distance": signed_distance(iuv[0])[None, None],
        "unit": np.full((1, 1, 1, 1), scale * UNIT_TEXELS / UNIT_PIXELS, np.float32),
    }
    weights = weights_of(model)
    (given,) = run(build_painter(config, weights, looked_up=True), inputs)
    (alone,) = run(build_painter(config, weights), inputs)
    assert np.abs(given.astype(int) - alone).max() <= 1
