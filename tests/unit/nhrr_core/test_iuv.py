from __future__ import annotations

import pytest
import torch
from torch import Tensor

from nhrr_core import IuvError, ShapeError, check_iuv, keep_parts, normalise_iuv


@pytest.fixture
def all_parts() -> Tensor:
    """A row of 25 pixels, one of each part, with U = 10 x part and V = 255 - U."""
    part = torch.arange(25, dtype=torch.uint8)
    return torch.stack([part, part * 10, 255 - part * 10])[None, :, None]


def test_check_accepts_all_parts(all_parts: Tensor) -> None:
    check_iuv(all_parts)
    check_iuv(all_parts[:0])
    check_iuv(all_parts[..., :0])


@pytest.mark.parametrize("shape", [(3, 4, 4), (1, 4, 4, 3), (1, 1, 4, 4), (1, 1, 3, 4, 4)])
def test_check_refuses_another_shape(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError) as raised:
        check_iuv(torch.zeros(shape, dtype=torch.uint8))
    assert str(raised.value) == f"an IUV tensor is B x 3 x H x W, not {list(shape)}"


@pytest.mark.parametrize("dtype", [torch.float32, torch.int64, torch.int8])
def test_check_refuses_another_type(dtype: torch.dtype) -> None:
    with pytest.raises(IuvError, match=f"an IUV tensor is uint8, not {dtype}"):
        check_iuv(torch.zeros(1, 3, 2, 2, dtype=dtype))


@pytest.mark.parametrize("part", [25, 255])
def test_check_refuses_part_indices_above_24(all_parts: Tensor, part: int) -> None:
    all_parts[0, 0, 0, 7] = part
    with pytest.raises(IuvError, match=f"part index {part} found; parts are 1 to 24"):
        check_iuv(all_parts)


def test_keep_parts_keeps_those_and_blanks_the_rest(all_parts: Tensor) -> None:
    before = all_parts.clone()
    kept = keep_parts(all_parts, (2, 24))
    assert kept.dtype == torch.uint8
    assert kept[0, :, 0, 2].tolist() == [2, 20, 235]
    assert kept[0, :, 0, 24].tolist() == [24, 240, 15]
    assert kept.count_nonzero() == 6
    assert torch.equal(all_parts, before)


def test_keep_no_parts_is_all_background(all_parts: Tensor) -> None:
    assert keep_parts(all_parts, ()).count_nonzero() == 0


def test_keep_all_parts_changes_nothing_on_the_body(all_parts: Tensor) -> None:
    kept = keep_parts(all_parts, tuple(range(1, 25)))
    assert torch.equal(kept[..., 1:], all_parts[..., 1:])


def test_keep_parts_treats_each_image_alone(all_parts: Tensor) -> None:
    kept = keep_parts(torch.cat([all_parts, all_parts.flip(-1)]), (5,))
    assert kept[0, 0].nonzero().tolist() == [[0, 5]]
    assert kept[1, 0].nonzero().tolist() == [[0, 19]]


def test_normalise_values() -> None:
    iuv = torch.tensor([[0, 0, 0], [24, 255, 255], [12, 51, 204]], dtype=torch.uint8)
    normal = normalise_iuv(iuv.T[None, :, None])
    expected = torch.tensor([[-1, -1, -1], [1, 1, 1], [0, -0.6, 0.6]])
    assert normal.dtype == torch.float32
    torch.testing.assert_close(normal[0, :, 0].T, expected)
