from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from reference.nhrr_core_loops import sample_features_loops
from torch import Tensor

from nhrr_core import ShapeError, sample_features, smooth_coordinates
from nhrr_core.sampling import _sample_everywhere, signed_distance, spread_colours


@pytest.fixture
def noise() -> Tensor:
    """Two 7 x 6 images of all parts and background, with U and V at random."""
    iuv = torch.randint(0, 256, (2, 3, 7, 6), dtype=torch.uint8)
    iuv[:, 0] = torch.randint(0, 25, (2, 7, 6), dtype=torch.uint8)
    return iuv


def test_shape_and_type(noise: Tensor, charts: Tensor) -> None:
    for dtype in (torch.float32, torch.float64):
        image = sample_features(torch.rand(2, 5, 16, 16, dtype=dtype), noise, charts)
        assert image.shape == (2, 5, 7, 6)
        assert image.dtype == dtype


@pytest.mark.parametrize("maps", [1, 2])
@pytest.mark.parametrize("size", [1, 2, 9, 64])
def test_equals_loops_in_values_and_gradients(
    noise: Tensor, charts: Tensor, maps: int, size: int
) -> None:
    fast_map = torch.rand(maps, 3, size, size, dtype=torch.float64, requires_grad=True)
    slow_map = fast_map.detach().clone().requires_grad_()
    fast = sample_features(fast_map, noise, charts)
    slow = sample_features_loops(slow_map, noise, charts)
    # Places are float32 in the fast version: half a texel of 64 is known to about 1e-6.
    torch.testing.assert_close(fast, slow, rtol=0, atol=1e-5)
    weight = torch.rand_like(fast)
    (fast * weight).sum().backward()
    (slow * weight).sum().backward()
    torch.testing.assert_close(fast_map.grad, slow_map.grad, rtol=0, atol=2e-5)


def test_gradcheck(noise: Tensor, charts: Tensor) -> None:
    feature_map = torch.rand(1, 2, 4, 4, dtype=torch.float64, requires_grad=True)
    small = noise[:, :, :3, :3]
    assert torch.autograd.gradcheck(lambda m: sample_features(m, small, charts), feature_map)


def test_pixel_in_a_texel_centre_is_that_texel(plain_charts: Tensor) -> None:
    feature_map = torch.rand(1, 4, 256, 256)
    iuv = torch.randint(0, 256, (1, 3, 8, 8), dtype=torch.uint8)
    iuv[:, 0] = 9
    u, v = iuv[0, 1].long(), iuv[0, 2].long()
    image = sample_features(feature_map, iuv, plain_charts)
    torch.testing.assert_close(image[0], feature_map[0, :, v, u], rtol=0, atol=1e-4)


def test_u_runs_along_columns_and_v_along_rows(plain_charts: Tensor) -> None:
    columns = torch.arange(256.0).expand(1, 1, 256, 256)
    iuv = torch.tensor([9, 30, 200], dtype=torch.uint8).view(1, 3, 1, 1)
    along_u = sample_features(columns, iuv, plain_charts)
    along_v = sample_features(columns.mT.contiguous(), iuv, plain_charts)
    torch.testing.assert_close(along_u.item(), 30.0, rtol=0, atol=1e-3)
    torch.testing.assert_close(along_v.item(), 200.0, rtol=0, atol=1e-3)


def test_halfway_between_centres_is_the_mean(plain_charts: Tensor) -> None:
    """A 128-texel map has its centres halfway between entries 0 and 1, 2 and 3 and so on."""
    feature_map = torch.zeros(1, 1, 128, 128)
    feature_map[..., 10] = 8.0
    iuv = torch.zeros(1, 3, 1, 4, dtype=torch.uint8)
    iuv[:, 0], iuv[:, 2] = 1, 100
    iuv[0, 1, 0] = torch.tensor([19, 20, 21, 22])
    image = sample_features(feature_map, iuv, plain_charts)
    expected = torch.tensor([2.0, 6.0, 6.0, 2.0])
    torch.testing.assert_close(image[0, 0, 0], expected, rtol=0, atol=1e-4)


def test_constant_beyond_the_outermost_centres() -> None:
    feature_map = torch.tensor([[1.0, 2.0], [3.0, 4.0]])[None, None]
    charts = torch.zeros(24, 256, 256, 2)
    charts[0, 0, 0], charts[0, 0, 1] = torch.tensor([0.0, 0.0]), torch.tensor([1.0, 1.0])
    iuv = torch.tensor([[[1, 1]], [[0, 1]], [[0, 0]]], dtype=torch.uint8)[None]
    assert sample_features(feature_map, iuv, charts).flatten().tolist() == [1.0, 4.0]


@pytest.mark.parametrize("value", [1e38, -1e38, 1.0])
def test_background_is_exactly_zero(noise: Tensor, charts: Tensor, value: float) -> None:
    background = noise[:, :1] == 0
    assert 0 < background.sum() < background.numel()
    image = sample_features(torch.full((1, 2, 8, 8), value), noise, charts)
    assert (image[background.expand_as(image)] == 0).all()
    assert (image[~background.expand_as(image)] != 0).all()


def test_background_passes_no_gradient(noise: Tensor, charts: Tensor) -> None:
    noise[:, 0] = 0
    feature_map = torch.rand(1, 2, 8, 8, requires_grad=True)
    sample_features(feature_map, noise, charts).sum().backward()
    assert feature_map.grad is not None
    assert (feature_map.grad == 0).all()


def test_gradient_counts_the_pixels_of_the_body(noise: Tensor, charts: Tensor) -> None:
    feature_map = torch.rand(1, 1, 32, 32, requires_grad=True)
    sample_features(feature_map, noise, charts).sum().backward()
    assert feature_map.grad is not None
    body = (noise[:, 0] > 0).sum().float()
    torch.testing.assert_close(feature_map.grad.sum(), body)


def test_one_map_serves_the_batch(noise: Tensor, charts: Tensor) -> None:
    feature_map = torch.rand(1, 3, 16, 16)
    shared = sample_features(feature_map, noise, charts)
    assert torch.equal(shared, sample_features(feature_map.repeat(2, 1, 1, 1), noise, charts))


def test_each_image_has_its_own_map(noise: Tensor, charts: Tensor) -> None:
    maps = torch.rand(2, 3, 16, 16)
    both = sample_features(maps, noise, charts)
    for i in range(2):
        alone = sample_features(maps[i : i + 1], noise[i : i + 1], charts)
        torch.testing.assert_close(both[i : i + 1], alone, rtol=0, atol=1e-6)
    assert not torch.equal(both, sample_features(maps.flip(0), noise, charts))


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("maps", "images"), [(3, 2), (2, 1), (0, 2)])
def test_another_number_of_maps_raises(charts: Tensor, maps: int, images: int) -> None:
    iuv = torch.zeros(images, 3, 4, 4, dtype=torch.uint8)
    with pytest.raises(ShapeError) as raised:
        sample_features(torch.rand(maps, 2, 8, 8), iuv, charts)
    message = f"{maps} feature maps for {images} IUV images; give 1 or {images}"
    assert str(raised.value) == message


@pytest.mark.parametrize("size", [(64, 64), (50, 37)])
def test_colours_spread_beyond_what_is_known(size: tuple[int, int]) -> None:
    torch.manual_seed(0)
    colours = torch.rand(2, 3, *size) + 0.5
    known = torch.zeros(2, 1, *size, dtype=torch.bool)
    known[0, :, 10:30, 5:9] = True
    spread = spread_colours(colours * known, known, 4)
    assert torch.equal(spread[0][:, known[0, 0]], colours[0][:, known[0, 0]])
    near = spread[0, :, 5:35, 9:16]
    assert near.min() >= 0.5 - 1e-5
    assert near.max() <= 1.5 + 1e-5
    assert not spread[1].any()  # nothing is known
    assert not spread[0, :, 10:30, 35:].any()  # beyond the reach


def test_one_colour_spreads_as_itself() -> None:
    known = torch.zeros(1, 1, 64, 64, dtype=torch.bool)
    known[..., 20:40, 20:30] = True
    colour = torch.tensor([0.3, -0.7, 1.0])[:, None, None]
    spread = spread_colours(colour * known, known, 5)
    assert torch.allclose(spread[..., :46], colour.expand(1, 3, 64, 46), atol=1e-5)


def test_colours_stay_near_what_they_spread_from() -> None:
    known = torch.zeros(1, 1, 64, 64, dtype=torch.bool)
    known[..., 24:40, 10:20] = True
    known[..., 24:40, 44:54] = True
    colours = torch.zeros(1, 1, 64, 64)
    colours[..., 44:54] = 1
    row = spread_colours(colours * known, known, 4)[0, 0, 32]
    assert row[20] < 0.05
    assert row[43] > 0.95
    assert (row[20:44].diff() >= -1e-5).all()


@pytest.mark.parametrize("reach", [1, 5, 24])
def test_distance_to_the_outline_is_exact(reach: int) -> None:
    inside = F.interpolate((torch.rand(2, 1, 6, 5) > 0.6).float(), size=(54, 38)) > 0
    distance = signed_distance(inside, reach)
    assert distance.dtype == torch.float32
    for own, mask in zip(distance[:, 0], inside[:, 0], strict=True):
        to_inside, to_outside = (_distance_by_pairs(mask == side) for side in (True, False))
        expected = torch.where(mask, 0.5 - to_outside, to_inside - 0.5).clamp(-reach, reach)
        assert torch.allclose(own, expected)


def test_without_an_outline_it_is_out_of_reach() -> None:
    inside = torch.tensor([True, False])[:, None, None, None].expand(2, 1, 8, 40)
    distance = signed_distance(inside, 12)
    assert torch.equal(distance[0], torch.full((1, 8, 40), -12.0))
    assert torch.equal(distance[1], torch.full((1, 8, 40), 12.0))


def _distance_by_pairs(mask: Tensor) -> Tensor:
    """From every pixel to the nearest of the mask, each against each."""
    places = torch.ones_like(mask).nonzero().float()
    return torch.cdist(places, mask.nonzero().float()).amin(1).view(mask.shape)


@pytest.mark.parametrize("maps", [1, 3])
def test_the_look_up_of_devices_is_the_same(maps: int, noise: Tensor, charts: Tensor) -> None:
    """They look the background up as well, so that nobody has to ask them where the body is."""
    iuv = torch.cat([noise, noise.flip(-1), noise.flip(-2)])[:3]
    feature_map = torch.randn(maps, 5, 16, 16, requires_grad=True)
    everywhere = _sample_everywhere(feature_map, iuv, smooth_coordinates(iuv, charts))
    expected = sample_features(feature_map, iuv, charts)
    torch.testing.assert_close(everywhere, expected)
    gradients = [
        torch.autograd.grad((image * torch.arange(5)[:, None, None]).sum(), feature_map)[0]
        for image in (everywhere, expected)
    ]
    torch.testing.assert_close(*gradients)
