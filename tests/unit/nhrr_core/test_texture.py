from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from reference.nhrr_core_loops import extract_texture_loops
from torch import Tensor

from nhrr_core import (
    IuvError,
    ShapeError,
    extract_texture,
    fill_texture,
    keep_parts,
    load_uv_layout,
    measure_surroundings,
    merge_textures,
    mirror_texture,
    sample_features,
    shrink_texture,
    smooth_coordinates,
)


def pixels(rows: list[list[tuple[int, int, int]]]) -> Tensor:
    """IUV of one image from rows of (part, U, V)."""
    return torch.tensor(rows, dtype=torch.uint8).permute(2, 0, 1)[None]


def apart(*members: tuple[int, int, int]) -> Tensor:
    """IUV of one row in which no two pixels of the body touch."""
    return pixels([[pixel for member in members for pixel in (member, (0, 0, 0))]])


def between_centres(charts: Tensor, part: int, low: int, high: int, size: int) -> Tensor:
    """T x T, the texels in which places lie whose U and V are both in [low, high].

    The chart is read densely, between its entries as well as at them.
    """
    line = torch.linspace(low, high, 1000)
    uv = torch.stack(torch.meshgrid(line, line, indexing="xy"), dim=-1)
    chart = charts[part - 1].permute(2, 0, 1)[None]
    mask = torch.zeros(size, size, dtype=torch.bool)
    for mode in ("bilinear", "nearest"):
        place = F.grid_sample(chart, uv[None] / 255 * 2 - 1, mode=mode, align_corners=True)[0]
        column, row = (place * size).long().clamp(max=size - 1)
        mask[row, column] = True
    return mask


def strictly_inside(mask: Tensor) -> Tensor:
    """Texels all of whose neighbours are in the mask too."""
    return F.max_pool2d((~mask).float()[None], 3, stride=1, padding=1)[0] == 0


# Shapes, types, errors


@pytest.mark.parametrize("channels", [1, 3, 5])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_shape_and_type(charts: Tensor, ramp, channels: int, dtype: torch.dtype) -> None:
    iuv = ramp(2, 9, 7, border=2).repeat(2, 1, 1, 1)
    image = torch.rand(2, channels, 13, 11, dtype=dtype)
    texture, visibility = extract_texture(image, iuv, charts, 40)
    assert texture.shape == (2, channels, 40, 40)
    assert visibility.shape == (2, 1, 40, 40)
    assert texture.dtype == visibility.dtype == dtype


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 5), (5, 1), (2, 2)])
def test_tiny_photos(charts: Tensor, ramp, height: int, width: int) -> None:
    image = torch.rand(1, 3, height, width)
    texture, visibility = extract_texture(image, ramp(2, height, width), charts, 32)
    assert visibility.sum() > 0
    assert texture.isfinite().all()


def test_empty_photo_is_unseen(charts: Tensor) -> None:
    iuv = torch.zeros(2, 3, 6, 6, dtype=torch.uint8)
    texture, visibility = extract_texture(torch.rand(2, 3, 6, 6), iuv, charts, 16)
    assert texture.count_nonzero() == visibility.count_nonzero() == 0


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("photo", "iuv"), [((1, 3, 4, 4), (2, 3, 4, 4)), ((1, 3, 8, 8), (1, 3, 4, 8))]
)
def test_photo_and_iuv_that_differ_raise(
    charts: Tensor, photo: tuple[int, ...], iuv: tuple[int, ...]
) -> None:
    with pytest.raises(ShapeError) as raised:
        extract_texture(torch.rand(photo), torch.zeros(iuv, dtype=torch.uint8), charts, 16)
    assert str(raised.value) == f"photo {list(photo)} and IUV {list(iuv)} do not match"


@pytest.mark.parametrize("size", [0, -1])
def test_size_below_one_raises(charts: Tensor, ramp, size: int) -> None:
    with pytest.raises(ShapeError, match=f"texture size is {size}; it must be at least 1"):
        extract_texture(torch.rand(1, 3, 4, 4), ramp(2, 4), charts, size)


def test_part_above_24_raises(charts: Tensor, ramp) -> None:
    with pytest.raises(IuvError, match="part index 25 found"):
        extract_texture(torch.rand(1, 3, 4, 4), ramp(25, 4), charts, 16)


@pytest.mark.usefixtures("unchecked")
def test_iuv_that_is_no_iuv_raises(charts: Tensor, ramp) -> None:
    image = torch.rand(1, 3, 4, 4)
    with pytest.raises(IuvError, match="uint8"):
        extract_texture(image, ramp(2, 4).float(), charts, 16)
    with pytest.raises(ShapeError, match="B x 3 x H x W"):
        extract_texture(image, ramp(2, 4)[0], charts, 16)


# Pixels


def test_pixel_lands_in_row_v_and_column_u(plain_charts: Tensor) -> None:
    iuv = apart((3, 10, 200), (4, 255, 0))
    image = torch.arange(1.0, 5).view(1, 1, 1, 4)
    texture, visibility = extract_texture(image, iuv, plain_charts, 256)
    assert visibility.nonzero().tolist() == [[0, 0, 0, 255], [0, 0, 200, 10]]
    assert texture[0, 0, 200, 10] == 1.0
    assert texture[0, 0, 0, 255] == 3.0
    assert texture.count_nonzero() == 2


def test_texel_is_the_mean_of_its_pixels(plain_charts: Tensor) -> None:
    """In an 8 x 8 texture, texel (1, 2) holds U 64..95 and V 32..63, of whatever part."""
    iuv = apart((3, 64, 32), (3, 95, 63), (7, 70, 40), (7, 96, 40))
    image = torch.tensor([1.0, 9, 2, 9, 6, 9, 5, 9]).view(1, 1, 1, 8)
    texture, visibility = extract_texture(image, iuv, plain_charts, 8)
    assert texture[0, 0, 1, 2] == 3.0
    assert texture[0, 0, 1, 3] == 5.0
    assert visibility.sum() == 2


def test_pixels_count_more_than_the_filling_between_them(plain_charts: Tensor) -> None:
    """A texel that a pixel lands in takes nothing from the points between pixels."""
    iuv = pixels([[(1, 0, 0), (1, 6, 0)], [(1, 0, 6), (1, 6, 6)]])
    image = torch.tensor([[1.0, 0.0], [0.0, 0.0]])[None, None]
    texture, _ = extract_texture(image, iuv, plain_charts, 256)
    corners = texture[0, 0, [0, 0, 6, 6], [0, 6, 0, 6]]
    assert corners.tolist() == [1.0, 0.0, 0.0, 0.0]
    assert 0 < texture[0, 0, 0, 1] < 1


def test_background_colours_do_not_leak(charts: Tensor, ramp) -> None:
    iuv = ramp(2, 10, border=3)
    image = torch.where(iuv[:, :1] > 0, 0.25, 1e6)
    texture, visibility = extract_texture(image, iuv, charts, 128)
    assert torch.equal(texture, 0.25 * visibility)


def test_values_pass_unchanged(charts: Tensor, ramp) -> None:
    """Bytes stay bytes and [-1, 1] stays that: the mean is linear in the image."""
    iuv = ramp(2, 12)
    image = torch.rand(1, 3, 12, 12)
    texture, visibility = extract_texture(image, iuv, charts, 64)
    scaled, _ = extract_texture(image * 255 - 7, iuv, charts, 64)
    torch.testing.assert_close(scaled, (texture * 255 - 7) * visibility, rtol=0, atol=1e-3)


def test_images_of_a_batch_do_not_mix(charts: Tensor, ramp) -> None:
    iuv = torch.cat([ramp(2, 8), ramp(23, 8), torch.zeros_like(ramp(2, 8))])
    image = torch.rand(3, 3, 8, 8)
    together = extract_texture(image, iuv, charts, 64)
    for i in range(3):
        alone = extract_texture(image[i : i + 1], iuv[i : i + 1], charts, 64)
        for one, all_ in zip(alone, together, strict=True):
            torch.testing.assert_close(all_[i : i + 1], one, rtol=0, atol=1e-6)


# Filling between pixels


def test_a_quad_is_filled_to_its_edges_and_not_beyond(plain_charts: Tensor) -> None:
    iuv = pixels([[(1, 50, 80), (1, 62, 80)], [(1, 50, 90), (1, 62, 90)]])
    _, visibility = extract_texture(torch.rand(1, 3, 2, 2), iuv, plain_charts, 256)
    expected = torch.zeros(256, 256)
    expected[80:91, 50:63] = 1
    assert torch.equal(visibility[0, 0], expected)


def test_filling_is_bilinear(plain_charts: Tensor) -> None:
    """Within a third of a texel's step: a texel is the mean of the points that fall in it."""
    iuv = pixels([[(1, 50, 80), (1, 62, 80)], [(1, 50, 92), (1, 62, 92)]])
    image = torch.tensor([[0.0, 12.0], [24.0, 36.0]])[None, None]
    texture, _ = extract_texture(image, iuv, plain_charts, 256)
    y, x = torch.meshgrid(torch.arange(13.0), torch.arange(13.0), indexing="ij")
    filled = texture[0, 0, 80:93, 50:63]
    torch.testing.assert_close(filled, 2 * y + x, rtol=0, atol=1.0)
    torch.testing.assert_close(filled[6, 6].item(), 18.0, rtol=0, atol=0.5)


@pytest.mark.parametrize(("step", "joined"), [(38, True), (39, False)])
@pytest.mark.parametrize("axis", ["u", "v"])
def test_big_jumps_in_u_or_v_are_not_joined(
    plain_charts: Tensor, step: int, joined: bool, axis: str
) -> None:
    """0.15 of the chart is 38.25 entries; here they are less than 1/16 of the texture."""
    u, v = (100 + step, 108) if axis == "u" else (108, 100 + step)
    iuv = pixels([[(1, 100, 100), (1, u, 100)], [(1, 100, v), (1, u, v)]])
    _, visibility = extract_texture(torch.rand(1, 3, 2, 2), iuv, plain_charts / 4, 256)
    assert (visibility.sum() > 4).item() is joined


@pytest.mark.parametrize(("step", "joined"), [(16, True), (17, False)])
def test_pixels_far_apart_in_the_texture_are_not_joined(
    plain_charts: Tensor, step: int, joined: bool
) -> None:
    iuv = pixels([[(1, 9, 9), (1, 9 + step, 9)], [(1, 9, 12), (1, 9 + step, 12)]])
    _, visibility = extract_texture(torch.rand(1, 3, 2, 2), iuv, plain_charts, 256)
    assert (visibility.sum() > 4).item() is joined


@pytest.mark.parametrize("other", [0, 2, 24])
def test_quads_of_several_parts_are_not_joined(plain_charts: Tensor, other: int) -> None:
    iuv = pixels([[(1, 9, 9), (1, 19, 9)], [(1, 9, 19), (other, 19, 19)]])
    _, visibility = extract_texture(torch.rand(1, 3, 2, 2), iuv, plain_charts, 256)
    assert visibility.sum() == 3 + (other > 0)


def test_quads_of_background_are_not_joined(plain_charts: Tensor) -> None:
    iuv = pixels([[(0, 9, 9), (0, 19, 9)], [(0, 9, 19), (0, 19, 19)]])
    _, visibility = extract_texture(torch.rand(1, 3, 2, 2), iuv, plain_charts, 256)
    assert visibility.sum() == 0


def test_two_pixels_in_line_are_not_a_quad(plain_charts: Tensor) -> None:
    iuv = pixels([[(1, 9, 9), (1, 19, 9)]])
    _, visibility = extract_texture(torch.rand(1, 3, 1, 2), iuv, plain_charts, 256)
    assert visibility.sum() == 2


@pytest.mark.parametrize("pixels_wide", [12, 17, 25, 34, 40])
@pytest.mark.parametrize("part", [2, 9, 13, 23, 24])
def test_coarse_photo_leaves_no_sieve(charts: Tensor, ramp, part: int, pixels_wide: int) -> None:
    """The parts are those whose charts are one smooth piece of the texture."""
    iuv = ramp(part, pixels_wide)
    image = torch.rand(1, 1, pixels_wide, pixels_wide)
    seen = extract_texture(image, iuv, charts, 256)[1][0, 0] > 0
    region = between_centres(charts, part, 60, 190, 256)
    missing, beyond = (strictly_inside(region) & ~seen).sum(), (seen & ~region).sum()
    assert missing.item() == 0
    assert beyond.item() == 0


@pytest.mark.parametrize("part", [2, 9, 23])
def test_coarse_photo_leaves_no_sieve_in_a_large_texture(charts: Tensor, ramp, part: int) -> None:
    """8-bit charts are coarser than a 512 x 512 texture; places lie between their entries too."""
    seen = extract_texture(torch.rand(1, 1, 40, 40), ramp(part, 40), charts, 512)[1][0, 0] > 0
    region = between_centres(charts, part, 60, 190, 512)
    missing, beyond = (strictly_inside(region) & ~seen).sum(), (seen & ~region).sum()
    assert missing.item() == 0
    assert beyond.item() == 0


def test_nothing_is_filled_where_pixels_are_dense(charts: Tensor, ramp) -> None:
    """At one pixel for each chart entry, a coarse texture holds pixel means only."""
    iuv = ramp(2, 131)
    image = torch.rand(1, 1, 131, 131)
    texture, _ = extract_texture(image, iuv, charts, 64)
    column, row = (smooth_coordinates(iuv, charts)[0] * 64).long().unbind(-1)
    for r, c in [(int(row[65, 65]), int(column[65, 65])), (int(row[9, 9]), int(column[9, 9]))]:
        mean = image[0, 0][(row == r) & (column == c)].mean()
        torch.testing.assert_close(texture[0, 0, r, c], mean)


# Against the loops


@pytest.mark.parametrize("size", [16, 60, 256])
def test_equals_loops_in_values_and_gradients(charts: Tensor, ramp, size: int) -> None:
    iuv = torch.cat([ramp(2, 5, 6, low=100, high=160), ramp(23, 5, 6, low=80, high=120)])
    iuv[0, :, 0, 0] = 0
    iuv[0, 0, 4, 3:] = 1
    iuv[1, 1, 2, 2] = 250
    fast_image = torch.rand(2, 3, 5, 6, dtype=torch.float64, requires_grad=True)
    slow_image = fast_image.detach().clone().requires_grad_()
    fast, fast_seen = extract_texture(fast_image, iuv, charts, size)
    slow, slow_seen = extract_texture_loops(slow_image, iuv, charts, size)
    assert torch.equal(fast_seen, slow_seen)
    assert fast_seen.sum() > (58 if size == 256 else 8)
    torch.testing.assert_close(fast, slow, rtol=0, atol=1e-12)
    weight = torch.rand_like(fast)
    (fast * weight).sum().backward()
    (slow * weight).sum().backward()
    torch.testing.assert_close(fast_image.grad, slow_image.grad, rtol=0, atol=1e-10)


def test_equals_loops_on_noise(charts: Tensor) -> None:
    """Parts in patches, U and V as noisy ramps: some quads join, others do not."""
    part = torch.randint(0, 25, (2, 2, 2), dtype=torch.uint8)
    part = part.repeat_interleave(6, 1).repeat_interleave(6, 2)
    uv = torch.randint(60, 80, (2, 2, 12, 12), dtype=torch.uint8)
    line = torch.arange(0, 120, 10, dtype=torch.uint8)
    uv += torch.stack(torch.meshgrid(line, line, indexing="xy"))
    iuv = torch.cat([part[:, None], uv], dim=1)
    image = torch.rand(2, 2, 12, 12)
    fast, fast_seen = extract_texture(image, iuv, charts, 256)
    slow, slow_seen = extract_texture_loops(image, iuv, charts, 256)
    assert fast_seen.sum() > 2 * (part > 0).sum()
    assert torch.equal(fast_seen, slow_seen)
    torch.testing.assert_close(fast, slow, rtol=0, atol=1e-5)


def test_gradcheck(plain_charts: Tensor) -> None:
    iuv = pixels([[(1, 16 * x, 16 * y) for x in range(3)] for y in range(3)])
    iuv[0, 0, 2, 2] = 0
    image = torch.rand(1, 2, 3, 3, dtype=torch.float64, requires_grad=True)
    _, visibility = extract_texture(image, iuv, plain_charts, 32)
    assert visibility.sum() > 8
    assert torch.autograd.gradcheck(lambda x: extract_texture(x, iuv, plain_charts, 32)[0], image)


def test_each_seen_texel_hands_out_a_gradient_of_one(charts: Tensor, ramp) -> None:
    image = torch.rand(1, 1, 16, 16, requires_grad=True)
    texture, visibility = extract_texture(image, ramp(2, 12, border=2), charts, 128)
    texture.sum().backward()
    assert image.grad is not None
    torch.testing.assert_close(image.grad.sum(), visibility.sum())
    assert (image.grad[..., :2] == 0).all()


# There and back


@pytest.mark.parametrize("size", [32, 256])
@pytest.mark.parametrize("part", [1, 2, 3, 15, 23])
def test_constant_comes_back_exactly(charts: Tensor, ramp, part: int, size: int) -> None:
    """Where a neighbouring texel is unseen, sampling mixes 0 into colour and visibility alike."""
    iuv = ramp(part, 14, border=1)
    texture, visibility = extract_texture(torch.full((1, 3, 16, 16), 0.5), iuv, charts, size)
    colour = sample_features(texture, iuv, charts)
    share = sample_features(visibility, iuv, charts)
    assert torch.equal(colour, 0.5 * share.expand_as(colour))
    # A pixel lies within half a texel of its own texel's centre, on both axes.
    assert (share[iuv[:, :1] > 0] > 0.24).all()
    assert (share[iuv[:, :1] == 0] == 0).all()


def test_constant_comes_back_unmixed_inside(charts: Tensor, ramp) -> None:
    iuv = ramp(23, 20)
    texture, _ = extract_texture(torch.full((1, 3, 20, 20), 0.5), iuv, charts, 256)
    inside = sample_features(texture, iuv, charts)[..., 2:-2, 2:-2]
    torch.testing.assert_close(inside, torch.full_like(inside, 0.5), rtol=0, atol=1e-6)


@pytest.mark.parametrize("part", [2, 23])
def test_smooth_image_comes_back(charts: Tensor, ramp, part: int) -> None:
    """A ramp from 0 to 1 over 40 pixels comes back to within a pixel's step, 1/39."""
    iuv = ramp(part, 40)
    line = torch.linspace(0, 1, 40)
    image = torch.stack(torch.meshgrid(line, line, indexing="ij"))[None]
    texture, visibility = extract_texture(image, iuv, charts, 256)
    back = sample_features(texture, iuv, charts) / sample_features(visibility, iuv, charts)
    assert (back - image).abs().max() < 1 / 39
    assert (back - image).abs().mean() < 0.25 / 39


def test_fewer_parts_show_fewer_texels(charts: Tensor, ramp) -> None:
    iuv = torch.cat([ramp(2, 10), ramp(23, 10)], dim=3)
    image = torch.rand(1, 3, 10, 20)
    _, both = extract_texture(image, iuv, charts, 128)
    _, torso = extract_texture(image, keep_parts(iuv, (2,)), charts, 128)
    _, head = extract_texture(image, keep_parts(iuv, (23,)), charts, 128)
    assert torso.sum() > 0 and head.sum() > 0
    assert torch.equal(both, torso + head)


# Merging


def layer(colour: float, *columns: int) -> tuple[Tensor, Tensor]:
    """A 4 x 4 texture of one colour, seen in some columns."""
    visibility = torch.zeros(1, 1, 4, 4)
    visibility[..., list(columns)] = 1
    return colour * visibility.expand(1, 3, 4, 4), visibility


def test_a_coarser_texture_is_the_mean_of_what_is_seen() -> None:
    visibility = (torch.rand(2, 1, 8, 8) > 0.6).float()
    visibility[:, :, :2, :2] = 0
    texture = torch.rand(2, 3, 8, 8) * visibility
    coarse, seen = shrink_texture(texture, visibility, 2)
    assert coarse.shape == (2, 3, 4, 4)
    for image, row, column in product(range(2), range(4), range(4)):
        place = np.s_[:, 2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
        there = visibility[image][place].flatten() > 0
        assert seen[image, 0, row, column] == float(there.any())
        colours = texture[image][place].flatten(1)[:, there]
        expected = colours.mean(1) if there.any() else torch.zeros(3)
        assert torch.allclose(coarse[image, :, row, column], expected)
    assert shrink_texture(texture, visibility, 1)[0] is texture


def test_one_layer_stays_as_it_is() -> None:
    texture, visibility = merge_textures([layer(0.5, 1, 2)])
    assert (texture == torch.tensor([0, 0.5, 0.5, 0])).all()
    assert (visibility == torch.tensor([0, 1, 1, 0])).all()


def test_later_layers_win() -> None:
    texture, visibility = merge_textures([layer(0.5, 0, 1), layer(0.25, 1, 2), layer(1.0, 2)])
    assert (texture == torch.tensor([0.5, 0.25, 1.0, 0])).all()
    assert (visibility == torch.tensor([1, 1, 1, 0])).all()


def test_merging_leaves_the_layers_alone() -> None:
    layers = [layer(0.5, 0, 1), layer(0.25, 1, 2)]
    before = [[part.clone() for part in one] for one in layers]
    merge_textures(layers)
    for one, kept in zip(layers, before, strict=True):
        assert all(torch.equal(a, b) for a, b in zip(one, kept, strict=True))


def test_split_by_part_and_merged_is_the_whole(charts: Tensor, ramp) -> None:
    iuv = torch.cat([ramp(2, 10), ramp(23, 10)], dim=3)
    image = torch.rand(1, 3, 10, 20)
    whole = extract_texture(image, iuv, charts, 128)
    layers = [
        extract_texture(image, keep_parts(iuv, parts), charts, 128) for parts in ((2,), (23,))
    ]
    for merged, expected in zip(merge_textures(layers), whole, strict=True):
        torch.testing.assert_close(merged, expected, rtol=0, atol=1e-6)


def test_coarse_photo_leaves_no_sieve_at_any_texture_size(charts: Tensor, ramp) -> None:
    """What counts as too far apart is a share of the texture, not a number of texels."""
    visibility = extract_texture(torch.rand(1, 1, 12, 12), ramp(2, 12), charts, 1024)[1][0, 0]
    region = between_centres(charts, 2, 60, 190, 1024)
    assert (strictly_inside(region) & (visibility == 0)).sum() < 0.01 * region.sum()


def test_half_precision_photo_lands_on_the_same_texels(charts: Tensor, ramp) -> None:
    image = torch.rand(1, 3, 25, 25)
    seen = [
        extract_texture(image.to(t), ramp(2, 25), charts, 256)[1] for t in (torch.half, torch.float)
    ]
    assert torch.equal(seen[0].float(), seen[1])


@pytest.mark.parametrize(("gap", "filled"), [(0.02, True), (0.04, False)])
def test_nothing_is_filled_across_a_texture_seam(
    plain_charts: Tensor, gap: float, filled: bool
) -> None:
    """Two halves of a chart that lie apart in the texture: the gutter between them stays empty."""
    charts = plain_charts * torch.tensor([0.5, 1.0])
    charts[:, :, 100:, 0] += gap
    iuv = pixels([[(1, 98, 90), (1, 101, 90)], [(1, 98, 93), (1, 101, 93)]])
    visibility = extract_texture(torch.rand(1, 1, 2, 2), iuv, charts, 256)[1][0, 0]
    left, right = int(charts[0, 91, 99, 0] * 256), int(charts[0, 91, 100, 0] * 256)
    assert right - left > 3
    assert bool((visibility[91, left + 1 : right] > 0).all()) is filled


# Mirroring


def mirrored_by_loops(colours: list, shown: list[bool], *tables: list[int]) -> tuple[list, list]:
    """Texel by texel: whoever shows nothing asks its twin, one table after the other."""
    for table in tables:
        before = list(colours), list(shown)
        for texel, twin in enumerate(table):
            if not before[1][texel] and before[1][twin]:
                colours[texel], shown[texel] = before[0][twin], True
    return colours, shown


def mirror(texture: Tensor, visibility: Tensor) -> tuple[Tensor, Tensor]:
    layout = load_uv_layout()
    return mirror_texture(texture, visibility, layout.side_twin, layout.depth_twin)


def test_mirroring_equals_loops() -> None:
    generator = torch.Generator().manual_seed(0)
    visibility = (torch.rand(1, 1, 256, 256, generator=generator) > 0.9).float()
    texture = torch.rand(1, 1, 256, 256, generator=generator) * visibility
    layout = load_uv_layout()
    side, depth = (twin.flatten().tolist() for twin in (layout.side_twin, layout.depth_twin))
    colours, shown = mirrored_by_loops(
        texture.flatten().tolist(), (visibility > 0).flatten().tolist(), side, depth, side
    )
    found, known = mirror(texture, visibility)
    assert torch.equal(found.flatten(), torch.tensor(colours))
    assert torch.equal(known.flatten() > 0, torch.tensor(shown))
    assert 0.25 < known.mean() < 0.5


@pytest.mark.parametrize("size", [128, 256, 512])
def test_one_side_shows_the_other(size: int) -> None:
    """A texture of places on the body, of which only the person's left is seen."""
    layout = load_uv_layout()
    place = F.interpolate(layout.position.permute(2, 0, 1)[None], (size, size), mode="nearest")
    left = (place[:, :1] > 0).float()
    found, known = mirror(place * left, left)
    hidden = (left == 0)[0, 0]
    assert known[0, 0][hidden].mean() > 0.95
    mirrored = place * torch.tensor([-1.0, 1.0, 1.0]).view(3, 1, 1)
    distance = (found - mirrored)[0, :, hidden].norm(dim=0)
    assert distance.median() < 0.02, "metres"


def test_what_is_seen_stays_and_images_do_not_mix() -> None:
    visibility = (torch.rand(2, 1, 64, 64) > 0.5).float()
    texture = torch.rand(2, 3, 64, 64) * visibility
    found, known = mirror(texture, visibility)
    assert torch.equal(found * visibility, texture)
    assert torch.equal(known * visibility, visibility)
    for image in (0, 1):
        alone = mirror(texture[image : image + 1], visibility[image : image + 1])
        assert torch.equal(found[image : image + 1], alone[0])
    nothing = torch.zeros_like(visibility)
    assert not mirror(torch.zeros_like(texture), nothing)[1].any()


# Filling


def fill(texture: Tensor, shown: Tensor) -> Tensor:
    position = load_uv_layout().position
    return fill_texture(texture, shown, position, measure_surroundings(position))


def test_filling_equals_loops() -> None:
    """Some places, each a mean of all that are known, by distance on the body."""
    generator = torch.Generator().manual_seed(0)
    shown = (torch.rand(1, 1, 32, 32, generator=generator) > 0.8).float()
    texture = torch.rand(1, 1, 32, 32, generator=generator) * shown
    position = load_uv_layout().position
    given, wanted, texel = position[4::8, 4::8], position[2::8, 2::8], position[::8, ::8]
    known = [
        (row, column)
        for row, column in shown[0, 0].nonzero().tolist()
        if (given[row, column] - texel[row, column]).norm() < 0.12
    ]
    assert len(known) < shown.sum(), "some lie at the border of a chart"
    found = fill(texture, shown)
    for row, column in (shown[0, 0] == 0).nonzero()[::100].tolist():
        total = weights = 0.0
        for other in known:
            squared = sum(float(d) ** 2 for d in wanted[row, column] - given[other])
            weight = (0.02**2 / (squared + 0.02**2)) ** 3
            total, weights = total + weight * float(texture[0, 0][other]), weights + weight
        assert float(found[0, 0, row, column]) == pytest.approx(total / weights, abs=1e-3)


@pytest.mark.parametrize("size", [128, 256])
def test_filled_places_look_like_their_surroundings(size: int) -> None:
    """A texture of places on the body, of which one texel in ten is seen."""
    layout = load_uv_layout()
    place = F.interpolate(layout.position.permute(2, 0, 1)[None], (size, size), mode="nearest")
    generator = torch.Generator().manual_seed(0)
    shown = (torch.rand(1, 1, size, size, generator=generator) > 0.9).float()
    found = fill(place * shown, shown)
    distance = (found - place).norm(dim=1)[shown[:, 0] == 0]
    assert distance.median() < 0.05, "metres"
    assert torch.equal(found * shown, place * shown)


def test_a_limb_of_which_nothing_is_seen_takes_its_neighbour_s_colour() -> None:
    layout = load_uv_layout()
    upper, lower = (
        torch.isin(layout.part, torch.tensor(parts)).float()[None, None]
        for parts in ((7, 8, 9, 10), (11, 12, 13, 14))
    )
    head = torch.isin(layout.part, torch.tensor((23, 24))).float()[None, None]
    found = fill(upper * 0.5 - head, upper + head)
    share = ((found[lower > 0] - 0.5).abs() < 0.05).float().mean()
    assert share > 0.95, "the rest are places that span the border of a chart"


def test_nothing_shown_stays_nothing() -> None:
    nothing = torch.zeros(2, 3, 64, 64)
    assert not fill(nothing, nothing[:, :1]).any()
