"""Texture and sampler on any IUV image that Hypothesis can think of."""

from __future__ import annotations

import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from reference.nhrr_core_loops import extract_texture_loops, sample_features_loops
from torch import Tensor

from motion_transfer.drawing import unfolding
from nhrr_core import extract_texture, keep_parts, load_uv_layout, merge_textures, sample_features

CHARTS = load_uv_layout().charts
SIZES = st.sampled_from([1, 16, 33, 64])
SEEDS = st.integers(0, 2**16)

quick = settings(max_examples=60, deadline=None, derandomize=True)
thorough = settings(max_examples=150, deadline=None, derandomize=True)


@st.composite
def iuv_images(draw: st.DrawFn, *, batch: int | None = None) -> Tensor:
    """Small IUV batches: noise, or smooth patches of one or two parts whose pixels join."""
    count = batch or draw(st.integers(1, 3))
    height, width = draw(st.integers(1, 5)), draw(st.integers(1, 5))
    if draw(st.booleans()):
        length = count * 3 * height * width
        raw = bytearray(draw(st.binary(min_size=length, max_size=length)))
        iuv = torch.frombuffer(raw, dtype=torch.uint8).view(count, 3, height, width).clone()
        iuv[:, 0] %= 25
        return iuv
    iuv = torch.zeros(count, 3, height, width, dtype=torch.uint8)
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    for image in iuv:
        part, other = draw(st.integers(1, 24)), draw(st.just(0) | st.integers(0, 24))
        image[0] = torch.where(x < draw(st.integers(1, 6)), part, other)
        for channel in (1, 2):
            start, across, down = (draw(st.integers(*r)) for r in ((0, 255), (-20, 20), (-20, 20)))
            image[channel] = (start + across * x + down * y).clamp(0, 255)
    return iuv


def photo_of(iuv: Tensor, seed: int, channels: int = 2) -> Tensor:
    """Colours from 0.25 to 1, so that 0 in the texture means unseen."""
    generator = torch.Generator().manual_seed(seed)
    shape = (iuv.shape[0], channels, *iuv.shape[2:])
    return torch.rand(shape, generator=generator) * 0.75 + 0.25


def map_of(size: int, seed: int, maps: int = 1) -> Tensor:
    return torch.rand(maps, 2, size, size, generator=torch.Generator().manual_seed(seed)) - 0.5


@quick
@given(iuv_images(), SIZES, st.sampled_from([0.5, -2.0, 1.0]))
def test_visible_constant_comes_back(iuv: Tensor, size: int, colour: float) -> None:
    """In units of the visibility, which sampling mixes with unseen texels in the same way."""
    image = torch.full((iuv.shape[0], 3, *iuv.shape[2:]), colour)
    texture, visibility = extract_texture(image, iuv, CHARTS, size)
    back = sample_features(texture, iuv, CHARTS)
    share = sample_features(visibility, iuv, CHARTS)
    assert torch.equal(back, colour * share.expand_as(back))
    assert torch.equal(share[:, 0] > 0.24, iuv[:, 0] > 0)


@quick
@given(iuv_images(), SIZES, SEEDS)
def test_texture_is_zero_exactly_where_unseen(iuv: Tensor, size: int, seed: int) -> None:
    texture, visibility = extract_texture(photo_of(iuv, seed), iuv, CHARTS, size)
    assert ((visibility == 0) | (visibility == 1)).all()
    assert torch.equal(texture > 0, (visibility == 1).expand_as(texture))


@quick
@given(iuv_images(), SIZES, SEEDS)
def test_seen_texels_lie_between_the_visible_pixels(iuv: Tensor, size: int, seed: int) -> None:
    body = iuv[:, 0] > 0
    assume(body.any())
    photo = torch.where(body[:, None], photo_of(iuv, seed), 1e6)
    texture, visibility = extract_texture(photo, iuv, CHARTS, size)
    seen = texture[(visibility == 1).expand_as(texture)]
    visible = photo[body[:, None].expand_as(photo)]
    assert visible.min() - 1e-5 <= seen.min() and seen.max() <= visible.max() + 1e-5


@quick
@given(iuv_images(batch=3), SIZES, SEEDS, st.permutations(range(3)))
def test_order_of_the_batch_does_not_matter(
    iuv: Tensor, size: int, seed: int, order: list[int]
) -> None:
    photo = photo_of(iuv, seed)
    plain = extract_texture(photo, iuv, CHARTS, size)
    permuted = extract_texture(photo[order], iuv[order], CHARTS, size)
    for a, b in zip(plain, permuted, strict=True):
        torch.testing.assert_close(a[order], b, rtol=0, atol=1e-6)


@quick
@given(iuv_images(), SIZES, SEEDS, st.lists(st.integers(1, 24), max_size=24, unique=True))
def test_keeping_parts_only_removes(iuv: Tensor, size: int, seed: int, parts: list[int]) -> None:
    photo = photo_of(iuv, seed)
    _, everything = extract_texture(photo, iuv, CHARTS, size)
    kept = extract_texture(photo, keep_parts(iuv, tuple(parts)), CHARTS, size)
    rest = tuple(set(range(1, 25)) - set(parts))
    removed = extract_texture(photo, keep_parts(iuv, rest), CHARTS, size)
    assert torch.equal(merge_textures([kept, removed])[1], everything)
    for (_, visibility), chosen in ((kept, parts), (removed, rest)):
        shown = torch.isin(iuv[:, 0], torch.tensor(chosen, dtype=torch.uint8)).any()
        assert visibility.any() == shown


@thorough
@given(iuv_images(), SIZES, SEEDS)
def test_texture_equals_loops(iuv: Tensor, size: int, seed: int) -> None:
    photo = photo_of(iuv, seed)
    fast = extract_texture(photo, iuv, CHARTS, size)
    for a, b in zip(fast, extract_texture_loops(photo, iuv, CHARTS, size), strict=True):
        torch.testing.assert_close(a, b, rtol=0, atol=1e-5)


@thorough
@given(iuv_images(batch=1), SIZES, SEEDS)
def test_texture_without_torch_equals_loops(iuv: Tensor, size: int, seed: int) -> None:
    photo = photo_of(iuv, seed)
    image, own_iuv = (each[0].permute(1, 2, 0).numpy() for each in (photo, iuv))
    fast = unfolding.extract_texture(image, own_iuv, size)
    for a, b in zip(fast, extract_texture_loops(photo, iuv, CHARTS, size), strict=True):
        torch.testing.assert_close(torch.from_numpy(a)[None], b, rtol=0, atol=1e-5)


@thorough
@given(iuv_images(), SIZES, SEEDS)
def test_sampling_equals_loops(iuv: Tensor, size: int, seed: int) -> None:
    feature_map = map_of(size, seed, iuv.shape[0])
    fast = sample_features(feature_map, iuv, CHARTS)
    slow = sample_features_loops(feature_map, iuv, CHARTS)
    torch.testing.assert_close(fast, slow, rtol=0, atol=2e-5)


@quick
@given(iuv_images(), SIZES, SEEDS, st.floats(-4, 4), st.floats(-4, 4))
def test_sampling_is_linear_in_the_map(
    iuv: Tensor, size: int, seed: int, a: float, b: float
) -> None:
    one, two = map_of(size, seed), map_of(size, seed + 1)
    mixed = sample_features(a * one + b * two, iuv, CHARTS)
    apart = a * sample_features(one, iuv, CHARTS) + b * sample_features(two, iuv, CHARTS)
    torch.testing.assert_close(mixed, apart, rtol=0, atol=1e-5)


@quick
@given(iuv_images(), SIZES, st.floats(-(2.0**126), 2.0**126, width=32).filter(bool))
def test_background_stays_zero(iuv: Tensor, size: int, value: float) -> None:
    image = sample_features(torch.full((1, 2, size, size), value), iuv, CHARTS)
    background = (iuv[:, :1] == 0).expand_as(image)
    assert (image[background] == 0).all()
    assert image.isfinite().all()


@pytest.mark.parametrize("maps", [1, 3])
@quick
@given(iuv_images(batch=3), SIZES, SEEDS)
def test_an_image_does_not_depend_on_its_batch(
    maps: int, iuv: Tensor, size: int, seed: int
) -> None:
    feature_map = map_of(size, seed, maps)
    together = sample_features(feature_map, iuv, CHARTS)
    for i in range(3):
        own = feature_map[i % maps][None]
        alone = sample_features(own, iuv[i : i + 1], CHARTS)
        torch.testing.assert_close(together[i : i + 1], alone, rtol=0, atol=1e-6)
