from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from nhrr_core import (
    PART_NAMES,
    UVLayout,
    load_uv_layout,
    smooth_coordinates,
    texture_coordinates,
)
from nhrr_core.uv_layout import chart_index

SIDE_PAIRS = [(1, 1), (2, 2), (3, 4), (6, 5), (7, 8), (9, 10), (11, 12), (13, 14)]
SIDE_PAIRS += [(16, 15), (18, 17), (20, 19), (22, 21), (23, 24)]
DEPTH_PAIRS = [(2, 1), (9, 7), (10, 8), (13, 11), (14, 12), (15, 17), (16, 18)]


@pytest.fixture
def layout() -> UVLayout:
    return load_uv_layout()


@pytest.fixture
def covered(layout: UVLayout) -> Tensor:
    """The texels of a 256 x 256 texture, flattened, in which some chart entry lies."""
    column, row = (layout.charts * 256).long().clamp(max=255).flatten(0, 2).unbind(-1)
    inside = torch.zeros(256 * 256, dtype=torch.bool)
    inside[row * 256 + column] = True
    return inside


def test_shapes_and_types(layout: UVLayout) -> None:
    shapes = {
        "charts": (24, 256, 256, 2),
        "side_twin": (256, 256),
        "depth_twin": (256, 256),
        "position": (256, 256, 3),
        "part": (256, 256),
    }
    for name, shape in shapes.items():
        table = getattr(layout, name)
        assert tuple(table.shape) == shape
        assert table.dtype == (torch.float32 if name in ("charts", "position") else torch.int64)
        assert table.is_contiguous()


def test_ranges(layout: UVLayout) -> None:
    assert layout.charts.min() >= 0 and layout.charts.max() <= 1
    assert layout.part.unique().tolist() == list(range(1, 25))
    for twin in (layout.side_twin, layout.depth_twin):
        assert twin.min() >= 0 and twin.max() < 256 * 256


def test_is_read_once() -> None:
    assert load_uv_layout() is load_uv_layout()


def test_chart_index_counts_part_then_v_then_u(layout: UVLayout) -> None:
    part, u, v = torch.tensor([1, 24, 3]), torch.tensor([0, 255, 7]), torch.tensor([0, 255, 200])
    index = chart_index(part, u, v)
    assert index.tolist() == [0, 24 * 256 * 256 - 1, (2 * 256 + 200) * 256 + 7]
    assert torch.equal(layout.charts.view(-1, 2)[index], layout.charts[part - 1, v, u])


def test_background_falls_on_the_first_chart() -> None:
    zero, nine = torch.tensor([0]), torch.tensor([9])
    assert chart_index(zero, nine, zero).item() == 9


def test_texture_coordinates_look_up_part_v_u(layout: UVLayout) -> None:
    iuv = torch.randint(0, 256, (2, 3, 5, 4), dtype=torch.uint8)
    iuv[:, 0] = iuv[:, 0] % 24 + 1
    place = texture_coordinates(iuv, layout.charts)
    assert place.shape == (2, 5, 4, 2)
    for b, y, x in [(0, 0, 0), (1, 4, 3), (0, 2, 1)]:
        part, u, v = iuv[b, :, y, x].tolist()
        assert torch.equal(place[b, y, x], layout.charts[part - 1, v, u])


def slope(height: int, width: int, *, repeated: int = 1) -> tuple[Tensor, Tensor]:
    """IUV of a trunk whose V falls by 0.4 levels a row, and V as it is before it is rounded.

    Args:
        repeated: How many rows and columns come from one of a smaller picture.
    """
    down = (torch.arange(height) // repeated * repeated)[:, None].expand(height, width)
    right = torch.arange(width).expand(height, width)
    exact = 100 + 0.4 * torch.arange(height)[:, None].expand(height, width)
    v, u = 100 + 0.4 * down, 120 + 0.3 * right
    levels = [torch.full((height, width), 2), u.round(), v.round()]
    return torch.stack(levels)[None].to(torch.uint8), exact + 0.2 * (1 - repeated)


@pytest.mark.parametrize(("repeated", "within"), [(1, 0.1), (2, 0.25)])
def test_places_lie_between_the_levels_of_v(
    plain_charts: Tensor, repeated: int, within: float
) -> None:
    iuv, exact = slope(40, 40, repeated=repeated)
    inner = np.s_[0, 3:-3, 3:-3]
    coarse, fine = (
        place(iuv, plain_charts)[inner][..., 1] * 256 - 0.5
        for place in (texture_coordinates, smooth_coordinates)
    )
    wanted = exact[3:-3, 3:-3]
    off_coarse, off_fine = ((one - wanted).abs().max().item() for one in (coarse, fine))
    assert off_coarse > 0.39
    assert off_fine < within


def test_places_at_a_parts_border_and_the_images_are_as_the_charts_say(layout: UVLayout) -> None:
    iuv, _ = slope(12, 12)
    iuv[0, 0, :, 6:] = 1
    raw, fine = (
        place(iuv, layout.charts)[0] for place in (texture_coordinates, smooth_coordinates)
    )
    moved = (raw != fine).any(-1)
    for line in (moved[0], moved[-1], moved[:, 0], moved[:, 5], moved[:, 6], moved[:, -1]):
        assert not line.any()
    assert moved[3:-3, 3].any() and moved[3:-3, 8].any()


def test_places_beside_a_tear_are_as_the_charts_say(plain_charts: Tensor) -> None:
    iuv, _ = slope(12, 12)
    iuv[0, 1, :, 6:] += 20  # 0.08 of the texture
    ways = texture_coordinates, smooth_coordinates
    raw, fine = (way(iuv, plain_charts)[0] for way in ways)
    assert torch.equal(raw[:, 5:7], fine[:, 5:7])
    assert not torch.equal(raw, fine)


@pytest.mark.parametrize(
    ("parts", "left", "right", "top", "bottom"),
    [
        ((23,), 0.0, 0.31, 0.0, 0.44),  # the face and the back of the head
        ((24,), 0.29, 0.60, 0.0, 0.44),
        ((1, 2), 0.0, 0.63, 0.42, 1.0),
        ((3, 4), 0.62, 1.0, 0.86, 1.0),
        ((5, 6), 0.62, 1.0, 0.74, 0.88),
        ((9, 11, 13), 0.59, 0.75, 0.0, 0.42),
        ((10, 12, 14), 0.82, 1.0, 0.0, 0.40),
        ((15, 17), 0.77, 1.0, 0.40, 0.59),
        ((16, 18), 0.62, 0.85, 0.57, 0.75),
        ((19, 21), 0.82, 1.0, 0.54, 0.75),
        ((20, 22), 0.62, 0.81, 0.41, 0.60),
    ],
)
def test_part_lies_in_its_region(
    layout: UVLayout, parts: tuple[int, ...], left: float, right: float, top: float, bottom: float
) -> None:
    """Bounds read off the SMPL/SURREAL texture: head top left, torso below, limbs to the right."""
    for part in parts:
        x, y = layout.charts[part - 1].unbind(-1)
        assert left <= x.min() and x.max() <= right
        assert top <= y.min() and y.max() <= bottom


@pytest.mark.parametrize("part", range(1, 25))
def test_chart_ends_in_texels_of_its_part(layout: UVLayout, part: int) -> None:
    column, row = (layout.charts[part - 1] * 256).long().unbind(-1)
    assert (layout.part[row, column] == part).float().mean() > 0.8


@pytest.mark.parametrize("part", [9, 10, 13, 14, 23, 24])
def test_chart_is_smooth(layout: UVLayout, part: int) -> None:
    """Neighbours lie within two texels, but for a few where no surface covers the chart."""
    for dim in (0, 1):
        step = layout.charts[part - 1].diff(dim=dim).abs().amax(-1) * 256
        assert (step > 2).sum() < 50


def test_position_is_a_person_in_t_pose(layout: UVLayout) -> None:
    mean = {part: layout.position[layout.part == part].mean(0) for part in range(1, 25)}
    x, y, z = 0, 1, 2
    height = layout.position[..., y].max() - layout.position[..., y].min()
    assert 1.5 < height < 1.9
    assert mean[3][x] < -0.6 and mean[4][x] > 0.6  # hands far out, the right one at negative x
    assert mean[6][x] < -0.05 and mean[5][x] > 0.05
    assert mean[23][x] < 0 < mean[24][x]
    assert mean[2][z] > mean[1][z] + 0.1  # z points forward
    assert mean[5][y] < mean[14][y] < mean[10][y] < mean[2][y] < mean[24][y]
    assert abs(float(mean[3][y] - mean[2][y])) < 0.4


@pytest.mark.parametrize(("right", "left"), SIDE_PAIRS)
def test_side_twin_changes_right_and_left_parts(
    layout: UVLayout, covered: Tensor, right: int, left: int
) -> None:
    """Nine texels in ten; the charts' edges are not quite symmetrical."""
    part = layout.part.flatten()
    twin = part[layout.side_twin.flatten()]
    for here, there in ((right, left), (left, right)):
        assert (twin[(part == here) & covered] == there).float().mean() > 0.9


def test_side_twin_crosses_the_body(layout: UVLayout, covered: Tensor) -> None:
    part = layout.part.flatten()
    twin = part[layout.side_twin.flatten()]
    other = torch.zeros(25, dtype=torch.long)
    for right, left in SIDE_PAIRS:
        other[right], other[left] = left, right
    assert (twin == other[part])[covered].float().mean() > 0.95
    is_right = torch.tensor(["right" in name for name in PART_NAMES])
    is_left = torch.tensor(["left" in name for name in PART_NAMES])
    assert is_left[twin][is_right[part] & covered].float().mean() > 0.95
    assert is_right[twin][is_left[part] & covered].float().mean() > 0.95


def test_side_twin_is_the_mirrored_place(layout: UVLayout) -> None:
    position = layout.position.view(-1, 3)
    mirrored = position[layout.side_twin.flatten()] * torch.tensor([-1.0, 1.0, 1.0])
    assert (mirrored - position).norm(dim=1).max() < 0.01  # metres


@pytest.mark.parametrize(("front", "back"), DEPTH_PAIRS)
def test_depth_twin_changes_front_and_back(layout: UVLayout, front: int, back: int) -> None:
    """Two texels in three; a front chart reaches around to its own back."""
    twin = layout.part.flatten()[layout.depth_twin]
    for here, there in ((front, back), (back, front)):
        share = (twin[layout.part == here] == there).float().mean()
        assert share > 0.6


def test_back_of_the_torso_shows_its_front(layout: UVLayout) -> None:
    twin = layout.part.flatten()[layout.depth_twin]
    assert (twin[layout.part == 1] == 2).float().mean() > 0.95


def test_depth_twin_is_the_identity_on_the_head(layout: UVLayout, covered: Tensor) -> None:
    """On padding texels, which repeat the nearest one inside, it is that one."""
    head = layout.part.flatten() >= 23
    twin = layout.depth_twin.flatten()
    assert (twin == torch.arange(256 * 256))[head & covered].float().mean() > 0.98
    position = layout.position.view(-1, 3)
    assert torch.equal(position[twin][head], position[head])
    assert torch.equal(twin[twin][head], twin[head])


def test_depth_twin_stays_on_its_limb(layout: UVLayout) -> None:
    twin = layout.part.flatten()[layout.depth_twin]
    limbs = [*DEPTH_PAIRS, (19, 21), (20, 22), (3,), (4,), (5,), (6,), (23,), (24,)]
    assert len({part for limb in limbs for part in limb}) == 24
    for limb in limbs:
        members = torch.tensor(limb)
        assert torch.isin(twin[torch.isin(layout.part, members)], members).all()


def test_depth_twin_moves_mostly_in_depth(layout: UVLayout) -> None:
    position = layout.position.view(-1, 3)
    limb = layout.part.flatten() < 23
    step = (position[layout.depth_twin.flatten()] - position)[limb].abs()
    across, up, deep = step.quantile(0.95, dim=0).tolist()
    assert max(across, up) < 0.02 and deep > 0.1  # metres
