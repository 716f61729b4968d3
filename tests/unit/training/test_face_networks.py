"""dlib's face network: reading its file, and the same embedding as dlib's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.estimate.models import FACE_NETWORK, find_model
from motion_transfer.training.face_networks import (
    Block,
    DlibFace,
    frame_chips,
    load_dlib_face,
    read_dlib_layers,
)
from motion_transfer.training.faces import CROP_CENTRE, METRES_PER_CROP_PIXEL

DLIB_SAYS = (-0.049436, 0.12807, 0.02723, -0.05299, -0.071662, -0.044626)


def number(value: int) -> bytes:
    content = value.to_bytes(8, "little").rstrip(b"\0") or b"\0"
    return bytes([len(content)]) + content


def layer(name: bytes, values: np.ndarray, *settings: int, version: int = 2) -> bytes:
    """A layer as dlib writes it: its name, settings, and one tensor."""
    head = b"".join(map(number, (*settings, version, len(values), 1, 1, 1)))
    return number(len(name)) + name + head + values.astype("<f4").tobytes()


def written(*layers: bytes) -> bytes:
    """Layers among the settings that dlib writes around them."""
    others = number(2) + number(7) + b"relu_" + number(1)
    return others + others.join(layers) + others


def test_layers_are_read_in_their_order(tmp_path: Path) -> None:
    first, second, last = np.arange(300.0), np.array([0.5, -2.0]), np.linspace(0, 1, 70_000)
    path = tmp_path / "net.dat"
    path.write_bytes(
        written(layer(b"con_4", first), layer(b"affine_", second), layer(b"fc_2", last, 128, 256))
    )
    for found, wanted in zip(read_dlib_layers(path), (first, second, last), strict=True):
        np.testing.assert_array_equal(found, wanted.astype(np.float32))


def test_files_that_are_no_such_network(tmp_path: Path) -> None:
    path = tmp_path / "net.dat"
    good = layer(b"con_4", np.arange(50.0))
    for content in (good[:-1], good[:9], layer(b"con_4", np.arange(5.0), version=1)):
        path.write_bytes(content)
        with pytest.raises(WeightsError, match=r"net\.dat is not a whole network .*models fetch"):
            read_dlib_layers(path)
    for content in (good, b"", b"\x80\x04K\x01."):
        path.write_bytes(content)
        with pytest.raises(WeightsError, match=r"does not hold dlib's face .*models fetch --faces"):
            load_dlib_face(path)
    with pytest.raises(InputError, match="none"):
        load_dlib_face(tmp_path / "none.dat")


def test_a_halving_block_adds_what_only_one_side_has() -> None:
    """dlib's rules: 8 px become 3 by the convolutions and 4 by the mean; 1 channel becomes 2."""
    block = Block(1, 2, halves=True)
    for convolution in (block.conv1, block.conv2):
        nn.init.zeros_(convolution.weight)
        assert convolution.bias is not None
        nn.init.constant_(convolution.bias, 5.0)
    found = block(torch.ones(1, 1, 8, 8))
    wanted = torch.zeros(1, 2, 4, 4)
    wanted[:, :, :3, :3] = 5
    wanted[:, 0] += 1
    torch.testing.assert_close(found, wanted)


def test_chips_frame_the_face_as_dlib_does() -> None:
    """Eyes at row 46.6 and mouth at row 105 of 150, whatever the scale."""
    scale, x = 700.0, 80.0  # px a metre; 0.425 m is at y = 60
    half = np.array([96, 112]) / 2 * METRES_PER_CROP_PIXEL * scale
    y = 60 + (0.425 - CROP_CENTRE) * scale
    box = torch.tensor([[x - half[0], y - half[1], x + half[0], y + half[1]]], dtype=torch.float)
    left, top, right, bottom = frame_chips(box)[0].tolist()
    assert (left + right) / 2 == pytest.approx(x)
    assert right - left == pytest.approx(bottom - top)
    for height, row in ((0.425, 46.6), (0.355, 105)):
        place = 60 + (0.425 - height) * scale
        assert (place - top) / (bottom - top) * 150 == pytest.approx(row, abs=0.01)


def pattern() -> torch.Tensor:
    """A picture that is the same everywhere: three waves, whole levels of 255."""
    y, x = np.mgrid[:150, :150]
    waves = np.stack([np.sin(x / 9), np.cos(y / 13), np.sin((x + y) / 21)]) * 100 + 128
    return torch.from_numpy(waves.round() / 127.5 - 1).float()[None]


@pytest.fixture(scope="module")
def network() -> DlibFace:
    try:
        return load_dlib_face(find_model(FACE_NETWORK))
    except InputError as error:
        pytest.skip(str(error))


def test_the_embedding_is_that_of_dlib(network: DlibFace) -> None:
    """DLIB_SAYS: `face_recognition_model_v1.compute_face_descriptor` of dlib 20.0.1."""
    found = network(pattern())[0]
    assert found.shape == (128,)
    np.testing.assert_allclose(found[:6].numpy(), DLIB_SAYS, atol=2e-6)


def test_gradients_reach_the_picture_and_not_the_weights(network: DlibFace) -> None:
    face = pattern().requires_grad_()
    network(face).square().sum().backward()
    assert face.grad is not None and face.grad.abs().max() > 0
    assert all(not each.requires_grad for each in network.parameters())
    assert not network.train().training
