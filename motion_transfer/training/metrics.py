"""How far a rendered picture is from the real one. Numbers only: no files, no networks.

Convention: pictures are uint8 RGB, H x W x 3; a mask is bool, H x W, True where pixels count, and
None counts all. Sums are in float64. Where a mask leaves nothing to count the result is NaN.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int, UInt8
from numpy.lib.stride_tricks import sliding_window_view
from torch import Tensor

from motion_transfer.drawing.person import COVERS, bounding_box, disc, occupancy
from nhrr_core import extract_texture, load_uv_layout, texture_coordinates

Image = UInt8[np.ndarray, "H W 3"]
Mask = Bool[np.ndarray, "H W"]

PEAK = 255.0
SSIM_WINDOW = 11
SSIM_SIGMA = 1.5
SSIM_K1, SSIM_K2 = 0.01, 0.03
MASK_GROWTH = 0.05  # of the person's height: hair and clothes reach beyond the IUV by about that
FLICKER_TEXELS = 128  # side of the texture that flicker is measured in: a few pixels a texel
SHOWN_TEXELS = 128  # likewise, where what a photo shows of a body is compared with another
LATTICE_PERIODS = (2, 4, 8)  # px: what up-sampling two, four and eight times leaves behind
LATTICE_WINDOW, LATTICE_STRIDE = 32, 8  # px: four of the longest periods; overlapping
FLAT_LEVELS = 8.0  # rms of 255 around its plane, up to which a window counts as flat; by the eye


def ssim(first: Image, second: Image, mask: Mask | None = None) -> float:
    """Measure the structural similarity, at most 1.

    Each channel's map of a Gaussian window of 11 x 11 px, sigma 1.5, K1 0.01, K2 0.03, range 255,
    population covariance; the mean over channels and over all pixels (of the mask) whose window
    lies inside the picture. Equals scikit-image's `structural_similarity` with
    `gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=255`.

    Source: Wang, Bovik, Sheikh, Simoncelli, IEEE TIP 2004. Departs from it: colour channels are
    averaged instead of reduced to luminance, as the literature on pose transfer does.
    """
    return average_ssim(ssim_map(first, second), mask)


def average_ssim(likeness: Float[np.ndarray, "H W"], mask: Mask | None = None) -> float:
    """Average an SSIM map over the pixels whose window lies inside the picture."""
    border = SSIM_WINDOW // 2
    inside = np.s_[border:-border, border:-border]
    return _mean(likeness[inside], None if mask is None else mask[inside])


def ssim_map(first: Image, second: Image) -> Float[np.ndarray, "H W"]:
    """Map the structural similarity around each pixel, mean over channels, mirrored at borders."""
    offsets = np.arange(SSIM_WINDOW) - SSIM_WINDOW // 2
    window = np.exp(-(offsets**2) / (2 * SSIM_SIGMA**2))
    window /= window.sum()
    a, b = first.astype(np.float64), second.astype(np.float64)

    def smooth(image: np.ndarray) -> np.ndarray:
        return cv2.sepFilter2D(image, cv2.CV_64F, window, window, borderType=cv2.BORDER_REFLECT)

    mean_a, mean_b = smooth(a), smooth(b)
    variances = smooth(a * a + b * b) - mean_a**2 - mean_b**2
    covariance = smooth(a * b) - mean_a * mean_b
    c1, c2 = (SSIM_K1 * PEAK) ** 2, (SSIM_K2 * PEAK) ** 2
    likeness = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    likeness /= (mean_a**2 + mean_b**2 + c1) * (variances + c2)
    return likeness.mean(-1)


def psnr(first: Image, second: Image, mask: Mask | None = None) -> float:
    """Measure the peak signal-to-noise ratio, 10 log10(255^2 / MSE) dB; infinite if equal."""
    difference = first.astype(np.float64) - second
    error = _mean((difference**2).mean(-1), mask)
    return float("inf") if error == 0 else float(10 * np.log10(PEAK**2 / error))


def l1(first: Image, second: Image, mask: Mask | None = None) -> float:
    """Measure the mean absolute difference, in levels of 0..255."""
    return _mean(np.abs(first.astype(np.float64) - second).mean(-1), mask)


def person_mask(iuv: UInt8[np.ndarray, "H W 3"], alpha: UInt8[np.ndarray, "H W"] | None) -> Mask:
    """Mark where the person is: alpha of at least one half; without alpha the IUV, grown.

    It grows by 5 % of the person's height, as hair and loose clothes leave the IUV.
    """
    if alpha is not None:
        return alpha >= COVERS
    height = bounding_box(iuv).height
    return cv2.dilate(occupancy(iuv), disc(height * MASK_GROWTH)) > 0


def feature_distance(
    first: Sequence[Float[Tensor, "N C H W"]],
    second: Sequence[Float[Tensor, "N C H W"]],
    mask: Mask | None = None,
) -> list[float]:
    """Measure the distance of deep features, for each of N pictures, in [0, 2].

    At each position of each layer the channels are scaled to unit length; the distance is the
    Euclidean length of the difference, averaged over positions (weighted by the mask, reduced by
    area), then over layers. Like LPIPS (Zhang et al., CVPR 2018), but with lengths instead of
    squares and without weights learned from people's judgement, hence never to be called that.
    """
    layers = []
    for a, b in zip(first, second, strict=True):
        difference = F.normalize(a.double(), dim=1) - F.normalize(b.double(), dim=1)
        lengths = difference.square().sum(1).sqrt()
        if mask is None:
            layers.append(lengths.mean((1, 2)))
            continue
        weight = torch.from_numpy(mask).to(lengths)[None, None]
        weight = F.adaptive_avg_pool2d(weight, (lengths.shape[1], lengths.shape[2]))[0, 0]
        layers.append((lengths * weight).sum((1, 2)) / weight.sum())
    return torch.stack(layers).mean(0).tolist()


def flicker(
    first: Image,
    first_iuv: UInt8[np.ndarray, "H W 3"],
    second: Image,
    second_iuv: UInt8[np.ndarray, "H W 3"],
) -> float:
    """Measure the change between consecutive frames that motion does not explain, in 0..255.

    Both frames are unfolded through their own IUV into a texture of 128 x 128 texels, where a body
    that only moves stays in place. The result is the mean absolute difference over the texels
    that both frames show; 0 for a still. Real videos are not at 0 (light, folds, faults of the
    IUV): compare with the real video's own. Sees nothing outside the IUV, such as loose hair.
    """
    images, iuvs = (
        torch.from_numpy(np.stack(pair)).permute(0, 3, 1, 2)
        for pair in ((first, second), (first_iuv, second_iuv))
    )
    texture, visibility = extract_texture(
        images.float(), iuvs, load_uv_layout().charts, FLICKER_TEXELS
    )
    both = (visibility[0, 0] * visibility[1, 0]).bool().numpy()
    change = (texture[0] - texture[1]).abs().double().mean(0).numpy()
    return _mean(change, both)


def flat_windows(reference: Image, mask: Mask) -> Int[np.ndarray, "N 2"]:
    """Find the windows of 32 x 32 px inside the mask in which a picture is smooth.

    Smooth is what a plane through its colours explains up to 8 levels of 255 (rms, mean of
    channels): there, whatever repeats in another picture of the same is that one's own.

    Returns: Row and column of each window's first pixel, multiples of 8 px.
    """
    inside = sliding_window_view(mask, (LATTICE_WINDOW, LATTICE_WINDOW))
    corners = np.argwhere(inside[::LATTICE_STRIDE, ::LATTICE_STRIDE].all((2, 3))) * LATTICE_STRIDE
    rest = _without_plane(_windows(reference, corners))
    return corners[np.sqrt((rest**2).mean((2, 3))).mean(1) <= FLAT_LEVELS]


def lattice_energy(image: Image, corners: Int[np.ndarray, "N 2"]) -> tuple[float, float, float]:
    """Measure how strongly patterns of a period of 2, 4 and 8 px stand out, in levels^2 of 255.

    Such lattices are what networks that up-sample leave behind ("checkerboard artifacts"; Odena et
    al., Distill 2016). Of each window's power spectrum (Hann window, plane removed) the bins of
    that period along x, along y, and along both count, less what the bins 2 nearer to and 2 further
    from the middle of the spectrum let expect there, if power falls as a power of the frequency, as
    it does for edges. A lattice of the form a cos(2 pi x / p) has a^2 / 2 (p = 2: a^2); what is
    smooth and white noise have about 0, to either side of it. The mean over windows and channels.

    Args:
        corners: Those of `flat_windows`; the picture has the reference's size.
    Returns: A number for each of LATTICE_PERIODS, NaN where there is no window.
    """
    if not len(corners):
        return (math.nan, math.nan, math.nan)
    taper = np.hanning(LATTICE_WINDOW + 1)[:-1]
    taper = np.outer(taper, taper)
    rest = _without_plane(_windows(image, corners)) * taper
    # a cosine's two bins together hold a^2 / 2, as its mean square does
    power = np.abs(np.fft.fft2(rest)) ** 2 / taper.sum() ** 2
    found = []
    for period in LATTICE_PERIODS:
        step = LATTICE_WINDOW // period
        signs = (0, 1) if period == 2 else (0, 1, -1)  # half the sampling rate is its own mirror
        ways = [(down, right) for down in signs for right in signs if down or right]
        # not of the mean spectrum: it is single spectra of noise whose bins are so spread
        found.append(sum(_excess(power, step, *way).mean() for way in ways))
    return found[0], found[1], found[2]


def shown_pixels(source_iuv: Image, target_iuv: Image) -> Mask:
    """Mark the pixels of the target's body whose place on the body the source shows.

    The IUV images may differ in size. Places are texels of a texture of 128 x 128; a source shows
    all of its own.
    """
    source, target = stack_iuv(source_iuv), stack_iuv(target_iuv)
    charts = load_uv_layout().charts
    _, visibility = extract_texture(source.float(), source, charts, SHOWN_TEXELS)
    place = texture_coordinates(target, charts)
    column, row = (place * SHOWN_TEXELS).long().clamp(0, SHOWN_TEXELS - 1).unbind(-1)
    return ((visibility[0, 0, row, column] > 0) & (target[:, 0] > 0))[0].numpy()


def stack_iuv(iuv: Image) -> UInt8[Tensor, "1 3 H W"]:
    """Make a batch of one IUV image."""
    return torch.from_numpy(np.ascontiguousarray(iuv)).permute(2, 0, 1)[None]


def frechet_distance(first: Float[np.ndarray, "N D"], second: Float[np.ndarray, "M D"]) -> float:
    """Measure the Fréchet distance of the normal distributions of two sets of feature vectors.

    |m1 - m2|^2 + tr(C1 + C2 - 2 (C1 C2)^(1/2)), covariances with N - 1; the trace of the root as
    the sum of singular values of X1 X2', which needs no root of a product that may be singular.
    Raises: ValueError where a set has fewer than two vectors.
    Source: Heusel et al., NeurIPS 2017.
    """
    if min(len(first), len(second)) < 2:
        raise ValueError("a distribution needs at least two feature vectors")
    centred, means = [], []
    for features in (first.astype(np.float64), second.astype(np.float64)):
        means.append(features.mean(0))
        rows = (features - means[-1]) / np.sqrt(len(features) - 1)
        if len(rows) > rows.shape[1]:
            rows = np.linalg.qr(rows, mode="r")  # has the same X' X in fewer rows
        centred.append(rows)
    # with Ci = Xi' Xi the eigenvalues of C1 C2 are the squared singular values of X1 X2'
    shared = np.linalg.svd(centred[0] @ centred[1].T, compute_uv=False).sum()
    spread = sum((rows**2).sum() for rows in centred)
    distance = ((means[0] - means[1]) ** 2).sum() + spread - 2 * shared
    return max(0.0, float(distance))  # equal sets may end a rounding error below


def _windows(image: Image, corners: Int[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 3 32 32"]:
    windows = sliding_window_view(image, (LATTICE_WINDOW, LATTICE_WINDOW), axis=(0, 1))
    return windows[corners[:, 0], corners[:, 1]].astype(np.float64)


def _without_plane(windows: Float[np.ndarray, "N 3 S S"]) -> Float[np.ndarray, "N 3 S S"]:
    """Subtract the plane of least squares: mean, and slope along x and y."""
    ramp = np.arange(windows.shape[-1]) - (windows.shape[-1] - 1) / 2
    rest = windows - windows.mean((2, 3), keepdims=True)
    across = (rest.mean(2) @ ramp / (ramp @ ramp))[..., None, None] * ramp
    down = (rest.mean(3) @ ramp / (ramp @ ramp))[..., None, None] * ramp[:, None]
    return rest - across - down


def _excess(power: Float[np.ndarray, "N 3 S S"], step: int, down: int, right: int) -> np.ndarray:
    """How far the bin `step` bins down and right stands out of the line from the middle to it.

    The next bins share a lattice's power, as a Hann window spreads it over three; those 2 away do
    not. Between them the expectation is linear in logarithms. Bins of white noise are distributed
    exponentially: the mean of x^a is its mean to the power of a, times the gamma function of 1 + a.
    """
    nearer, own, further = (
        power[..., (down * each) % LATTICE_WINDOW, (right * each) % LATTICE_WINDOW]
        for each in (step - 2, step, step + 2)
    )
    if step == LATTICE_WINDOW // 2:
        return own - nearer  # the one further is its mirror image
    weight = math.log(step / (step - 2)) / math.log((step + 2) / (step - 2))
    bias = math.gamma(2 - weight) * math.gamma(1 + weight)
    return own - nearer ** (1 - weight) * further**weight / bias


def _mean(values: Float[np.ndarray, "H W"], mask: Mask | None) -> float:
    if mask is not None:
        values = values[mask]
    return float(values.mean()) if values.size else float("nan")
