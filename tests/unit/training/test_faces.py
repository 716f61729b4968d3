from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
import torch.nn.functional as F
from reference.losses_loops import crop_boxes_loops
from torch import Tensor, nn

from motion_transfer.errors import WeightsError
from motion_transfer.training.faces import (
    CROP_CENTRE,
    METRES_PER_CROP_PIXEL,
    FaceIdentity,
    SphereFace20,
    crop_boxes,
    face_table,
    find_faces,
    load_sphereface,
)
from nhrr_core import UVLayout, load_uv_layout

DEMO = Path(__file__).parents[3] / "motion_transfer" / "demo"


@pytest.fixture(scope="module")
def table() -> Tensor:
    return face_table()


@pytest.fixture(scope="module")
def layout() -> UVLayout:
    return load_uv_layout()


@pytest.fixture(scope="module")
def head(layout: UVLayout) -> Callable[..., Tensor]:
    """IUV of a head of the layout's own shape, seen along z, at `scale` px a metre.

    Every entry of the charts is drawn as 3 x 3 px, so that nothing behind shines through.
    """
    places = (layout.charts[22:] * 256).long().clamp_max(255).numpy()
    position = layout.position.numpy()[places[..., 1], places[..., 0]]
    entries = np.indices(position.shape[:3])  # part - 23, V, U
    entries = np.stack([entries[0] + 23, entries[2], entries[1]], -1).reshape(-1, 3)
    position = position.reshape(-1, 3)
    order = np.argsort(position[:, 2], kind="stable")

    def draw(
        scale: float = 500.0, *, size: int = 160, behind: bool = False, at: tuple[int, int] = (0, 0)
    ) -> Tensor:
        iuv = np.zeros((size + 2, size + 2, 3), np.uint8)
        x, y, _ = position.T
        columns = size / 2 + at[0] + (-x if behind else x) * scale
        rows = size / 2 + at[1] - (y - CROP_CENTRE) * scale
        for index in order[::-1] if behind else order:  # the nearest is drawn last
            row, column = int(rows[index]), int(columns[index])
            if 0 <= row < size and 0 <= column < size:
                iuv[row : row + 3, column : column + 3] = entries[index]
        return torch.from_numpy(iuv[1:-1, 1:-1].copy()).permute(2, 0, 1)[None]

    return draw


def test_face_lies_on_the_front_of_the_head(table: Tensor, layout: UVLayout) -> None:
    assert table.shape == (25, 256, 256)
    assert not table[:23].any()
    for part in (23, 24):
        assert 0.1 < table[part].float().mean() < 0.4
    places = (layout.charts[22:] * 256).long().clamp_max(255)
    x, y, z = layout.position[places[..., 1], places[..., 0]][table[23:]].unbind(-1)
    assert z.min() > 0.03 and y.min() > 0.33 and y.max() < 0.45
    assert (x.min() + x.max()).abs() < 0.005 and 0.13 < x.max() - x.min() < 0.15
    tip = z.argmax()
    assert y[tip] == pytest.approx(0.395, abs=0.01) and abs(x[tip]) < 0.01


def test_box_has_the_crop_s_frame_in_metres(head: Callable[..., Tensor], table: Tensor) -> None:
    """At 1000 px a metre, within 5 mm: what surrounds the head's reference place."""
    boxes, seen = find_faces(head(1000.0, size=320), table)
    assert seen.tolist() == [True]
    width, height = (side * METRES_PER_CROP_PIXEL * 1000 for side in (96, 112))
    wanted = [160 - width / 2, 160 - height / 2, 160 + width / 2, 160 + height / 2]
    torch.testing.assert_close(boxes[0], torch.tensor(wanted), rtol=0, atol=5)
    ratio = (boxes[0, 3] - boxes[0, 1]) / (boxes[0, 2] - boxes[0, 0])
    assert ratio.item() == pytest.approx(112 / 96)


def test_nose_and_eyes_land_where_sphereface_had_them(
    head: Callable[..., Tensor], table: Tensor
) -> None:
    """Its reference landmarks: nose (48.0, 71.7), the eyes' row 51.6; within 4 px of the crop."""
    iuv = head(size=256, scale=900.0, at=(17, -9))
    boxes, _ = find_faces(iuv, table)
    for height, row in ((0.395, 71.7), (0.425, 51.6)):
        marked = torch.zeros(1, 1, 256, 256)
        y = 128 - 9 - (height - CROP_CENTRE) * 900
        marked[0, 0, int(y), 128 + 17] = 1
        crop = crop_boxes(marked, boxes)[0, 0]
        index = int(crop.argmax())
        assert index // 96 + 0.5 == pytest.approx(row, abs=4)
        assert index % 96 + 0.5 == pytest.approx(48.0, abs=4)


def test_box_follows_the_head(head: Callable[..., Tensor], table: Tensor) -> None:
    here, _ = find_faces(head(scale=300.0), table)
    there, _ = find_faces(head(scale=300.0, at=(12, -7)), table)
    torch.testing.assert_close(there - here, torch.tensor([[12.0, -7, 12, -7]]))


def test_head_from_behind_is_no_face(head: Callable[..., Tensor], table: Tensor) -> None:
    iuv = head(behind=True)
    assert (iuv[:, 0] > 0).sum() > 1000
    boxes, seen = find_faces(iuv, table)
    assert seen.tolist() == [False]
    assert boxes.tolist() == [[0, 0, 160, 160]]


def test_each_image_of_a_batch_has_its_own_box(head: Callable[..., Tensor], table: Tensor) -> None:
    small, moved, empty = head(scale=250.0), head(at=(20, 10)), torch.zeros_like(head())
    boxes, seen = find_faces(torch.cat([small, empty, moved]), table)
    assert seen.tolist() == [True, False, True]
    assert torch.equal(boxes[:1], find_faces(small, table)[0])
    assert torch.equal(boxes[2:], find_faces(moved, table)[0])


@pytest.mark.parametrize(("pixels", "expected"), [(63, False), (64, True)])
def test_smallest_face(table: Tensor, pixels: int, expected: bool) -> None:
    v, u = table[23].nonzero()[0].tolist()
    iuv = torch.zeros(1, 3, 16, 16, dtype=torch.uint8)
    iuv[0].view(3, -1)[:, :pixels] = torch.tensor([23, u, v], dtype=torch.uint8)[:, None]
    assert find_faces(iuv, table)[1].tolist() == [expected]


def test_box_of_a_rectangle_of_face(table: Tensor) -> None:
    """Columns 10 to 29, rows 40 to 51: 0.12 m over 12 px is less than 0.146 m over 20 px."""
    v, u = table[24].nonzero()[0].tolist()
    iuv = torch.zeros(1, 3, 64, 64, dtype=torch.uint8)
    iuv[:, :, 40:52, 10:30] = torch.tensor([24, u, v], dtype=torch.uint8).view(1, 3, 1, 1)
    scale = 20 / 0.146
    half_height, half_width = (n / 2 * METRES_PER_CROP_PIXEL * scale for n in (112, 96))
    middle = 46 - (CROP_CENTRE - 0.39) * scale
    wanted = [20 - half_width, middle - half_height, 20 + half_width, middle + half_height]
    torch.testing.assert_close(find_faces(iuv, table)[0], torch.tensor([wanted]))


def test_demo_photo_has_its_face_in_the_box(table: Tensor) -> None:
    """Of the shipped photo: centred on the head, its top near the head's, above the shoulders."""
    iuv = cv2.imread(str(DEMO / "source_IUV.png"))
    assert iuv is not None
    iuv = iuv if iuv[..., 0].max() <= 24 else iuv[..., ::-1].copy()
    boxes, seen = find_faces(torch.from_numpy(iuv).permute(2, 0, 1)[None], table)
    assert seen.all()
    head_rows, head_columns = np.nonzero(iuv[..., 0] >= 23)
    left, top, right, bottom = boxes[0].tolist()
    assert abs((left + right) / 2 - (head_columns.min() + head_columns.max()) / 2) < 6
    assert head_rows.min() - 20 < top < bottom < head_rows.max()


def test_crop_equals_loops_in_values_and_gradients() -> None:
    boxes = torch.tensor([[1.3, 0.6, 6.2, 7.9], [-3.0, 2.5, 12.0, 4.0]], dtype=torch.float64)
    fast = torch.rand(2, 2, 9, 8, dtype=torch.float64, requires_grad=True)
    slow = fast.detach().clone().requires_grad_()
    ours, theirs = crop_boxes(fast, boxes, (5, 6)), crop_boxes_loops(slow, boxes, (5, 6))
    torch.testing.assert_close(ours, theirs)
    weight = torch.rand_like(ours)
    (ours * weight).sum().backward()
    (theirs * weight).sum().backward()
    torch.testing.assert_close(fast.grad, slow.grad)


@pytest.mark.parametrize("size", [(112, 96), (7, 5), (20, 16)])
def test_crop_of_the_whole_image_is_torch_s_resize(size: tuple[int, int]) -> None:
    image = torch.rand(1, 3, 20, 16)
    whole = torch.tensor([[0.0, 0.0, 16.0, 20.0]])
    wanted = F.interpolate(image, size=size, mode="bilinear", align_corners=False, antialias=True)
    torch.testing.assert_close(crop_boxes(image, whole, size), wanted, rtol=0, atol=1e-5)


def test_crop_of_whole_pixels_is_a_slice() -> None:
    image = torch.rand(2, 3, 20, 16)
    boxes = torch.tensor([[2.0, 3.0, 8.0, 10.0], [5.0, 0.0, 11.0, 7.0]])
    crop = crop_boxes(image, boxes, (7, 6))
    torch.testing.assert_close(crop[0], image[0, :, 3:10, 2:8])
    torch.testing.assert_close(crop[1], image[1, :, 0:7, 5:11])


def test_crop_repeats_the_border() -> None:
    image = torch.rand(1, 1, 4, 4)
    crop = crop_boxes(image, torch.tensor([[-4.0, -4.0, -1.0, -1.0]]), (3, 3))
    assert (crop == image[0, 0, 0, 0]).all()


def test_crop_gradcheck() -> None:
    boxes = torch.tensor([[0.4, -1.0, 3.7, 3.2]], dtype=torch.float64)
    image = torch.rand(1, 2, 4, 5, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: crop_boxes(x, boxes, (3, 4)), image)


def test_crop_of_a_half_precision_image_keeps_its_place() -> None:
    """Places of hundreds of pixels do not fit bfloat16's eight bits."""
    image = torch.zeros(1, 1, 8, 512, dtype=torch.bfloat16)
    image[..., 301] = 1
    crop = crop_boxes(image, torch.tensor([[300.0, 0.0, 304.0, 8.0]]), (8, 4))
    assert crop.dtype == torch.bfloat16
    assert crop[0, 0, 0].tolist() == [0, 1, 0, 0]


SHAPES = {  # of the published file, without its classifier
    "conv1_1": (64, 3),
    **dict.fromkeys(("conv1_2", "conv1_3"), (64, 64)),
    "conv2_1": (128, 64),
    **{f"conv2_{i}": (128, 128) for i in range(2, 6)},
    "conv3_1": (256, 128),
    **{f"conv3_{i}": (256, 256) for i in range(2, 10)},
    "conv4_1": (512, 256),
    **dict.fromkeys(("conv4_2", "conv4_3"), (512, 512)),
}


@pytest.fixture(scope="module")
def sphereface_state() -> dict[str, Tensor]:
    """A state dict laid out like the published one, with weights that keep activations alive."""
    generator = torch.Generator().manual_seed(0)
    state = {}
    for name, (outputs, inputs) in SHAPES.items():
        weight = torch.randn(outputs, inputs, 3, 3, generator=generator) * (1 / inputs / 9) ** 0.5
        state[f"{name}.weight"] = weight
        state[f"{name}.bias"] = 0.1 * torch.randn(outputs, generator=generator)
        slope = torch.rand(outputs, generator=generator)
        state[f"{name.replace('conv', 'relu')}.weight"] = slope
    state["fc5.weight"] = torch.randn(512, 512 * 7 * 6, generator=generator) / 150
    state["fc5.bias"] = torch.randn(512, generator=generator)
    state["fc6.weight"] = torch.zeros(512, 4)
    return state


@pytest.fixture(scope="module")
def sphereface_file(
    sphereface_state: dict[str, Tensor], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """In the format of torch before 1.6, as the published file is."""
    path = tmp_path_factory.mktemp("sphereface") / "sphere20a.pth"
    torch.save(sphereface_state, path, _use_new_zipfile_serialization=False)
    return path


def embed_by_hand(image: np.ndarray, state: dict[str, Tensor]) -> Tensor:
    """From H x W x 3 uint8 BGR, as cv2 reads it, the way the network was trained."""
    x = torch.from_numpy((image.astype(np.float32) - 127.5) / 128).permute(2, 0, 1)[None]

    def layer(x: Tensor, name: str, stride: int = 1) -> Tensor:
        weight, bias = state[f"conv{name}.weight"], state[f"conv{name}.bias"]
        x = F.conv2d(x, weight, bias, stride=stride, padding=1)
        return torch.where(x > 0, x, x * state[f"relu{name}.weight"].view(1, -1, 1, 1))

    x = layer(x, "1_1", 2)
    x = x + layer(layer(x, "1_2"), "1_3")
    x = layer(x, "2_1", 2)
    x = x + layer(layer(x, "2_2"), "2_3")
    x = x + layer(layer(x, "2_4"), "2_5")
    x = layer(x, "3_1", 2)
    x = x + layer(layer(x, "3_2"), "3_3")
    x = x + layer(layer(x, "3_4"), "3_5")
    x = x + layer(layer(x, "3_6"), "3_7")
    x = x + layer(layer(x, "3_8"), "3_9")
    x = layer(x, "4_1", 2)
    x = x + layer(layer(x, "4_2"), "4_3")
    return F.linear(x.reshape(1, -1), state["fc5.weight"], state["fc5.bias"])


def test_sphereface_equals_the_layers_by_hand(
    sphereface_file: Path, sphereface_state: dict[str, Tensor]
) -> None:
    bgr = torch.randint(0, 256, (112, 96, 3), dtype=torch.uint8).numpy()
    rgb = torch.from_numpy(bgr[..., ::-1].copy()).permute(2, 0, 1)[None].float() / 127.5 - 1
    ours = load_sphereface(sphereface_file)(rgb)
    wanted = embed_by_hand(bgr, sphereface_state)
    assert ours.shape == (1, 512)
    assert wanted.std() > 0.5
    torch.testing.assert_close(ours, wanted, rtol=1e-3, atol=1e-3)


def test_sphereface_has_twenty_layers() -> None:
    names = {name for name, _ in SphereFace20().named_children()}
    assert names == {*SHAPES, *(n.replace("conv", "relu") for n in SHAPES), "fc5"}
    assert len(SHAPES) == 20


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.pop("relu3_7.weight"), "relu3_7.weight is missing"),
        (lambda s: s.update({"fc7.weight": torch.zeros(1)}), "fc7.weight is unknown"),
        (
            lambda s: s.update({"conv1_1.weight": torch.zeros(64, 1, 3, 3)}),
            r"conv1_1.weight is \[64, 1, 3, 3\], not \[64, 3, 3, 3\]",
        ),
    ],
)
def test_sphereface_file_that_does_not_fit_is_refused(
    sphereface_state: dict[str, Tensor],
    tmp_path: Path,
    change: Callable[[dict[str, Tensor]], object],
    message: str,
) -> None:
    state = dict(sphereface_state)
    change(state)
    path = tmp_path / "sphere20a.pth"
    torch.save(state, path)
    with pytest.raises(WeightsError, match=message):
        load_sphereface(path)


def test_missing_sphereface_file_names_the_options(tmp_path: Path) -> None:
    with pytest.raises(WeightsError) as raised:
        load_sphereface(tmp_path / "none.pth")
    for part in ("none.pth does not exist", "--sphereface FILE", "--no-identity"):
        assert part in str(raised.value)


def test_identity_loss_sees_the_face_and_nothing_else(
    sphereface_file: Path, head: Callable[..., Tensor]
) -> None:
    loss_of = FaceIdentity(load_sphereface(sphereface_file)).train()
    iuv = torch.cat([head(at=(30, 20)), head(behind=True)])
    truth = torch.rand(2, 3, 160, 160) * 2 - 1
    assert loss_of(truth, truth, iuv) == 0
    generated = (truth + 0.1 * torch.randn_like(truth)).requires_grad_()
    loss = loss_of(generated, truth, iuv)
    loss.backward()
    assert loss > 0
    assert generated.grad is not None
    touched = (generated.grad != 0).any(1)
    assert not touched[1].any()
    left, top, right, bottom = find_faces(iuv, loss_of.table)[0][0].tolist()
    rows, columns = touched[0].any(1).nonzero().flatten(), touched[0].any(0).nonzero().flatten()
    assert abs(rows.min().item() - top) < 2 and abs(rows.max().item() + 1 - bottom) < 2
    assert abs(columns.min().item() - left) < 2 and abs(columns.max().item() + 1 - right) < 2


def test_identity_network_stays_frozen(sphereface_file: Path) -> None:
    holder = nn.ModuleList([FaceIdentity(load_sphereface(sphereface_file))]).train()
    assert not any(parameter.requires_grad for parameter in holder.parameters())
    assert "0.table" not in holder.state_dict()
