"""Logits become an IUV image: against the same done in full, and by what it promises."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch
from estimate_stubs import iuv_logits
from numpy.lib.stride_tricks import sliding_window_view
from torch.nn import functional as F

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.iuv.painting import FINEST, paint_iuv
from motion_transfer.estimate.iuv.weights import PARTS


def paint(parts: np.ndarray, window: Box, box: Box, *uv: float) -> np.ndarray:
    """Paint what says these parts, with a U and V everywhere."""
    return paint_iuv(*(logits[0].numpy() for logits in iuv_logits(parts, *uv)), window, box)


def smooth_logits(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Random logits as soft as a network's, and U and V that reach beyond 0 and 1."""
    rng = np.random.default_rng(seed)
    parts = np.stack([cv2.resize(rng.normal(0, 4, (12, 12)), (128, 128)) for _ in range(PARTS)])
    parts[0] += 3
    uv = np.stack([cv2.resize(rng.normal(0.5, 0.4, (9, 9)), (128, 128)) for _ in range(48)])
    return parts.astype(np.float32), uv.reshape(24, 2, 128, 128).astype(np.float32)


def smoothed(parts: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """U and V, averaged over the largest of three squares that is all one part."""
    likeliest, out = parts.argmax(0), uv.copy()
    for reach in (1, 2, 3):
        side, inner = (2 * reach + 1,) * 2, np.s_[reach:-reach, reach:-reach]
        alone = sliding_window_view(likeliest, side) == likeliest[inner][..., None, None]
        means = sliding_window_view(uv, side, axis=(2, 3)).mean((-2, -1))
        for part in range(1, PARTS):
            own = alone.all((-2, -1)) & (likeliest[inner] == part)
            out[part - 1][:, *inner][:, own] = means[part - 1][:, own]
    return out


@pytest.mark.parametrize("size", [2, 90, 128, 413, FINEST])
def test_it_is_what_enlarging_everything_gives(size: int) -> None:
    parts, uv = smooth_logits(size)
    window = Box(3, 5, 3 + size, 5 + size)
    painted = paint_iuv(parts, uv, window, window)
    logits = np.concatenate([parts, smoothed(parts, uv).reshape(48, 128, 128)])
    assert not np.array_equal(logits[PARTS:], uv.reshape(48, 128, 128))
    planes = torch.from_numpy(logits)[None].double()
    large = F.interpolate(planes, (size, size), mode="bilinear", align_corners=False)[0].numpy()
    which = large[:PARTS].argmax(0)
    assert (painted[..., 0] != which).mean() <= 1e-4  # where two are as high but for rounding
    places = large[PARTS:].reshape(24, 2, size, size).clip(0, 1) * 255
    true = np.take_along_axis(places, (which - 1).clip(0)[None, None], 0)[0].transpose(1, 2, 0)
    same = (painted[..., 0] == which) & (which > 0)
    assert (same.any() and (which == 0).any()) or size == 2
    assert np.abs(painted[same][:, 1:] - true[same]).max(initial=0) <= 0.5 + 1e-3
    assert (painted[painted[..., 0] == 0] == 0).all()


def test_at_the_networks_size_it_is_what_the_network_says() -> None:
    parts = np.random.default_rng(0).integers(0, PARTS, (128, 128))
    window = Box(5, 7, 133, 135)
    iuv = paint(parts, window, window, 0.4)
    assert np.array_equal(iuv[..., 0], parts)
    assert set(np.unique(iuv[parts > 0][:, 1:])) == {102}
    assert (iuv[parts == 0] == 0).all()


@pytest.mark.parametrize("side", [300, FINEST + 500])
def test_larger_windows_keep_places(side: int) -> None:
    parts = np.zeros((128, 128), int)
    parts[32:96, 40:80] = 2
    window = Box(-20, -30, side - 20, side - 30)
    box = Box(0, 0, side, side + 10)  # beyond the window at right and bottom
    painted = paint(parts, window, box)[..., 0] == 2
    rows, columns = np.flatnonzero(painted.any(1)), np.flatnonzero(painted.any(0))
    scale = side / 128
    assert rows[[0, -1]] == pytest.approx([32 * scale - 30, 96 * scale - 30], abs=scale + 2)
    assert columns[[0, -1]] == pytest.approx([40 * scale - 20, 80 * scale - 20], abs=scale + 2)
    assert not painted[side - 30 :].any()


def test_a_box_elsewhere_shows_nobody() -> None:
    parts = np.full((128, 128), 2)
    window = Box(0, 0, 200, 200)
    assert not paint(parts, window, Box(300, 10, 340, 50)).any()
    assert not paint(np.zeros((128, 128), int), window, window).any()
    assert paint(parts, window, Box(199, 199, 220, 220))[..., 0].sum() == 2  # one pixel of part 2


def test_uv_never_crosses_a_border() -> None:
    parts = np.zeros((128, 128), int)
    parts[:, 64:], parts[:, :64] = 1, 2
    logits, uv = (each[0].numpy() for each in iuv_logits(parts))
    uv[0], uv[1] = 0.1, 0.9
    iuv = paint_iuv(logits, uv, Box(0, 0, 500, 500), Box(0, 0, 500, 500))
    assert set(np.unique(iuv[iuv[..., 0] == 1][:, 1:])) == {26}
    assert set(np.unique(iuv[iuv[..., 0] == 2][:, 1:])) == {230}
