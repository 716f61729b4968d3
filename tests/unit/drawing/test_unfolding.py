"""Unfolding without torch: the same as the functions of `nhrr_core` that it stands in for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from jaxtyping import Float32, UInt8
from torch import Tensor

import nhrr_core
from motion_transfer.drawing.unfolding import (
    extract_texture,
    keep_parts,
    pixels_per_texel,
    smooth_coordinates,
    texel_index,
    texture_coordinates,
    unfold_clearance,
)
from nhrr_core import clearance, load_uv_layout

CHARTS = load_uv_layout().charts
DEMO = Path(__file__).parents[3] / "motion_transfer" / "demo"

Iuv = UInt8[np.ndarray, "H W 3"]


def stack(image: np.ndarray) -> Tensor:
    """A picture, channels last, as a batch of one."""
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(image, -1, 0)))[None]


def person(studio) -> Iuv:
    return studio.iuv(2, -1, scale=3, size=(288, 192))


def noise(_studio) -> Iuv:
    """Every part, U and V, and hardly a neighbour that joins another."""
    iuv = np.random.default_rng(0).integers(0, 256, (90, 70, 3), np.uint8)
    iuv[..., 0] %= 25
    return iuv


def patches(_studio) -> Iuv:
    """Smooth patches of all parts, from fine to coarse, some of which tear and some of which end.

    They cross the charts to their ends, where no next entry is.
    """
    down, right = np.indices((20, 30))
    rows = []
    for step in (0.7, 3, 9, 14, 60):
        part = 1 + (right // 2 + round(step)) % 24 * (right % 2)
        rows.append(np.dstack([part, (right * step).clip(0, 255), (down * step).clip(0, 255)]))
    for part in (2, 24):
        rows.append(np.dstack([right * 0 + part, 255 - 8 * right.clip(0, 31), 255 - 12 * down]))
    return np.concatenate(rows).clip(0, 255).astype(np.uint8)


PICTURES = {"person": person, "noise": noise, "patches": patches}


@pytest.fixture(params=PICTURES)
def iuv(request, studio) -> Iuv:
    return PICTURES[request.param](studio)


def photo_of(iuv: Iuv, channels: int = 3) -> Float32[np.ndarray, "H W C"]:
    random = np.random.default_rng(1)
    return random.uniform(-1, 1, (*iuv.shape[:2], channels)).astype(np.float32)


def assert_unfolds_alike(
    image: np.ndarray, iuv: Iuv, size: int, *, within: float = 1e-6, apart: int = 0
) -> None:
    """The same values, but for so many that differ by what one of several points makes."""
    texture, visibility = extract_texture(image, iuv, size)
    wanted, seen = nhrr_core.extract_texture(stack(image), stack(iuv), CHARTS, size)
    assert texture.dtype == visibility.dtype == np.float32
    np.testing.assert_array_equal(visibility, seen[0])
    away = np.abs(texture - wanted[0].numpy())
    assert np.count_nonzero(away > within) <= apart
    assert away.max() < 0.1


@pytest.mark.parametrize("size", [1, 33, 128, 256])
def test_a_texture_is_that_of_its_twin(iuv: Iuv, size: int) -> None:
    assert iuv[..., 0].any()
    assert_unfolds_alike(photo_of(iuv), iuv, size)


@pytest.mark.parametrize(
    ("photo", "size"), [("demo/source.png", 256), ("densepose_demo/demo_im.jpg", 512)]
)
def test_so_is_that_of_a_photo(request, photo: str, size: int) -> None:
    """Within what torch's sums in float32 lose where many pixels fall into one texel.

    Of the points that fill between pixels, one may lie on the border of two texels.
    """
    folder = DEMO.parent if photo.startswith("demo") else request.getfixturevalue("samples")
    path = folder / photo
    rgb, iuv = (cv2.imread(str(p)) for p in (path, path.with_name(f"{path.stem}_IUV.png")))
    assert rgb is not None and iuv is not None
    assert_unfolds_alike(rgb.astype(np.float32) / 127.5 - 1, iuv, size, within=5e-5, apart=6)


def test_nobody_is_seen_nowhere() -> None:
    iuv = np.zeros((4, 5, 3), np.uint8)
    texture, visibility = extract_texture(photo_of(iuv, 2), iuv, 16)
    assert (texture.shape, visibility.shape) == ((2, 16, 16), (1, 16, 16))
    assert not texture.any() and not visibility.any()


def test_a_part_that_is_none_is_refused() -> None:
    with pytest.raises(IndexError):
        extract_texture(np.ones((1, 1, 1), np.float32), np.full((1, 1, 3), 25, np.uint8), 16)


def test_places_are_those_of_the_charts(iuv: Iuv) -> None:
    place = texture_coordinates(iuv)
    wanted = nhrr_core.texture_coordinates(stack(iuv), CHARTS)[0]
    np.testing.assert_array_equal(place, np.moveaxis(wanted.numpy(), -1, 0))


def test_places_between_levels_are_those_of_the_twin(iuv: Iuv) -> None:
    """Bit for bit, as texels are told apart by them."""
    place, body = smooth_coordinates(iuv), iuv[..., 0] > 0
    wanted = nhrr_core.smooth_coordinates(stack(iuv), CHARTS)[0].permute(2, 0, 1).numpy()
    np.testing.assert_array_equal(place[:, body], wanted[:, body])
    assert not place[:, ~body].any()


def test_nobody_lies_nowhere() -> None:
    assert not smooth_coordinates(np.zeros((9, 5, 3), np.uint8)).any()


def test_texels_are_counted_by_rows() -> None:
    place = np.array([[0, 0.26, 1.0], [0, 0.99, 1.0]], np.float32)
    assert texel_index(place, 4).tolist() == [0, 13, 15]


@pytest.mark.parametrize("parts", [(), (2, 24), nhrr_core.ALL_PARTS])
def test_kept_parts_are_those_of_its_twin(iuv: Iuv, parts: tuple[int, ...]) -> None:
    wanted = nhrr_core.keep_parts(stack(iuv), parts)
    np.testing.assert_array_equal(stack(keep_parts(iuv, parts)), wanted)


def test_clearance_is_that_of_its_twin(iuv: Iuv) -> None:
    lengths = photo_of(iuv, 1)[..., 0] * 9
    measured = np.random.default_rng(2).random(lengths.shape) < 0.5
    wanted = nhrr_core.unfold_clearance(
        stack(lengths[..., None]), stack(measured[..., None]), stack(iuv), CHARTS
    )
    found = unfold_clearance(lengths, measured, iuv)
    np.testing.assert_array_equal(found[1], wanted[0, 1])
    np.testing.assert_allclose(found, wanted[0], rtol=0, atol=2e-6)


@pytest.mark.parametrize("make", [*PICTURES.values(), lambda _: np.zeros((3, 3, 3), np.uint8)])
def test_so_are_the_pixels_along_a_texel(studio, make: Callable[..., Iuv]) -> None:
    wanted = clearance.pixels_per_texel(stack(make(studio)), CHARTS).item()
    assert pixels_per_texel(make(studio)) == pytest.approx(wanted, rel=1e-6)
