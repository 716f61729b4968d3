"""Metrics: equal to the definitions they name, and to themselves under a full mask."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.linalg import sqrtm
from skimage.metrics import structural_similarity

import motion_transfer
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.training.metrics import (
    LATTICE_PERIODS,
    average_ssim,
    feature_distance,
    flat_windows,
    flicker,
    frechet_distance,
    l1,
    lattice_energy,
    person_mask,
    psnr,
    shown_pixels,
    ssim,
    ssim_map,
)

DEMO = Path(motion_transfer.__file__).parent / "demo/source.png"


def noisy(image: np.ndarray, sigma: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, sigma, image.shape)
    return np.clip(image + noise, 0, 255).round().astype(np.uint8)


@pytest.fixture(scope="module")
def photo() -> np.ndarray:
    return read_photo(DEMO).rgb


@pytest.fixture(scope="module")
def random() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (57, 83, 3), np.uint8)


@pytest.fixture(params=["photo", "random"])
def image(request) -> np.ndarray:
    return request.getfixturevalue(request.param)


@pytest.mark.parametrize("sigma", [0, 5, 60])
def test_ssim_equals_scikit_image(image: np.ndarray, sigma: float) -> None:
    other = noisy(image[::-1] if sigma == 60 else image, sigma)
    expected = structural_similarity(
        image,
        other,
        channel_axis=2,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=255,
    )
    assert ssim(image, other) == pytest.approx(expected, abs=1e-6)


def test_masked_ssim_is_the_mean_of_the_map_over_the_mask(photo: np.ndarray) -> None:
    other = noisy(photo, 30)
    mask = np.zeros(photo.shape[:2], bool)
    mask[40:80, 50:70] = True
    expected = ssim_map(photo, other)[40:80, 50:70].mean()
    assert average_ssim(ssim_map(photo, other), mask) == pytest.approx(expected, rel=1e-12)


def test_psnr_by_hand() -> None:
    first = np.zeros((2, 2, 3), np.uint8)
    second = first.copy()
    second[0, 0] = (10, 20, 20)  # squared error 900 over 12 values: 75
    assert psnr(first, second) == pytest.approx(10 * np.log10(65025 / 75))
    assert psnr(first, first) == float("inf")
    mask = np.array([[True, False], [False, False]])
    assert psnr(first, second, mask) == pytest.approx(10 * np.log10(65025 / 300))
    assert psnr(first, second, ~mask) == float("inf")


def test_l1_by_hand_and_without_wrapping_around() -> None:
    first = np.full((2, 2, 3), 250, np.uint8)
    second = first.copy()
    second[0, 0] = (4, 250, 250)
    assert l1(first, second) == pytest.approx(246 / 12)
    assert l1(second, first) == pytest.approx(246 / 12)
    mask = np.array([[True, False], [False, True]])
    assert l1(first, second, mask) == pytest.approx(246 / 6)


@pytest.mark.parametrize("metric", [ssim, psnr, l1])
def test_a_full_mask_changes_nothing(photo: np.ndarray, metric: Callable) -> None:
    other = noisy(photo, 20)
    full = np.ones(photo.shape[:2], bool)
    assert metric(photo, other, full) == pytest.approx(metric(photo, other), rel=1e-12)
    assert np.isnan(metric(photo, other, ~full))


@pytest.mark.parametrize("metric", [ssim, psnr, l1])
def test_only_the_mask_counts(photo: np.ndarray, metric: Callable) -> None:
    mask = np.zeros(photo.shape[:2], bool)
    mask[30:60, 30:60] = True
    spoilt = photo.copy()
    spoilt[: 30 - 6] = 0  # further away than the window of SSIM reaches
    assert metric(photo, spoilt, mask) == metric(photo, photo, mask)
    spoilt[45, 45] ^= 255
    assert metric(photo, spoilt, mask) != metric(photo, photo, mask)


def features(images: list[np.ndarray]) -> list[torch.Tensor]:
    """Two layers of a small random network."""
    generator = torch.Generator().manual_seed(0)
    batch = torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float() / 127.5 - 1
    layers = []
    for inputs, outputs in ((3, 8), (8, 16)):
        kernel = torch.randn(outputs, inputs, 3, 3, generator=generator)
        batch = torch.relu(torch.conv2d(batch, kernel, stride=2))
        layers.append(batch)
    return layers


def test_the_feature_distance_grows_with_noise(photo: np.ndarray) -> None:
    images = [photo, *(noisy(photo, sigma) for sigma in (2, 5, 10, 20, 40))]
    layers = features(images)
    real, rendered = [maps[:1] for maps in layers], layers
    distances = feature_distance(rendered, real)
    assert distances[0] == 0
    assert distances == sorted(distances)
    assert len(set(distances)) == len(distances)
    assert 0 < distances[-1] <= 2


def test_the_feature_distance_by_hand() -> None:
    first = [torch.tensor([[[[3.0, 0.0]], [[4.0, 1.0]]]])]  # 1 x 2 x 1 x 2
    second = [torch.tensor([[[[0.0, 0.0]], [[1.0, 5.0]]]])]
    expected = np.hypot(0.6, 0.8 - 1) / 2  # the second position points the same way
    assert feature_distance(first, second) == pytest.approx([expected])
    left = np.array([[True, True, False, False]])
    assert feature_distance(first, second, left) == pytest.approx([2 * expected])
    full = np.ones((4, 4), bool)
    assert feature_distance(first, second, full) == pytest.approx([expected])


def test_a_still_does_not_flicker_and_noise_does(studio) -> None:
    iuv = studio.iuv(scale=2, size=(192, 128))
    frame = studio.dress(iuv)
    assert flicker(frame, iuv, frame, iuv) == 0
    levels = [flicker(frame, iuv, noisy(frame, sigma), iuv) for sigma in (2, 8, 30)]
    assert 0 < levels[0] < levels[1] < levels[2]


def test_motion_alone_is_no_flicker(studio) -> None:
    """The same flat colours elsewhere in the frame: pixels change, texels do not."""
    here, there = (studio.iuv(x, 3, scale=2, size=(220, 180)) for x in (0, 40))
    first, second = studio.dress(here), studio.dress(there)
    assert l1(first, second) > 20
    assert flicker(first, here, second, there) == 0
    assert flicker(first, here, noisy(second, 30), there) > 3


def test_frames_that_share_nothing_have_no_flicker(studio) -> None:
    iuv, other = studio.iuv(parts=(23,)), studio.iuv(parts=(13,))
    frame = studio.dress(iuv)
    assert np.isnan(flicker(frame, iuv, frame, other))


@pytest.mark.parametrize("count", [5, 40])  # fewer vectors than dimensions, and more
def test_the_frechet_distance_is_its_formula(count: int) -> None:
    rng = np.random.default_rng(0)
    x, y = rng.normal(0, 1, (count, 8)), rng.normal(0.5, 2, (30, 8)) @ rng.normal(0, 1, (8, 8))
    a, b = np.cov(x.T), np.cov(y.T)
    root = sqrtm(a @ b).real
    expected = ((x.mean(0) - y.mean(0)) ** 2).sum() + np.trace(a + b - 2 * root)
    assert frechet_distance(x, y) == pytest.approx(expected, rel=1e-6)
    assert frechet_distance(x, x) == pytest.approx(0, abs=1e-9)
    with pytest.raises(ValueError, match="at least two"):
        frechet_distance(x[:1], y)


def test_the_mask_is_alpha_or_the_grown_iuv(studio) -> None:
    iuv = studio.iuv(scale=2, size=(192, 128))
    grown = person_mask(iuv, None)
    body = iuv[..., 0] > 0
    assert grown[body].all()
    rows, wide = np.flatnonzero(body.any(1)), np.flatnonzero(grown.any(1))
    height = rows[-1] - rows[0] + 1
    assert 0 < rows[0] - wide[0] <= height * 0.05 + 1
    alpha = np.zeros(iuv.shape[:2], np.uint8)
    alpha[5:9, 5:9], alpha[20, 20] = 128, 127
    np.testing.assert_array_equal(person_mask(iuv, alpha), alpha == 128)
    assert not person_mask(np.zeros_like(iuv), None).any()


def lattice(period: int, amplitude: float, *, across: bool, down: bool) -> np.ndarray:
    """a cos(2 pi x / p), a cos(2 pi y / p), or their product, as H x W x 1."""
    wave = np.cos(2 * np.pi * np.arange(160) / period)
    flat = np.ones(160)
    return amplitude * np.outer(wave if down else flat, wave if across else flat)[..., None]


def shaded() -> np.ndarray:
    """A smooth picture: a wide wave on a slope, another in each channel."""
    y, x = np.mgrid[:160, :160]
    return np.stack([110 + 30 * np.sin(x / 40 + y / 60), 90 + 0.3 * x, 140 - 0.2 * y], -1)


def rounded(picture: np.ndarray) -> np.ndarray:
    return picture.clip(0, 255).round().astype(np.uint8)


ANYWHERE = flat_windows(np.full((160, 160, 3), 90, np.uint8), np.ones((160, 160), bool))


@pytest.mark.parametrize(("across", "down"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("period", LATTICE_PERIODS)
@pytest.mark.parametrize("amplitude", [3, 12])
def test_a_lattice_has_its_mean_square(
    period: int, amplitude: int, across: bool, down: bool
) -> None:
    added = lattice(period, amplitude, across=across, down=down)
    found = lattice_energy(rounded(shaded() + added), ANYWHERE)
    for other, energy in zip(LATTICE_PERIODS, found, strict=True):
        wanted = (added**2).mean() if other == period else 0
        assert energy == pytest.approx(wanted, rel=0.03, abs=0.05)


def test_what_is_smooth_and_noise_have_no_lattice() -> None:
    assert lattice_energy(rounded(shaded()), ANYWHERE) == pytest.approx((0, 0, 0), abs=0.01)
    noise = noisy(rounded(shaded()), 10)  # 100 levels^2, all frequencies together
    assert lattice_energy(noise, ANYWHERE) == pytest.approx((0, 0, 0), abs=0.3)
    both = rounded(noise + lattice(4, 6, across=True, down=False))
    assert lattice_energy(both, ANYWHERE)[1] == pytest.approx(18, abs=1)


@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
def test_an_edge_is_no_lattice(slope: float) -> None:
    """A step of 60 levels, whose own mean square is 900."""
    y, x = np.mgrid[:160, :160]
    picture = rounded(90 + 60 * (x - slope * y > 40)[..., None] + np.zeros(3))
    found = lattice_energy(picture, ANYWHERE)
    assert min(found) > -5 and max(found) < 1


def test_lattices_are_looked_for_where_the_target_is_flat() -> None:
    reference = rounded(shaded() + lattice(8, 40, across=True, down=False))
    mask = np.zeros((160, 160), bool)
    assert len(flat_windows(reference, mask)) == 0
    assert np.isnan(lattice_energy(reference, flat_windows(reference, mask))).all()
    reference[:, :80] = rounded(shaded())[:, :80]
    mask[8:41, 8:] = True
    # 33 rows hold windows at one multiple of 8 px
    assert flat_windows(reference, mask).tolist() == [[8, column] for column in range(8, 49, 8)]


def test_pixels_are_shown_where_the_source_has_their_texel(studio) -> None:
    whole, half = studio.iuv(scale=2, size=(220, 180)), studio.iuv(parts=(2, 23))
    shown = shown_pixels(half, whole)
    known = np.isin(whole[..., 0], (2, 23))
    assert shown[known].mean() > 0.95
    assert not shown[whole[..., 0] == 0].any()
    assert shown[(whole[..., 0] > 0) & ~known].mean() < 0.05
    np.testing.assert_array_equal(shown_pixels(whole, whole), whole[..., 0] > 0)
