"""What the IUV network sees and says, and how that is painted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from motion_transfer.drawing.person import Box
from motion_transfer.errors import WeightsError
from motion_transfer.estimate.interface import LANDMARK, Landmarks
from motion_transfer.estimate.iuv import features
from motion_transfer.estimate.iuv.body import (
    BONES,
    COARSE,
    FEATURE_SCALE,
    FINE,
    GRID,
    MAP_CHANNELS,
    MARGIN,
    VECTOR_LENGTH,
    body_window,
)
from motion_transfer.estimate.iuv.features import (
    BodyInput,
    body_input,
    feature_maps,
    feature_vector,
)
from motion_transfer.estimate.iuv.network import (
    IuvNetwork,
    load_weights,
    save_weights,
    spread_cells,
)
from motion_transfer.estimate.iuv.weights import (
    PARTS,
    IuvNetworkConfig,
    find_shipped,
    list_tensors,
    read_weights,
)
from motion_transfer.weights.tensors import list_entries

SMALL = IuvNetworkConfig(widths=(8, 8, 12, 12), code=8)


@pytest.fixture
def body() -> BodyInput:
    torch.manual_seed(0)
    return BodyInput(
        torch.rand(2, 33, 3),
        torch.rand(2, 33, 3) - 0.5,
        torch.rand(2, 33),
        torch.rand(2, 1, 256, 256),
        torch.rand(2, *COARSE),
        torch.rand(2, *FINE),
    )


def landmarks(points: np.ndarray, presence: float = 1.0) -> Landmarks:
    image = np.concatenate([points, np.zeros((33, 1))], 1).astype(np.float32)
    chances = np.full(33, presence, np.float32)
    return Landmarks(image, np.zeros((33, 3), np.float32), chances, chances)


def test_a_bone_is_drawn_where_it_is(body: BodyInput) -> None:
    maps = feature_maps(body)
    assert maps.shape == (2, MAP_CHANNELS, GRID, GRID)
    assert feature_vector(body).shape == (2, VECTOR_LENGTH)
    names = (("left-shoulder",), ("left-elbow",))
    near = maps[0, BONES.index(names)]
    middle = body.points[0, [LANDMARK["left-shoulder"], LANDMARK["left-elbow"]], :2].mean(0)
    column, row = (middle * GRID).long().tolist()
    assert near[row, column] > 0.9 * near.max()
    ends = body.points[0, [LANDMARK["left-shoulder"], LANDMARK["left-elbow"]], :2]
    far = ((torch.stack([ends[0], ends[1]]) - torch.tensor([0.0, 0.0])).norm(dim=1) > 0.5).all()
    if far:
        assert near[0, 0] < 0.2 * near.max()


def test_mask_and_features_come_in_cells(body: BodyInput) -> None:
    mask, coarse, fine = feature_maps(body)[:, -16 - 48 - 32 :].split((16, 48, 32), dim=1)
    assert torch.equal(mask, torch.nn.functional.pixel_unshuffle(body.mask, 4))
    assert torch.equal(coarse, body.coarse.permute(0, 3, 1, 2) * FEATURE_SCALE)
    # channel c of sub-pixel (i, j) is channel (i * 2 + j) * 8 + c of the cell
    assert fine[1, (1 * 2 + 0) * 8 + 5, 7, 9] == body.fine[1, 15, 18, 5] * FEATURE_SCALE


def test_a_window_holds_mask_and_points_with_a_margin() -> None:
    points = np.tile([[50.0, 80.0]], (33, 1))
    points[0] = 40, 20
    window = body_window(landmarks(points), Box(30, 25, 60, 100))
    assert window.width == window.height == pytest.approx(80 / (1 - 2 * MARGIN), abs=1)
    assert window.left + window.right == pytest.approx(90, abs=2)
    assert window.top + window.bottom == pytest.approx(120, abs=2)
    hidden = landmarks(points, presence=0.1)
    assert body_window(hidden, Box(30, 25, 60, 100)).width < window.width
    assert body_window(hidden, None).width >= 2


def test_input_is_in_the_windows_coordinates() -> None:
    made = body_input(
        landmarks(np.tile([[30.0, 60.0]], (33, 1))),
        np.ones((64, 64), np.float32),
        None,
        Box(10, 20, 90, 100),
    )
    assert made.points[0, 0].tolist() == pytest.approx([0.25, 0.5, 0])
    assert made.mask.shape == (1, 1, 256, 256)
    assert made.coarse.shape == (1, *COARSE)
    assert not made.fine.any()


def test_spreading_is_pixel_shuffle_in_another_order() -> None:
    cells = torch.arange(2 * 8 * 3 * 5.0).view(2, 8, 3, 5)
    spread = spread_cells(cells)
    assert spread.shape == (2, 2, 6, 10)
    # channel c of sub-pixel (i, j) is channel (i * 2 + j) * 2 + c of the cell
    assert spread[1, 1, 2 * 2 + 1, 2 * 4] == cells[1, (1 * 2 + 0) * 2 + 1, 2, 4]


def test_fusing_changes_nothing(body: BodyInput) -> None:
    network = IuvNetwork(SMALL)
    for _ in range(3):  # statistics that are not the initial ones
        network(body)
    network.eval()
    with torch.inference_mode():
        before = network(body)
        after = network.fused().fused()(body)
    assert before.parts.shape == (2, PARTS, 128, 128)
    assert before.uv.shape == (2, PARTS - 1, 2, 128, 128)
    torch.testing.assert_close(after.parts, before.parts, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(after.uv, before.uv, atol=1e-4, rtol=1e-4)


def test_every_input_counts(body: BodyInput) -> None:
    inputs = list(body)
    for value in inputs:
        value.requires_grad_(True)
    network = IuvNetwork(SMALL)
    for block in network.modules():  # FiLM starts at nothing
        if hasattr(block, "film"):
            torch.nn.init.normal_(block.film.weight, std=0.1)
    network(body).parts.square().sum().backward()
    assert all(value.grad is not None and value.grad.abs().sum() > 0 for value in inputs)


def test_training_goes_on_after_estimating(body: BodyInput) -> None:
    for kept in (features._grid, features._membership):
        kept.cache_clear()
    with torch.inference_mode():
        feature_maps(body)
    body.points.requires_grad_(True)
    feature_maps(body).square().sum().backward()
    assert body.points.grad is not None and body.points.grad.abs().sum() > 0


def test_weights_go_to_a_file_and_back(tmp_path: Path, body: BodyInput) -> None:
    network = IuvNetwork(SMALL).eval()
    save_weights(tmp_path / "w.safetensors", network, {"trained-on": "nothing"})
    with torch.inference_mode():
        back = load_weights(tmp_path / "w.safetensors").eval()(body)
        torch.testing.assert_close(back.parts, network(body).parts, atol=0.02, rtol=0.02)


@pytest.mark.parametrize("widths", [(8,), (8, 9), (32, 56, 96, 144)])
def test_the_list_of_tensors_is_the_networks(widths: tuple[int, ...]) -> None:
    config = IuvNetworkConfig(widths=widths, code=7)
    assert list_tensors(config) == list_entries(IuvNetwork(config).state_dict())


@pytest.mark.parametrize("content", [None, b"", b"words"])
def test_files_that_are_no_weights(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "w.safetensors"
    if content is not None:
        path.write_bytes(content)
    for read in (load_weights, read_weights):
        with pytest.raises(WeightsError, match=r"weights of the IUV network in .*w\.safetensors"):
            read(path)


def test_without_its_weights_it_says_what_else_can_be_done(monkeypatch) -> None:
    monkeypatch.setattr("motion_transfer.estimate.iuv.weights.SHIPPED", "lost.safetensors")
    with pytest.raises(WeightsError, match=r"lacks lost.safetensors, .* densepose estimator"):
        find_shipped()
