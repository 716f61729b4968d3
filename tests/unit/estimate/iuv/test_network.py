"""What the IUV network sees and says, and how that is painted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from estimate_stubs import iuv_logits

from motion_transfer.drawing.person import Box
from motion_transfer.errors import WeightsError
from motion_transfer.estimate.interface import LANDMARK, Landmarks
from motion_transfer.estimate.iuv import features
from motion_transfer.estimate.iuv.features import (
    BONES,
    GRID,
    MAP_CHANNELS,
    MARGIN,
    VECTOR_LENGTH,
    BodyInput,
    body_input,
    body_window,
    feature_maps,
    feature_vector,
)
from motion_transfer.estimate.iuv.network import (
    PARTS,
    IuvNetwork,
    IuvNetworkConfig,
    load_shipped,
    load_weights,
    save_weights,
    spread_cells,
)
from motion_transfer.estimate.iuv.painting import FINEST, paint_iuv

SMALL = IuvNetworkConfig(widths=(8, 8, 12, 12), code=8)


@pytest.fixture
def body() -> BodyInput:
    torch.manual_seed(0)
    return BodyInput(
        torch.rand(2, 33, 3),
        torch.rand(2, 33, 3) - 0.5,
        torch.rand(2, 33),
        torch.rand(2, 1, 256, 256),
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


def test_the_masks_pixels_come_in_cells(body: BodyInput) -> None:
    cells = feature_maps(body)[:, -16:]
    assert torch.equal(cells, torch.nn.functional.pixel_unshuffle(body.mask, 4))


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
        Box(10, 20, 90, 100),
    )
    assert made.points[0, 0].tolist() == pytest.approx([0.25, 0.5, 0])
    assert made.mask.shape == (1, 1, 256, 256)


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
    inputs = [body.points, body.world, body.visibility, body.mask]
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


def test_painting_at_the_networks_size_is_what_it_says() -> None:
    parts = np.random.default_rng(0).integers(0, PARTS, (128, 128))
    window = Box(5, 7, 133, 135)
    iuv = paint_iuv(iuv_logits(parts, 0.4), window, window)
    assert np.array_equal(iuv[..., 0], parts)
    assert set(np.unique(iuv[parts > 0][:, 1:])) == {102}
    assert (iuv[parts == 0] == 0).all()


@pytest.mark.parametrize("side", [300, FINEST + 500])
def test_painting_larger_keeps_places(side: int) -> None:
    parts = np.zeros((128, 128), int)
    parts[32:96, 40:80] = 2
    window = Box(-20, -30, side - 20, side - 30)
    box = Box(0, 0, side, side + 10)  # beyond the window at right and bottom
    painted = paint_iuv(iuv_logits(parts), window, box)[..., 0] == 2
    rows, columns = np.flatnonzero(painted.any(1)), np.flatnonzero(painted.any(0))
    scale = side / 128
    assert rows[[0, -1]] == pytest.approx([32 * scale - 30, 96 * scale - 30], abs=scale + 2)
    assert columns[[0, -1]] == pytest.approx([40 * scale - 20, 80 * scale - 20], abs=scale + 2)
    assert not painted[side - 30 :].any()


def test_uv_never_crosses_a_border() -> None:
    parts = np.zeros((128, 128), int)
    parts[:, 64:], parts[:, :64] = 1, 2
    logits = iuv_logits(parts)
    logits.uv[:, 0], logits.uv[:, 1] = 0.1, 0.9
    iuv = paint_iuv(logits, Box(0, 0, 500, 500), Box(0, 0, 500, 500))
    assert set(np.unique(iuv[iuv[..., 0] == 1][:, 1:])) == {26}
    assert set(np.unique(iuv[iuv[..., 0] == 2][:, 1:])) == {230}


def test_weights_go_to_a_file_and_back(tmp_path: Path, body: BodyInput) -> None:
    network = IuvNetwork(SMALL).eval()
    save_weights(tmp_path / "w.safetensors", network, {"trained-on": "nothing"})
    with torch.inference_mode():
        back = load_weights(tmp_path / "w.safetensors")(body)
        torch.testing.assert_close(back.parts, network(body).parts, atol=0.02, rtol=0.02)


@pytest.mark.parametrize("content", [None, b"", b"words"])
def test_files_that_are_no_weights(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "w.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(WeightsError, match=r"weights of the IUV network in .*w\.safetensors"):
        load_weights(path)


def test_without_its_weights_it_says_what_else_can_be_done(monkeypatch) -> None:
    monkeypatch.setattr("motion_transfer.estimate.iuv.network.SHIPPED", "lost.safetensors")
    with pytest.raises(WeightsError, match=r"lacks lost.safetensors, .* densepose estimator"):
        load_shipped()
