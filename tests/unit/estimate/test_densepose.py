"""The DensePose estimator on small modules of the interface; no real model was at hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.estimate.densepose import OUTPUTS, DensePoseEstimator

PHOTO = np.full((60, 80, 3), (10, 20, 30), np.uint8)


def people(count: int = 2) -> dict[str, Tensor]:
    """Two people of one part each: part 2 in the left half of a box, part 1 + person right."""
    fine, coarse = torch.zeros(count, 25, 8, 8), torch.zeros(count, 2, 8, 8)
    u, v = torch.zeros(count, 25, 8, 8), torch.zeros(count, 25, 8, 8)
    coarse[:, 1, 2:], coarse[:, 0, :2] = 9, 9
    fine[:, 2, :, :4] = 5
    u[:, 2], v[:, 2] = 0.2, 1.4
    for person in range(count):
        fine[person, 3 + person, :, 4:] = 5
        u[person, 3 + person], v[person, 3 + person] = 0.4, -0.3
    boxes = torch.tensor([[10.0, 4, 26, 36], [40.6, 20, 90, 52]])[:count]
    values = (boxes, torch.tensor([0.85, 0.99])[:count], coarse, fine, u, v)
    return dict(zip(OUTPUTS, values, strict=True))


class SmallModel(nn.Module):
    """Gives what it was made with; checks that the picture is BGR and uint8."""

    def __init__(self, outputs: dict[str, Tensor]) -> None:
        super().__init__()
        self.outputs = outputs

    def forward(self, original_image: Tensor, bgr: bool = True) -> dict[str, Tensor]:
        assert original_image.dtype == torch.uint8
        assert int(original_image[0, 0, 0]) == 30
        return self.outputs


def write(path: Path, outputs: dict[str, Tensor]) -> Path:
    if path.suffix != ".onnx":
        torch.jit.script(SmallModel(outputs)).save(str(path))
        return path
    nodes, constants, results = [], [], []
    for name, value in outputs.items():
        constants.append(numpy_helper.from_array(value.numpy(), f"{name}_value"))
        nodes.append(helper.make_node("Identity", [f"{name}_value"], [name]))
        results.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, value.shape))
    picture = helper.make_tensor_value_info("image", TensorProto.UINT8, ["h", "w", 3])
    graph = helper.make_graph(nodes, "small", [picture], results, constants)
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), str(path))
    return path


kinds = pytest.mark.parametrize("name", ["model.pt", "model.onnx"])


@kinds
@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_people_are_painted_where_their_boxes_lie(tmp_path: Path, name: str) -> None:
    first, second = DensePoseEstimator(write(tmp_path / name, people())).estimate(PHOTO)
    assert (first.confidence, second.confidence) == (pytest.approx(0.99), pytest.approx(0.85))
    assert (first.box.left, first.box.top, first.box.right, first.box.bottom) == (40, 20, 80, 52)
    iuv, alpha = second.on_frame(60, 80)
    assert iuv[20, 12].tolist() == [2, 51, 255]
    assert iuv[20, 24].tolist() == [3, 102, 0]
    assert not iuv[5, 12].any() and alpha[5, 12] == 0  # the coarse segmentation says background
    assert alpha[20, 12] == 255
    assert not iuv[:, :10].any() and not iuv[36:].any()
    assert (first.iuv.shape, first.alpha.shape) == ((32, 40, 3), (32, 40))  # cut by the frame
    assert first.iuv[20, 35].tolist() == [4, 102, 0]


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_people_keep_their_numbers(tmp_path: Path) -> None:
    estimator = DensePoseEstimator(write(tmp_path / "model.pt", people()))
    tracks = [[person.track for person in estimator.estimate(PHOTO)] for _ in range(3)]
    assert tracks == [[0, 1]] * 3
    estimator.start_shot()
    assert [person.track for person in estimator.estimate(PHOTO)] == [0, 1]


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_doubtful_people_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "model.pt", people())
    assert len(DensePoseEstimator(path, lowest_score=0.9).estimate(PHOTO)) == 1
    assert DensePoseEstimator(path, lowest_score=1.0).estimate(PHOTO) == []
    with pytest.raises(InputError, match="between 0 and 1"):
        DensePoseEstimator(path, lowest_score=2)


@kinds
@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"pred_densepose_u": None}, "gives no pred_densepose_u; export a chart-based"),
        ({"pred_densepose_v": torch.zeros(2, 24, 8, 8)}, r"\[2, 24, 8, 8\] for 2 people; N x 25"),
        ({"pred_boxes": torch.zeros(1, 4)}, r"pred_boxes as \[1, 4\] for 2 people"),
    ],
)
def test_another_model_is_named(tmp_path: Path, name: str, change: dict, reason: str) -> None:
    outputs = {k: v for k, v in {**people(), **change}.items() if v is not None}
    estimator = DensePoseEstimator(write(tmp_path / name, outputs))
    with pytest.raises(WeightsError, match=reason):
        estimator.estimate(PHOTO)


@pytest.mark.parametrize(
    ("name", "reason"),
    [("gone.pt", "does not exist"), ("words.pt", "TorchScript"), ("words.onnx", "ONNX file")],
)
@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_what_is_no_model_is_refused(tmp_path: Path, name: str, reason: str) -> None:
    if name.startswith("words"):
        (tmp_path / name).write_text("nothing of the kind")
    with pytest.raises(WeightsError, match=reason):
        DensePoseEstimator(tmp_path / name)
